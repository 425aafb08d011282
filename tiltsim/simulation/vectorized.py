"""A scenario as pure functions of its numbers in JAX, for ``jit``, ``vmap`` and ``grad``."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from os import PathLike
from typing import Any, Final

from pydantic import BaseModel

from tiltsim.arrays.flying import Carried, Kernel, course_of
from tiltsim.arrays.jax_arrays import JaxArrays, require_jax
from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.values import PlainNumberError
from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.plants.flight_model import disturbance_acceleration
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim_controllers.vehicle.parameters import Vehicle

Tree = dict[str, Any]

TABLES: Final = (
    "vehicle",
    "model_error",
    "initial",
    "controller",
    "gait",
    "reference",
    "sensors",
    "air",
)
"""Tables of a scenario whose numbers may be parameters."""

FIXED: Final = frozenset({"sample_time", "tilt_servo", "pod"})
"""Keys that are no parameters."""


def _in_full(scenario: Scenario) -> Scenario:
    """A scenario whose vehicle and gains are numbers, not the names of sets."""
    vehicle, controller = scenario.vehicle, scenario.controller
    resolved = vehicle.resolve()
    if isinstance(vehicle, VehicleTable) and isinstance(resolved, Vehicle):
        values = resolved._asdict()
        inertia = tuple(values.pop(f"inertia_{axis}") for axis in ("xx", "yy", "zz"))
        vehicle = vehicle.model_copy(update={**values, "inertia": inertia})
    return scenario.model_copy(update={"vehicle": vehicle, "controller": controller.in_full()})


def _is_number(value: Any) -> bool:
    if isinstance(value, tuple):
        return bool(value) and all(map(_is_number, value))
    return isinstance(value, float)


def _numbers(table: BaseModel) -> Tree:
    """The numbers of a table by key; tables within are trees of their own."""
    found: Tree = {}
    for key, value in table:
        inner = _numbers(value) if isinstance(value, BaseModel) else value
        if key not in FIXED and (inner if isinstance(value, BaseModel) else _is_number(value)):
            found[key] = inner
    return found


def _replaced(table: Any, tree: Mapping[str, Any]) -> Any:
    """A table with other numbers, which are not checked."""
    changes = {
        key: _replaced(getattr(table, key), value) if isinstance(value, Mapping) else value
        for key, value in tree.items()
    }
    return table.model_copy(update=changes)


def _check_keys(tree: Mapping[str, Any], known: Tree, path: str = "parameters") -> None:
    """Refuse keys that are no parameters of a scenario."""
    for key, value in tree.items():
        if key not in known:
            raise InputError(
                f"{path}.{key}: no parameter of this scenario; choose {', '.join(known)}"
            )
        if isinstance(value, Mapping):
            _check_keys(value, known[key], f"{path}.{key}")


class Vectorized:
    """A scenario on the thesis's equations as pure functions of a tree of parameters.

    The tree has the scenario's keys, table by table, and may leave out any of them. Its numbers
    may be arrays of JAX; they are not checked against the limits of the keys. A number that is not
    in `parameters` cannot vary: the flight does not depend on it, or its plan needs it as a number.

    Attributes:
        scenario: The scenario.
        parameters: Its own numbers, as such a tree.
    """

    def __init__(self, scenario: Scenario) -> None:
        if scenario.simulation.plant != "thesis":
            plant = scenario.simulation.plant
            raise InputError(f'simulation.plant = "{plant}": vectorized supports "thesis" only')
        self._jax = jax = require_jax("tiltsim.vectorized")
        self.scenario = scenario
        self._full = _in_full(scenario)
        self._assembly = assemble(self._full)
        self._course = course_of(self._assembly)
        self._lifting = Lifting(JaxArrays(self._course.dtype), guarded=True, planning=True)
        tables = {name: getattr(self._full, name) for name in TABLES}
        numbers = {name: _numbers(table) for name, table in tables.items()}
        self.parameters: Tree = {}
        for table, keys in numbers.items():
            for key, value in keys.items():
                if self._matters({table: {key: value}}):
                    self.parameters.setdefault(table, {})[key] = jax.tree.map(float, value)

    def _matters(self, tree: Tree) -> bool:
        """Whether a flight depends on numbers, and its plan can have arrays in their place.

        Raises:
            LiftError: If code of the plan has no form on arrays, whatever numbers it is given.
        """
        try:
            traced = self._jax.make_jaxpr(lambda t: self._planned(t)[1:])(tree).jaxpr
        except PlainNumberError:
            return False
        reached = {*map(id, traced.invars)}
        for equation in traced.eqns:
            if any(id(v) in reached for v in equation.invars):
                reached.update(map(id, equation.outvars))
        return any(id(v) in reached for v in traced.outvars)

    def _planned(self, tree: Mapping[str, Any]) -> tuple[FlightPlan, Any, Any, Any, Any]:
        """Plan, record, knots, disturbance and initial state of a flight."""
        loop, lifting = self._assembly.loop, self._lifting
        equations = loop.equations
        assert equations is not None  # on the thesis plant there are some
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pydantic expects no arrays
            scenario = _replaced(self._full, tree)
            plan = lifting.plan(plan_flight, [scenario], {})
            setup = lifting.plan(loop.setup, [plan, loop.signature], {})
            state = lifting.plan(equations.initial, [plan, setup], {})
        return plan, setup.parameters, setup.knots, disturbance_acceleration(scenario), state

    def _kernel(self, tree: Mapping[str, Any]) -> tuple[Kernel, Any]:
        if self._jax.numpy.result_type(float) != "float64" and self._course.dtype == "float64":
            raise InputError(
                'simulation.precision = "float64": needs jax.config.update("jax_enable_x64", True)'
            )
        _check_keys(tree, self.parameters)
        _, parameters, knots, disturbance, state = self._planned(tree)
        setup = ControlSetup(parameters, knots)
        return Kernel(self._course, setup, disturbance, guarded=True), state

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
        scenario: Anything that `tiltsim.load_scenario` takes; simulated by the thesis's equations.

    Raises:
        InputError: If the scenario is invalid or not on the thesis plant, or JAX is missing.
    """
    return Vectorized(load_scenario(scenario))
