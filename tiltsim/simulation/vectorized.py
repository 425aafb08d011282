"""A scenario as pure functions of its numbers in JAX, for ``jit``, ``vmap`` and ``grad``."""

from collections.abc import Mapping
from os import PathLike
from typing import Any

from tiltsim.arrays.flying import Carried, Kernel, course_of
from tiltsim.arrays.jax_programs import require_jax
from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.array_plan import ArrayPlan, Tree, in_full
from tiltsim.system.text import short_repr


def _check_keys(tree: Any, known: Tree, path: str = "parameters") -> None:
    """Refuse what is no tree of parameters of a scenario."""
    if not isinstance(tree, Mapping):
        raise InputError(f"{path} = {short_repr(tree)}: must be a dict")
    for key, value in tree.items():
        if key not in known:
            raise InputError(
                f"{path}.{key}: no parameter of this scenario; choose {', '.join(known)}"
            )
        if isinstance(known[key], dict):
            _check_keys(value, known[key], f"{path}.{key}")


class Vectorized:
    """A scenario on equations of motion as pure functions of a tree of parameters.

    The tree has the scenario's keys, table by table, and may leave out any of them. Its numbers
    may be arrays of JAX; they are not checked against the limits of the keys. A number that is not
    in `parameters` cannot vary: the flight does not depend on it, or its plan needs it as a number.

    Attributes:
        scenario: The scenario.
        parameters: Its own numbers, as such a tree.
    """

    def __init__(self, scenario: Scenario) -> None:
        if scenario.simulation.plant == "mujoco":
            raise InputError(
                'simulation.plant = "mujoco": vectorized supports "thesis" and "rigid_body" only'
            )
        self._jax = require_jax("tiltsim.vectorized")
        self.scenario = scenario
        self._assembly = assemble(in_full(scenario))
        self._course = course_of(self._assembly)
        self._planned = ArrayPlan(scenario, self._assembly.loop, self._course.dtype)
        self.parameters = self._planned.parameters

    def _kernel(self, tree: Mapping[str, Any]) -> tuple[Kernel, Any]:
        _check_keys(tree, self.parameters)
        if self._jax.numpy.result_type(float) != "float64" and self._course.dtype == "float64":
            raise InputError(
                'simulation.precision = "float64": needs jax.config.update("jax_enable_x64", True)'
            )
        try:
            parameters, _, knots, disturbance, state = self._planned(tree)
        except ValueError as error:  # of numbers that make no flight, such as a period of 0
            raise InputError(f"parameters: {error}") from error
        setup = ControlSetup(parameters, knots)
        return Kernel(self._course, setup, disturbance), state

    def _fields(self, samples: Any) -> dict[str, Any]:
        return dict(zip(self._assembly.loop.sample_fields, samples.T, strict=True))

    def initial(self, parameters: Mapping[str, Any]) -> Carried:
        """The state at time zero."""
        kernel, state = self._kernel(parameters)
        return kernel.start(state)

    def step(self, state: Carried, parameters: Mapping[str, Any]) -> Carried:
        """The state one time step later."""
        return self._kernel(parameters)[0].step(state)

    def observe(self, state: Carried, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """The fields of a sample of a state by name, as a flight records them."""
        return self._fields(self._kernel(parameters)[0].sample(state))

    def fly(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """The samples of a flight by field, shape (samples,); no limit ends it."""
        kernel, state = self._kernel(parameters)
        return self._fields(kernel.samples(kernel.start(state)))


def vectorized(scenario: Scenario | str | PathLike[str] | Mapping[str, Any]) -> Vectorized:
    """A scenario as pure functions ``initial``, ``step``, ``observe`` and ``fly`` in JAX.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes; on the plant thesis or rigid_body.

    Raises:
        InputError: If the scenario is invalid or in MuJoCo, or JAX is missing.
    """
    return Vectorized(load_scenario(scenario))
