"""Functions of a closed loop in JAX: the same programs as on every other engine."""

import sys
from collections.abc import Callable
from typing import Any

from tiltsim.arrays.xla_flags import merges_loops
from tiltsim.system.public import optional_package
from tiltsim_controllers.code.arrays import as_tuples, program_of
from tiltsim_controllers.code.jax_function import results_in_jax

Function = Callable[..., Any]


def require_jax(purpose: str) -> Any:
    """JAX. Raises `InputError`, which begins with the purpose, unless it is installed."""
    return optional_package("jax", purpose, "'tiltsim[jax]'")


def recomputes() -> bool:
    """Whether XLA computes an intermediate value again wherever it is used."""
    import jax

    return jax.default_backend() == "cpu" and not merges_loops()


class InJax:
    """Runs functions as programs in JAX.

    Numbers that are arrays are inputs of the program; all others are constants, which it folds. A
    program is traced once for all arguments with the same constants.

    Args:
        dtype: "float64" or "float32".
    """

    def __init__(self, dtype: str) -> None:
        self._dtype = dtype
        self._known: dict[Any, Function] = {}

    def __call__(self, function: Function) -> Function:
        """A function whose arguments and results are nested tuples of numbers and arrays.

        A result that no array decides is a plain number.
        """

        def run(*args: Any) -> Any:
            jax = sys.modules["jax"]
            leaves, tree = jax.tree.flatten(args)
            arrays = [leaf for leaf in leaves if isinstance(leaf, jax.Array)]
            fixed = [None if isinstance(leaf, jax.Array) else leaf for leaf in leaves]
            # 0.0 is not -0.0.
            key = function, tree, repr(fixed), tuple(array.shape for array in arrays)
            if key not in self._known:
                self._known[key] = self._traced(function, tree, fixed, arrays)
            return self._known[key](arrays)

        return run

    def _traced(self, function: Function, tree: Any, fixed: list[Any], like: list[Any]) -> Function:
        jax = sys.modules["jax"]
        sizes = {f"array_{i}": len(a) if a.ndim else 1 for i, a in enumerate(like)}
        structure: list[Any] = []

        def traced(*given: Any) -> list[Any]:
            pairs = zip(given, like, strict=True)
            entries = iter([vector if array.ndim else vector[0] for vector, array in pairs])
            leaves = [next(entries) if leaf is None else leaf for leaf in fixed]
            result = function(*jax.tree.unflatten(tree, leaves))
            found, shape = jax.tree.flatten(as_tuples(result))
            structure[:] = [shape]
            return found

        program = program_of(traced, **sizes)
        in_segments = recomputes()

        def run(arrays: list[Any]) -> Any:
            vectors = [array if array.ndim else (array,) for array in arrays]
            results = results_in_jax(program, vectors, self._dtype, in_segments=in_segments)
            return jax.tree.unflatten(structure[0], results)

        return run
