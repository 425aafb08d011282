"""The controller of attitude and force in closed loops with multirotors of any layout."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    ControlSetup,
    Dynamics,
    Equations,
    Sampling,
    SupervisedLaw,
)
from tiltsim.equations.tiltrotor import body_fields, initial_state
from tiltsim.laws.gait_feedforward import tracking_fields
from tiltsim.laws.multirotor_columns import (
    REFERENCES,
    columns_of,
    fields_of,
    margins_of,
    monitoring_of,
    references_of,
)
from tiltsim.laws.multirotor_layout import (
    STATES,
    Direction,
    Layout,
    LoopParameters,
    law_state_of,
    layout_of_vehicle,
)
from tiltsim.laws.rotorcraft import held_controls_of, servo_commands_of, thrust_controls_of
from tiltsim.laws.tiltrotor import servo_lead
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.multirotor_controllers import AttitudeForceController, upper_side
from tiltsim.vehicles.rotorcraft import initial_rotor_speeds, rotorcraft_kind
from tiltsim.vehicles.rotorcraft.layout import TILT_RATE_1
from tiltsim_controllers.gaits.any_tilts import tilt_motion_of
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS
from tiltsim_controllers.laws.multirotor import multirotor_law_of
from tiltsim_controllers.laws.multirotor_allocation import RotorRange
from tiltsim_controllers.laws.multirotor_steps import ATTITUDE_ERRORS, Form, Parameters, SideGains
from tiltsim_controllers.laws.multirotor_supervisor import (
    Watched,
    multirotor_supervision_of,
    watched,
)
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
from tiltsim_controllers.vehicle.multirotor import BODY_STATES, body_of, equations_of_motion_of

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


@scalar
def _by_model(qvel: Vector) -> None:
    """For a law that computes the angular acceleration by its model."""
    return


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
    tilts, state_of = layout.places.tilts, law_state_of(layout)
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
    lost = controller.failed_rotor
    without = side if lost is None else upper_side(vehicle, gait, lost)
    parameters = LoopParameters(signature, lead, law, Direction(*side), Direction(*without))
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
    rates, references = _rates_of(layout, law, measured), references_of(layout, law)
    margins = margins_of(layout, form.dimension)
    sampling, equations = _sampling_of(layout, rates), _equations_of(layout, law)
    name = f"attitude_force_{form.name}_{layout.name}"
    sampling.controls.__qualname__ = f"measured.{name}" if measured else name
    equations.inputs.__qualname__ = name  # they measure nothing
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
        columns=columns_of(layout, references, margins),
        monitoring=monitoring_of(layout, form),
        equations=None if measured else equations,
        supervised=SupervisedLaw(
            multirotor_supervision_of(rotors, form.dimension, form.forward),
            _watched,
            law_state_of(layout),
            rates,
            references,
            REFERENCES,
            fields_of(layout),
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
