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
    """Common properties of all vehicles of a kind, and their construction in MuJoCo.

    Attributes:
        observed_fields: Fields of a sample after the time.
        columns: Columns of every flight, their labels and units, in the order of the file.
        thrusts: ``(columns so far, scenario) -> columns``: the rotors' thrusts, N.
        compile: ``(scenario, law_states, extra_actuators, userdata_size, visuals) -> model``.
            Raises `ValueError` where MuJoCo cannot build it.
        initial_motion: ``(plan) -> qpos, qvel`` at time zero.
        limit_exceeded: Function ``(time, values, reference, knots, follows_position) ->
            code`` of the first limit of `tiltsim.closed_loop.limits` that a sample exceeds;
            ``values`` begin with the observed fields.
        metrics: ``(columns, scenario, follows_position) -> metrics``, without the metrics that all
            kinds share. Columns have shape (..., N), the time (N,); numbers of the scenario may be
            arrays (..., 1); metrics have shape (...) and are NaN where a flight has none.
    """

    observed_fields: tuple[str, ...]
    columns: Mapping[str, Quantity]
    thrusts: Callable[[Mapping[str, Floats], Scenario], dict[str, Floats]]
    compile: Callable[[Scenario, int, tuple[ExtraActuators, ...], int, Visuals], mujoco.MjModel]
    initial_motion: Callable[[FlightPlan], tuple[Vector, Vector]]
    limit_exceeded: Callable[..., Any]
    metrics: Callable[[Mapping[str, Floats], Scenario, bool], dict[str, Any]]

    @property
    def rotors(self) -> tuple[int, ...]:
        """The numbers of the rotors."""
        return tuple(i for i in range(1, MAX_ROTORS + 1) if f"rotor_speed_{i}" in self.columns)


@dataclass(frozen=True, eq=False)
class Equations:
    """A controller on equations of motion: as the thesis prints them, or of a rigid body.

    Attributes:
        inputs: Function ``(time, state, parameters, knots) -> inputs``: the controller.
        inputs_size: Number of inputs.
        rates: Function ``(time, state, inputs, parameters, knots, disturbance) ->
            derivative`` of the state; the disturbance is an acceleration (m/s^2, world).
        initial: ``(plan, setup) -> state`` at time zero.
        observe: Function ``(time, state, inputs, parameters, knots) -> values`` of the
            loop's `sample_fields` after the time; ``inputs`` are in force at that time.
        project_onto_limits: Function ``(state, parameters) -> state`` for the end of each
            step: puts back what has passed a limit. None where there are no limits.
        tilts: Function ``(time, state, parameters, knots) -> tilt angles`` (rad), where
            they follow the plan exactly.
        states: Names of the coordinates of the vehicle's state, which begins the state: three for
            a rotation.
        input_names: Names of the first inputs; empty where they are the controls of the model.
    """

    inputs: Callable[..., Values]
    inputs_size: int
    rates: Callable[..., Values]
    initial: Callable[[FlightPlan, ControlSetup], Vector]
    observe: Callable[..., Values]
    project_onto_limits: Callable[..., Vector] | None = None
    tilts: Callable[..., Values] | None = None
    states: tuple[str, ...] = ()
    input_names: tuple[str, ...] = ()


def _held_controls(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
    """For controllers whose controls stay as they were sampled."""
    return ctrl


def nothing_singular(time: Any, values: Any, parameters: Any, knots: Any) -> tuple[float]:
    """For controllers that are singular nowhere."""
    return (1.0,)


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A controller around the model of a vehicle; a layer makes one such record of another.

    Attributes:
        kind: The kind of the vehicle.
        parameters: Record at the head of `userdata`; its first field is ``signature``. The knots of
            gait and reference follow it.
        setup: ``(plan, signature) -> ControlSetup``.
        model: Name of the MJCF model.
        sizes: Lengths of its vectors, the controller's own states among the activations.
        motion: Names of the coordinates of ``qpos`` and ``qvel``, three for a rotation.
        initial_activations: ``(plan, setup) -> act`` at time zero.
        controls: Function ``(time, qpos, qvel, act, parameters, knots) -> ctrl``: the whole control
            step.
        observe: Function ``(qpos, qvel, act, ctrl) -> values`` of the kind's fields and ``fields``.
        derive: ``(samples by field, setup) -> columns``: references, determinant, margin and the
            columns in ``further_units``.
        hold: Function ``(time, qpos, qvel, act, ctrl, parameters) -> ctrl``: the controls between
            the samples of a held controller.
        fields: Fields of a sample in addition to the fields of the vehicle's kind.
        further_units: Columns of a flight in addition to the columns of the vehicle's kind, with
            their units.
        observe_reads_controls: Whether ``observe`` needs the controls in force.
        sign_check_values: Function ``(time, values, parameters, knots) -> numbers``, from the time
            (s) of a sample and its ``values`` as ``observe`` returns them. They have to keep their
            signs: where one is zero, the controller is singular.
        causes: ``(sample by field, setup) -> texts``: why the flight ends where each of these
            reaches zero.
        controller_states: Number of activations that are states of the controller.
        spins: Signs of the rotor speeds, one per rotor of a rotorcraft.
        tilt_of_rotor: The number, from 0, of each rotor's tilt, -1 for a fixed one; empty for
            vehicles whose rotors lie on a cross.
        extra_actuators: Actuators that layers around the controller append to the model, innermost
            first.
        commands_thrusts: Whether the controller commands thrusts, not rates of the rotor speeds:
            these activations are then idle.
        equations: This controller on the thesis's equations; None where it is supported in MuJoCo
            only or, inside a layer, by `tiltsim.laws.layers.on_equations`.
        follows_position: Whether a scenario has the controller follow the reference's horizontal
            position.
        uses_gait: Whether the scenario's gait has a part in the flight.
        within: The loop that a layer of `tiltsim.laws.layers` goes around; None for a controller
            itself, its supervisor and allocation included.
        with_latency: The controller as it flies with a latency of its commands; None if it is the
            same.
        traced: Whether the controller can be traced; else it runs as plain Python.
    """

    kind: VehicleKind
    parameters: type[tuple[Any, ...]]
    setup: Callable[[FlightPlan, float], ControlSetup]
    model: str
    sizes: Sizes
    initial_activations: Callable[[FlightPlan, ControlSetup], Vector]
    controls: Callable[..., Values]
    observe: Callable[..., Values]
    derive: Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]]
    motion: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    hold: Callable[..., Values] = _held_controls
    fields: tuple[str, ...] = ()
    further_units: Mapping[str, str] = field(default_factory=dict)
    observe_reads_controls: bool = False
    sign_check_values: Callable[..., Values] = nothing_singular
    causes: Callable[[Mapping[str, float], ControlSetup], tuple[str, ...]] = lambda *_: ("",)
    controller_states: int = 0
    spins: Values = ()
    tilt_of_rotor: tuple[int, ...] = ()
    extra_actuators: tuple[ExtraActuators, ...] = ()
    commands_thrusts: bool = False
    equations: Equations | None = None
    follows_position: Callable[[Scenario], bool] = lambda _scenario: True
    uses_gait: bool = True
    within: ClosedLoop | None = None
    with_latency: Callable[[], ClosedLoop] | None = None
    traced: bool = True

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
