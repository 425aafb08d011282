"""Plans of a scenario's flights in JAX: functions of its numbers."""

import warnings
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from pydantic import BaseModel

from tiltsim.arrays.jax_arrays import JaxArrays
from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.values import PlainNumberError
from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.plants.flight_model import disturbance_acceleration
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim_controllers.mathematics.scalar import Triple
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


def in_full(scenario: Scenario) -> Scenario:
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
    """The numbers of a table by key; each table within is a tree."""
    found: Tree = {}
    for key, value in table:
        inner = _numbers(value) if isinstance(value, BaseModel) else value
        if key not in FIXED and (inner if isinstance(value, BaseModel) else _is_number(value)):
            found[key] = inner
    return found


def replaced(table: Any, tree: Mapping[str, Any]) -> Any:
    """A table with other numbers, which are not checked."""
    changes = {
        key: replaced(getattr(table, key), value) if isinstance(value, Mapping) else value
        for key, value in tree.items()
    }
    return table.model_copy(update=changes)


class PlannedFlight(NamedTuple):
    """A flight as functions of arrays see it; any of its numbers may be an array."""

    plan: FlightPlan
    parameters: Any  # the loop's record
    knots: Any
    disturbance: Triple  # m/s^2, world axes
    state: Any  # at time zero


class ArrayPlan:
    """Plans flights of a scenario with other numbers, which may be arrays of JAX.

    Args:
        scenario: The scenario; its numbers are in `parameters`.
        loop: Its loop, which has equations.
        dtype: "float64" or "float32".

    Attributes:
        parameters: The numbers that flights depend on, as a tree with the scenario's keys.
    """

    def __init__(self, scenario: Scenario, loop: ClosedLoop, dtype: str) -> None:
        import jax

        self._jax, self._loop, self._full = jax, loop, in_full(scenario)
        self._lifting = Lifting(JaxArrays(dtype), guarded=True, planning=True)
        self.parameters: Tree = {}
        for name in TABLES:
            for key, value in _numbers(getattr(self._full, name)).items():
                if self._matters({name: {key: value}}):
                    self.parameters.setdefault(name, {})[key] = jax.tree.map(float, value)

    def _matters(self, tree: Tree) -> bool:
        """Whether a flight depends on numbers, and its plan can have arrays in their place.

        Raises:
            LiftError: If code of the plan has no form on arrays, whatever numbers it is given.
        """
        refusals: tuple[type[Exception], ...] = (PlainNumberError, *self._lifting.arrays.refusals)
        try:
            traced = self._jax.make_jaxpr(lambda t: self(t)[1:])(tree).jaxpr
        except refusals:
            return False
        reached = {*map(id, traced.invars)}
        for equation in traced.eqns:
            if any(id(v) in reached for v in equation.invars):
                reached.update(map(id, equation.outvars))
        return any(id(v) in reached for v in traced.outvars)

    def __call__(self, tree: Mapping[str, Any]) -> PlannedFlight:
        """The plan with its numbers replaced by the numbers of a tree, which are not checked."""
        loop, lifting = self._loop, self._lifting
        equations = loop.equations
        assert equations is not None  # or flights on arrays are none of it
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pydantic expects no arrays
            scenario = replaced(self._full, tree)
            plan = lifting.plan(plan_flight, [scenario], {})
            setup = lifting.plan(loop.setup, [plan, loop.signature], {})
            if any(map(lifting.arrays.is_array, setup.knots)):
                setup = setup._replace(knots=lifting.arrays.vector(setup.knots))
            state = lifting.plan(equations.initial, [plan, setup], {})
        disturbance = disturbance_acceleration(scenario)
        return PlannedFlight(plan, setup.parameters, setup.knots, disturbance, state)
