"""A scenario as pure functions of its numbers in JAX, for ``jit``, ``vmap`` and ``grad``."""

import warnings
from collections.abc import Mapping
from os import PathLike
from typing import Any, Final, NamedTuple

import numpy as np
from pydantic import BaseModel

from tiltsim.arrays.flying import Carried, Kernel, course_of
from tiltsim.arrays.jax_programs import InJax, require_jax
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.instruments import InstrumentTable
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario, plan_flight
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim.system.text import short_repr
from tiltsim_controllers.code.arrays import program_of
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.code.tracing import Expr
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
"""Keys that are no parameters, as the keys of instruments are not."""


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
        if key in FIXED or isinstance(value, InstrumentTable):
            continue
        inner = _numbers(value) if isinstance(value, BaseModel) else value
        if inner if isinstance(value, BaseModel) else _is_number(value):
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

    parameters: Any  # the loop's record
    reference: Any  # parameters of the reference
    knots: Any
    disturbance: Any  # m/s^2, world axes
    state: Any  # at time zero


class ArrayPlan:
    """Plans flights of a scenario with other numbers, which may be arrays of JAX.

    The plan of a flight is traced as control laws are. A number that it needs as such, to decide or
    to solve equations, is not among the `parameters`.

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
        self._planned = InJax(dtype)(self._plan)
        self.parameters: Tree = {}
        for name in TABLES:
            for key, value in _numbers(getattr(self._full, name)).items():
                if self._matters({name: {key: value}}):
                    self.parameters.setdefault(name, {})[key] = jax.tree.map(float, value)

    def _matters(self, tree: Tree) -> bool:
        """Whether a flight depends on numbers, and its plan can be traced without their values."""
        leaves, shape = self._jax.tree.flatten(tree)

        def traced(numbers: Any) -> Any:
            return self._plan(self._jax.tree.unflatten(shape, [*numbers]))

        try:
            program = program_of(traced, numbers=len(leaves))
        except (TraceError, TypeError, ValueError):  # of NumPy, or as no plan suits any number
            return False
        return any(isinstance(result, Expr) for result in program.block.results)

    def _plan(self, tree: Mapping[str, Any]) -> PlannedFlight:
        """The plan with its numbers replaced by the numbers of a tree, which are not checked."""
        loop, equations = self._loop, self._loop.required_equations
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pydantic expects no symbolic numbers
            scenario = replaced(self._full, tree)
            plan = plan_flight(scenario)
            setup = loop.setup(plan, loop.signature)
            state = equations.initial(plan, setup)
        disturbance = scenario.disturbance_acceleration
        return PlannedFlight(setup.parameters, plan.reference, setup.knots, disturbance, state)

    def __call__(self, tree: Mapping[str, Any]) -> PlannedFlight:
        """The plan of a flight with the numbers of a tree, which are not checked."""
        jax = self._jax
        flight: PlannedFlight = self._planned(_entries(tree))
        knots = flight.knots
        if any(isinstance(knot, jax.Array) for knot in knots):
            knots = jax.numpy.stack([*map(jax.numpy.asarray, knots)])
        return flight._replace(knots=knots)


def _entries(value: Any) -> Any:
    """A tree with tuples for lists and arrays, and Python's numbers for NumPy's."""
    if isinstance(value, Mapping):
        return {key: _entries(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list) or getattr(value, "ndim", None):
        return tuple(map(_entries, value))
    return value.item() if isinstance(value, np.ndarray | np.generic) else value


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
