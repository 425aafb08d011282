"""The controller of attitude and force in closed loops with multirotors of any layout.

Native code wants to know how many rotors there are, which tilt together and which way they turn, so
a loop is made for each such `Layout`, once. All other numbers of the vehicle are data: the table of
its rotors follows the knots of gait and reference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Monitoring,
    Sampling,
    SupervisedLaw,
)
from tiltsim.equations.tiltrotor import body_fields, initial_state
from tiltsim.laws.gait_feedforward import tracking_fields
from tiltsim.laws.rotorcraft import (
    CONDITION,
    body_state,
    held_controls_of,
    servo_commands_of,
    thrust_controls_of,
    torque_free_columns,
)
from tiltsim.laws.tiltrotor import (
    REFERENCE_COLUMNS,
    reference_columns,
    rotor_stops,
    servo_lead,
    singular_attitude,
)
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.multirotor_controllers import AttitudeForceController, upper_side
from tiltsim.vehicles.rotorcraft import initial_rotor_speeds, rotorcraft_kind
from tiltsim.vehicles.rotorcraft.layout import TILT_1, TILT_RATE_1
from tiltsim.vehicles.rotorcraft.layout import Layout as Places
from tiltsim_controllers.gaits.any_tilts import tilt_motion_of
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS, PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.gait_feedforward import INTEGRAL_FIELDS
from tiltsim_controllers.laws.multirotor import multirotor_law_of
from tiltsim_controllers.laws.multirotor_allocation import RotorRange
from tiltsim_controllers.laws.multirotor_inputs import independence_of
from tiltsim_controllers.laws.multirotor_steps import ATTITUDE_ERRORS, Form, Parameters, SideGains
from tiltsim_controllers.laws.multirotor_supervisor import (
    Watched,
    multirotor_supervision_of,
    watched,
)
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST
from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
from tiltsim_controllers.references.trajectories import position_reference
from tiltsim_controllers.vehicle.effectiveness import layout_of
from tiltsim_controllers.vehicle.multirotor import BODY_STATES, body_of, equations_of_motion_of
from tiltsim_controllers.vehicle.states import PITCH, ROLL

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario

NULL_PART: Final = "null_part"
"""A column: the share of the rotors' ``varpi |varpi|`` that neither force nor torque show."""

REFERENCES: Final = (*REFERENCE_COLUMNS, NULL_PART)
"""Columns of what the law asks for."""

Margins = Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]]

STATES: Final = len(INTEGRAL_FIELDS)
"""The controller's own, after the rotor speeds."""


class Layout(NamedTuple):
    """What a multirotor's compiled code is made for."""

    tilt_of_rotor: tuple[int, ...]  # from 0; -1 for a fixed rotor
    spins: Values

    @property
    def places(self) -> Places:
        """Where its numbers lie."""
        return Places(len(self.spins), max(self.tilt_of_rotor) + 1)

    @property
    def name(self) -> str:
        """For files and models."""
        tilts = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in self.tilt_of_rotor)
        return f"{tilts}_{''.join('p' if spin > 0.0 else 'm' for spin in self.spins)}"


class Direction(NamedTuple):
    """A vector in body axes."""

    x: float
    y: float
    z: float


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters
    upper_side: Direction  # see `tiltsim.scenario.multirotor_controllers.upper_side`


def layout_of_vehicle(vehicle: Multirotor) -> Layout:
    """The layout of a vehicle."""
    return Layout(layout_of(vehicle.table), vehicle.spins)


@scalar
def _by_model(qvel: Vector) -> None:
    """For a law that computes the angular acceleration by its model."""
    return


@cache
def _state_of(layout: Layout) -> Callable[..., Values]:
    """Scalar code of the state that the law knows: ``(qpos, qvel, act)``."""
    tilts_in = entries_of(TILT_1, layout.places.tilts)
    speeds_in = entries_of(0, layout.places.rotors)

    @scalar
    def state(qpos: Vector, qvel: Vector, act: Vector) -> Values:
        return (*body_state(qpos, qvel), *tilts_in(qpos), *speeds_in(act))

    return state


@cache
def _rates_of(layout: Layout, law: Callable[..., Values], measured: bool) -> Callable[..., Values]:
    """Scalar code of a law's controls from the rotor accelerations on; see `SupervisedLaw`.

    ``measured``: whether it reads, after MuJoCo's velocities, the plant's angular acceleration.
    """
    rotors, tilts = layout.places
    tilt_rates_in, integrals_in = entries_of(TILT_RATE_1, tilts), entries_of(rotors, STATES)
    acceleration_in = entries_of(TILT_RATE_1 + tilts, 3) if measured else _by_model
    rates_in = entries_of(0, rotors + STATES)

    @scalar
    def rates(
        time: float,
        state: Values,
        qvel: Vector,
        act: Vector,
        motion: Triple,
        parameters: LoopParameters,
        knots: Vector,
    ) -> Values:
        own, acceleration = parameters.law, acceleration_in(qvel)
        moving, integrals = tilt_rates_in(qvel), integrals_in(act)
        inputs = law(time, state, moving, integrals, own, knots, motion, acceleration)
        found: Values = rates_in(inputs)
        return found

    return rates


@cache
def _sampling_of(layout: Layout, rates: Callable[..., Values]) -> Sampling:
    """The control step in MuJoCo, by `_rates_of` a law."""
    tilts, state_of = layout.places.tilts, _state_of(layout)
    thrusts, servo_commands = thrust_controls_of(layout.spins), servo_commands_of(tilts)

    @scalar
    def controls(
        time: float,
        qpos: Vector,
        qvel: Vector,
        act: Vector,
        parameters: LoopParameters,
        knots: Vector,
    ) -> Values:
        own, state = parameters.law, state_of(qpos, qvel, act)
        return (
            *servo_commands(time, parameters.servo_lead, own.gait, knots),
            *thrusts(act),
            *rates(time, state, qvel, act, SUPERVISOR_AT_REST, parameters, knots),
        )

    return Sampling(controls, held_controls_of(layout.spins, tilts))


@cache
def _references_of(layout: Layout, law: Callable[..., Values]) -> Callable[..., Values]:
    """Scalar code of the columns `REFERENCES`; see `SupervisedLaw.references`."""
    rotors, tilts = layout.places
    first = layout.places.speed_1 + rotors
    state_in, rates_of_sample = entries_of(0, first), entries_of(first, tilts)
    integrals_of_sample = entries_of(first + tilts, STATES)
    asked_in = entries_of(rotors + STATES, 4)  # roll, pitch, yaw, null part

    @scalar
    def references(
        time: float, values: Vector, motion: Triple, parameters: LoopParameters, knots: Vector
    ) -> Values:
        own = parameters.law
        x, y, z, _, _, _, _, _, _ = position_reference(time, own.reference, knots)
        moving, integrals = rates_of_sample(values), integrals_of_sample(values)
        inputs = law(time, state_in(values), moving, integrals, own, knots, motion)
        return (x, y, z, *asked_in(inputs))

    return references


@cache
def _columns_of(layout: Layout, references: Callable[..., Values], margins: Margins) -> Columns:
    """Samples of flights under a law, and the columns of references, margin and null part."""
    places, state_of = layout.places, _state_of(layout)
    rotors, tilts = places
    tilt_rates_in, integrals_in = entries_of(TILT_RATE_1, tilts), entries_of(rotors, STATES)
    planned = tilt_motion_of(tilts).planned
    angles = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)

    @scalar
    def observe(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
        return (*state_of(qpos, qvel, act), *tilt_rates_in(qvel), *integrals_in(act))

    @scalar
    def asked(time: float, values: Vector, parameters: LoopParameters, knots: Vector) -> Values:
        jets = planned(time, parameters.law.gait, knots)
        return (*references(time, values, SUPERVISOR_AT_REST, parameters, knots), *angles(jets))

    names = (*REFERENCES, *places.names("alpha_ref"))

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        found = reference_columns(asked, _fields(layout), samples, setup, names)
        return {**found, **margins(samples, setup)}

    units = {**dict.fromkeys(INTEGRAL_FIELDS, "m s"), NULL_PART: "1", CONDITION: "1"}
    return Columns(observe, derive, fields=INTEGRAL_FIELDS, units=units)


def _fields(layout: Layout) -> tuple[str, ...]:
    """The fields of a sample."""
    return (*layout.places.observed_fields, *INTEGRAL_FIELDS)


@cache
def _margins_of(layout: Layout, dimension: int) -> Margins:
    """The columns that a sample's state alone decides."""
    return lambda samples, setup: torque_free_columns(
        layout.places, _table(setup), samples, dimension
    )


def _table(setup: ControlSetup) -> Values:
    """The table of the rotors, after the knots of gait and reference."""
    return setup.knots[int(setup.parameters.law.rotors) :]


@cache
def _monitoring_of(layout: Layout, form: Form) -> Monitoring:
    """Where the outputs depend on each other or, in the norm of the speeds, a rotor stops."""
    places = layout.places
    tilts_in = entries_of(places.alpha_1, places.tilts)
    turning = places.rotors if form.norm == "speed" else 0
    speeds_in = entries_of(places.speed_1, turning)
    independence, names = (
        independence_of(layout.tilt_of_rotor, form.dimension, form.forward),
        places.names("alpha"),
    )
    stops = rotor_stops(turning)
    harmless = (1.0,) * len(stops)  # as published, the factor 2 |varpi| is in rows of force only

    @scalar
    def sign_check_values(values: Vector, parameters: LoopParameters, knots: Vector) -> Values:
        own, side = parameters.law, parameters.upper_side
        up, to_side = world_up_in_body(values[ROLL], values[PITCH]), (side.x, side.y, side.z)
        share = independence(tilts_in(values), up, to_side, knots, int(own.rotors))
        if own.decoupling == PUBLISHED_DECOUPLING:
            return (share, *harmless)
        return (share, *speeds_in(values))

    def causes(sample: Mapping[str, float]) -> tuple[str, ...]:
        return (singular_attitude(sample, names), *stops)

    return Monitoring(sign_check_values, causes)


@cache
def _equations_of(layout: Layout, law: Callable[..., Values]) -> Equations:
    """The law on the equations of motion, with pods that follow the gait exactly."""
    rotors, tilts = layout.places
    motion = equations_of_motion_of(layout.tilt_of_rotor)
    planned = tilt_motion_of(tilts).planned
    angles = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)
    rates = componentwise("rates_of_jets", "jets", "jets#[1]", tilts)
    speeds_in = entries_of(BODY_STATES, rotors)
    integrals_in = entries_of(BODY_STATES + rotors, STATES)
    inputs_in, integral_rates = entries_of(0, rotors + STATES), entries_of(rotors, STATES)

    @scalar
    def inputs(time: float, state: Vector, parameters: LoopParameters, knots: Vector) -> Values:
        own = parameters.law
        jets = planned(time, own.gait, knots)
        seen = (*body_fields(state), *angles(jets), *speeds_in(state))
        return inputs_in(law(time, seen, rates(jets), integrals_in(state), own, knots))

    @scalar
    def tilts_of(time: float, state: Vector, parameters: LoopParameters, knots: Vector) -> Values:
        followed: Values = angles(planned(time, parameters.law.gait, knots))
        return followed

    @scalar
    def state_rates(
        time: float,
        state: Vector,
        inputs: Vector,
        parameters: LoopParameters,
        knots: Vector,
        disturbance: Triple,
    ) -> Values:
        own, tilts = parameters.law, tilts_of(time, state, parameters, knots)
        at = int(own.rotors)
        body = motion(state, tilts, inputs, own.vehicle, knots, at, disturbance, 0.0)
        return (*body, *integral_rates(inputs))

    @scalar
    def observe(
        time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
    ) -> Values:
        jets = planned(time, parameters.law.gait, knots)
        seen = (*body_fields(state), *angles(jets), *speeds_in(state))
        return (*seen, *rates(jets), *integrals_in(state))

    return Equations(
        inputs=inputs,
        inputs_size=rotors + STATES,
        rates=state_rates,
        initial=lambda plan, _setup: (
            *initial_state(plan.scenario, initial_rotor_speeds(plan)),
            *(0.0,) * STATES,
        ),
        observe=observe,
        tilts=tilts_of,
    )


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    scenario, gait = plan.scenario, plan.gait
    controller, vehicle = scenario.controller, scenario.vehicle.resolve()
    assert isinstance(controller, AttitudeForceController)
    assert isinstance(vehicle, Multirotor)
    dimension = controller.resolve_force(vehicle, gait).dimension
    inertia = np.reshape(vehicle.inertia, (3, 3))
    law = Parameters(
        vehicle=body_of(vehicle.mass, inertia, vehicle.gravity),
        **tracking_fields(plan),
        side=SideGains(*controller.side_gains),
        rotors=float(len(plan.knots)),
        decoupling=DECOUPLINGS[controller.decoupling],
        attitude=ATTITUDE_ERRORS[controller.attitude_error],
        restoring=controller.resolve_restoring(len(vehicle.spins), dimension, gait),
        slowest=controller.slowest_rotor,
        failure=controller.resolve_failure(),
        turn_time=controller.turn_time,
        limits=RotorRange(
            *scenario.any_rotorcraft.speeds_along_spin, controller.allocation_horizon
        ),
    )
    lead, side = servo_lead(scenario.any_rotorcraft.tilt_servo), upper_side(vehicle, gait)
    if controller.supervision is not None:
        law = law._replace(
            supervisor=controller.resolve_supervisor(vehicle),
            watched=watched(vehicle.table, len(plan.knots), side),
        )
    parameters = LoopParameters(signature, lead, law, Direction(*side))
    return ControlSetup(parameters, (*plan.knots, *vehicle.table))


def _follows_position(scenario: Scenario) -> bool:
    controller = scenario.controller
    assert isinstance(controller, AttitudeForceController)
    return controller.decoupler != "none"


@scalar
def _watched(parameters: LoopParameters) -> Watched:
    """What the supervisor reads of a vehicle."""
    return parameters.law.watched


@cache
def multirotor_loop(layout: Layout, form: Form, measured: bool = False) -> ClosedLoop:
    """The controller of attitude and force of all multirotors of a layout.

    Args:
        layout: Of the vehicles.
        form: Of the law.
        measured: Whether it feeds back the angular acceleration of the plant, which
            `tiltsim.laws.layers.measured_acceleration` measures.
    """
    places, rotors = layout.places, layout.tilt_of_rotor
    law = multirotor_law_of(rotors, form)
    rates, references = _rates_of(layout, law, measured), _references_of(layout, law)
    margins = _margins_of(layout, form.dimension)
    sampling, equations = _sampling_of(layout, rates), _equations_of(layout, law)
    for step in (sampling.controls, equations.inputs):
        name = f"attitude_force_{form.name}_{layout.name}"
        step.__qualname__ = f"measured.{name}" if measured else name
    return ClosedLoop(
        kind=rotorcraft_kind(places, ("singularity_margin",)),
        parameters=LoopParameters,
        setup=_setup,
        dynamics=Dynamics(
            f"multirotor_{layout.name}",
            places.sizes(STATES),
            lambda plan, _setup: (*initial_rotor_speeds(plan), *(0.0,) * STATES),
            STATES,
            layout.spins,
            layout.tilt_of_rotor,
        ),
        sampling=sampling,
        columns=_columns_of(layout, references, margins),
        monitoring=_monitoring_of(layout, form),
        equations=None if measured else equations,
        supervised=SupervisedLaw(
            multirotor_supervision_of(rotors, form.dimension, form.forward),
            _watched,
            _state_of(layout),
            rates,
            references,
            REFERENCES,
            _fields(layout),
            margins,
        )
        if form.supervised
        else None,
        follows_position=_follows_position,
        uses_gait=places.tilts > 0,
    )


def loop_of_multirotor(scenario: Scenario, measured: bool) -> ClosedLoop:
    """The `multirotor_loop` of a scenario, without layers."""
    controller, vehicle = scenario.controller, scenario.vehicle.resolve()
    assert isinstance(controller, AttitudeForceController)
    assert isinstance(vehicle, Multirotor)
    form = controller.resolve_force(vehicle, scenario.gait.plan(vehicle))
    return multirotor_loop(layout_of_vehicle(vehicle), form, measured)
