"""Functions of a closed loop in JAX: the same programs as on every other engine."""

import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from tiltsim.arrays.jax_arrays import recomputes
from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.traced_numbers import trace_scalar_code
from tiltsim_controllers.code.jax_function import results_in_jax
from tiltsim_controllers.code.program import InputVector

Function = Callable[..., Any]


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
        """A function whose arguments and results are nested tuples of numbers and arrays."""

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

        def traced(lifting: Lifting, given: tuple[InputVector, ...]) -> Iterable[Any]:
            def entries() -> Iterator[Any]:
                for vector, array in zip(given, like, strict=True):
                    yield vector if array.ndim else vector[0]

            following = entries()
            leaves = [next(following) if leaf is None else leaf for leaf in fixed]
            result = lifting(function)(*jax.tree.unflatten(tree, leaves))
            found, shape = jax.tree.flatten(result)
            structure[:] = [shape]
            return found

        program = trace_scalar_code(traced, **sizes)
        in_segments = recomputes()

        def run(arrays: list[Any]) -> Any:
            vectors = [array if array.ndim else (array,) for array in arrays]
            results = results_in_jax(program, vectors, self._dtype, in_segments=in_segments)
            return jax.tree.unflatten(structure[0], results)

        return run
