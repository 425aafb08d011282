"""A closed loop: a controller, as functions of arrays, around the model of a vehicle."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tiltsim.models.parts import ExtraActuators, Visuals
from tiltsim.models.vehicle_parts import MAX_ROTORS
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.system.text import Quantity, in_words
from tiltsim_controllers.mathematics.records import flatten, record_dtype, record_size
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector

if TYPE_CHECKING:
    import mujoco


class Sizes(NamedTuple):
    """Lengths of MuJoCo's vectors, of ``qpos`` and ``qvel`` the vehicle's part.

    Functions of a loop see the last two, which only flights with objects have, at the end of
    ``act``.
    """

    qpos: int
    qvel: int
    act: int
    ctrl: int
    others: int = 0  # of qpos: objects behind the vehicle
    history: int = 0  # readings of sensors in MuJoCo's state

    @property
    def after_act(self) -> int:
        """Numbers that functions of a loop see behind ``act``."""
        return self.others + self.history


class ControlSetup(NamedTuple):
    """Parameters of the control step of one flight."""

    parameters: Any  # the loop's record
    knots: tuple[float, ...] = ()  # knots of the gait, then knots of the reference

    @property
    def userdata(self) -> Floats:
        """Record and knots as MuJoCo's `userdata` holds them after its `Header`."""
        return np.array([*flatten(self.parameters), *self.knots])


@dataclass(frozen=True, eq=False)
class VehicleKind:
    """Common properties of all vehicles of a kind, and their construction in MuJoCo."""

    observed_fields: tuple[str, ...]  # fields of a sample after the time
    columns: Mapping[str, Quantity]
    """Columns of every flight, their labels and units, in the order of the file."""
    thrusts: Callable[[Mapping[str, Floats], Scenario], dict[str, Floats]]
    """``(columns so far, scenario) -> columns``: the rotors' thrusts, N."""
    compile: Callable[[Scenario, int, tuple[ExtraActuators, ...], int, Visuals], mujoco.MjModel]
    """``(scenario, law_states, extra_actuators, userdata_size, visuals) -> model``. Raises
    `ValueError` where MuJoCo cannot build it."""
    initial_motion: Callable[[FlightPlan], tuple[Vector, Vector]]
    """``(plan) -> qpos, qvel`` at time zero."""
    limit_exceeded: Callable[..., Any]
    """Function ``(time, values, reference, knots, follows_position) -> code`` of the first limit
    of `tiltsim.closed_loop.limits` that a sample exceeds; ``values`` begin with the observed
    fields."""
    metrics: Callable[[Mapping[str, Floats], Scenario, bool], dict[str, Any]]
    """``(columns, scenario, follows_position) -> metrics``, without the metrics that all kinds
    share. Columns have shape (..., N), the time (N,); numbers of the scenario may be arrays
    (..., 1); metrics have shape (...) and are NaN where a flight has none."""

    @property
    def rotors(self) -> tuple[int, ...]:
        """The numbers of the rotors."""
        return tuple(i for i in range(1, MAX_ROTORS + 1) if f"rotor_speed_{i}" in self.columns)


@dataclass(frozen=True, eq=False)
class Equations:
    """A controller on equations of motion: as the thesis prints them, or of a rigid body."""

    inputs: Callable[..., Values]
    """Function ``(time, state, parameters, knots) -> inputs``: the controller."""
    inputs_size: int  # number of inputs
    rates: Callable[..., Values]
    """Function ``(time, state, inputs, parameters, knots, disturbance) -> derivative`` of the
    state; the disturbance is an acceleration (m/s^2, world)."""
    initial: Callable[[FlightPlan, ControlSetup], Vector]  # ``(plan, setup) -> state`` at time zero
    observe: Callable[..., Values]
    """Function ``(time, state, inputs, parameters, knots) -> values`` of the loop's
    `sample_fields` after the time; ``inputs`` are in force at that time."""
    project_onto_limits: Callable[..., Vector] | None = None
    """Function ``(state, parameters) -> state`` for the end of each step: puts back what has
    passed a limit. None where there are no limits."""
    tilts: Callable[..., Values] | None = None
    """Function ``(time, state, parameters, knots) -> tilt angles`` (rad), where they follow the
    plan exactly."""
    states: tuple[str, ...] = ()
    """Names of the coordinates of the vehicle's state, which begins the state: three for a
    rotation."""
    input_names: tuple[str, ...] = ()
    """Names of the first inputs; empty where they are the controls of the model."""


def _held_controls(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
    """For controllers whose controls stay as they were sampled."""
    return ctrl


def nothing_singular(time: Any, values: Any, parameters: Any, knots: Any) -> tuple[float]:
    """For controllers that are singular nowhere."""
    return (1.0,)


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A controller around the model of a vehicle; a layer makes one such record of another."""

    kind: VehicleKind  # the kind of the vehicle
    parameters: type[tuple[Any, ...]]
    """Record at the head of `userdata`; its first field is ``signature``. The knots of gait and
    reference follow it."""
    setup: Callable[[FlightPlan, float], ControlSetup]  # ``(plan, signature) -> ControlSetup``
    model: str  # name of the MJCF model
    sizes: Sizes  # lengths of its vectors, the controller's own states among the activations
    initial_activations: Callable[[FlightPlan, ControlSetup], Vector]
    """``(plan, setup) -> act`` at time zero."""
    controls: Callable[..., Values]
    """Function ``(time, qpos, qvel, act, parameters, knots) -> ctrl``: the whole control step."""
    observe: Callable[..., Values]
    """Function ``(qpos, qvel, act, ctrl) -> values`` of the kind's fields and ``fields``."""
    derive: Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]]
    """``(samples by field, setup) -> columns``: references, determinant, margin and the columns in
    ``further_units``."""
    motion: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    """Names of the coordinates of ``qpos`` and ``qvel``, three for a rotation."""
    hold: Callable[..., Values] = _held_controls
    """Function ``(time, qpos, qvel, act, ctrl, parameters) -> ctrl``: the controls between the
    samples of a held controller."""
    fields: tuple[str, ...] = ()
    """Fields of a sample in addition to the fields of the vehicle's kind."""
    further_units: Mapping[str, str] = field(default_factory=dict)
    """Columns of a flight in addition to the columns of the vehicle's kind, with their units."""
    observe_reads_controls: bool = False  # whether ``observe`` needs the controls in force
    sign_check_values: Callable[..., Values] = nothing_singular
    """Function ``(time, values, parameters, knots) -> numbers``, from the time (s) of a sample and
    its ``values`` as ``observe`` returns them. They have to keep their signs: where one is
    zero, the controller is singular."""
    causes: Callable[[Mapping[str, float], ControlSetup], tuple[str, ...]] = lambda *_: ("",)
    """``(sample by field, setup) -> texts``: why the flight ends where each of these is zero."""
    controller_states: int = 0  # number of activations that are states of the controller
    spins: Values = ()  # signs of the rotor speeds, one per rotor of a rotorcraft
    tilt_of_rotor: tuple[int, ...] = ()  # number, from 0, of each one's tilt; -1 for a fixed one
    vehicle_record: Any = None
    """Type of the parameters of a rotorcraft, see `tiltsim.vehicles.rotorcraft.true_rotors`."""
    extra_actuators: tuple[ExtraActuators, ...] = ()
    """Actuators that layers around the controller append to the model, innermost first."""
    commands_thrusts: bool = False
    """Whether the controller commands thrusts, not rates of the rotor speeds: these activations
    are then idle."""
    equations: Equations | None = None
    """This controller on the thesis's equations; None where it is supported in MuJoCo only or,
    inside a layer, by `tiltsim.laws.layers.layer`."""
    follows_position: Callable[[Scenario], bool] = lambda _scenario: True
    """Whether a scenario has the controller follow the reference's horizontal position."""
    uses_gait: bool = True  # whether the scenario's gait has a part in the flight
    within: ClosedLoop | None = None
    """The loop that a layer of `tiltsim.laws.layers` goes around; None for a controller itself,
    its supervisor and allocation included."""
    sees: Callable[..., Any] = lambda _time, qpos, qvel, act, *_: (qpos, qvel, act)
    """Function ``(time, qpos, qvel, act, parameters, knots) -> qpos, qvel, act`` that the loop
    ``within`` sees."""
    with_latency: Callable[[], ClosedLoop] | None = None
    """The controller as it flies with a latency of its commands; None if it is the same."""
    traced: bool = True  # whether the controller can be traced; else it runs as plain Python

    @property
    def required_equations(self) -> Equations:
        """Its `equations`; other loops are refused where equations are integrated."""
        assert self.equations is not None
        return self.equations

    @property
    def is_traceable(self) -> bool:
        """Whether it can be traced with all its layers."""
        return self.traced and (self.within is None or self.within.is_traceable)

    @cached_property
    def signature(self) -> float:
        """A checksum of the layout of `userdata`, which distinguishes our models from others."""
        layout = (self.model, self.sizes, record_dtype(self.parameters))
        return float(zlib.crc32(repr(layout).encode()))

    @cached_property
    def record_size(self) -> int:
        """Number of floats of the parameter record."""
        return record_size(self.parameters)

    @cached_property
    def sample_fields(self) -> tuple[str, ...]:
        """The fields of a recorded sample, in order."""
        return ("time", *self.kind.observed_fields, *self.fields)

    @cached_property
    def units(self) -> dict[str, str]:
        """The columns of a flight and their units, in order."""
        own = {name: what.unit for name, what in self.kind.columns.items()}
        return {**own, **self.further_units}

    def label(self, column: str) -> Quantity:
        """The label and unit of a column of a flight."""
        known = self.kind.columns.get(column)
        return known or Quantity(in_words(column), self.units[column])
