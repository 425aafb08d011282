"""Full-pose control of multirotors of any layout in closed loops: the tilt angles are inputs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Monitoring,
    Sampling,
)
from tiltsim.equations.tiltrotor import body_fields, initial_state
from tiltsim.laws.multirotor_layout import Layout, layout_of_vehicle
from tiltsim.laws.quadrotor import constant_attitude_references
from tiltsim.laws.rotorcraft import (
    body_state,
    held_controls_of,
    thrust_controls_of,
    torque_free_columns,
)
from tiltsim.laws.tiltrotor import rotor_stops, servo_lead
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.tiltrotor_controllers import FullPoseController
from tiltsim.vehicles.rotorcraft import initial_rotor_speeds, initial_tilts, rotorcraft_kind
from tiltsim.vehicles.rotorcraft.layout import TILT_1, TILT_RATE_1
from tiltsim_controllers.laws.full_pose import limited_tilt_rate
from tiltsim_controllers.laws.multirotor_full_pose import Parameters, full_pose_law_of
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
from tiltsim_controllers.vehicle.multirotor import BODY_STATES, body_of, equations_of_motion_of

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters


@cache
def _sampling_of(layout: Layout) -> Sampling:
    """The control step: the law's tilt rates are integrated to the commands of the servos."""
    rotors, tilts = layout.places
    tilts_in, speeds_in = entries_of(TILT_1, tilts), entries_of(0, rotors)
    commands_in = entries_of(rotors, tilts)
    accelerations, rates_in = entries_of(0, rotors), entries_of(rotors, tilts)
    law, thrusts = full_pose_law_of(layout.tilt_of_rotor), thrust_controls_of(layout.spins)
    ahead = componentwise("ahead", "commands, lead, rates", "commands# + lead * rates#", tilts)
    # The law's limit sees a pod that stops at its servo's stop, but not the command beyond it.
    limited = componentwise(
        "limited_commands",
        "rates, commands, limits",
        "limited(rates#, commands#, limits)",
        tilts,
        limited=limited_tilt_rate,
    )

    @scalar
    def controls(
        time: float,
        qpos: Vector,
        qvel: Vector,
        act: Vector,
        parameters: LoopParameters,
        knots: Vector,
    ) -> Values:
        state = (*body_state(qpos, qvel), *tilts_in(qpos), *speeds_in(act))
        inputs = law(time, state, parameters.law, knots)
        commands = commands_in(act)
        rates = limited(rates_in(inputs), commands, parameters.law.limits)
        servos = ahead(commands, parameters.servo_lead, rates)
        return (*servos, *thrusts(act), *accelerations(inputs), *rates)

    return Sampling(controls, held_controls_of(layout.spins, tilts))


@cache
def _columns_of(layout: Layout) -> Columns:
    """Samples with the commands of the servos, and the columns of references and margin."""
    rotors, tilts = layout.places
    tilts_in, tilt_rates_in = entries_of(TILT_1, tilts), entries_of(TILT_RATE_1, tilts)
    speeds_in, commands_in = entries_of(0, rotors), entries_of(rotors, tilts)
    names, commands = layout.places.names("alpha_ref"), layout.places.names("tilt_command")

    @scalar
    def observe(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
        state = (*body_state(qpos, qvel), *tilts_in(qpos), *speeds_in(act))
        return (*state, *tilt_rates_in(qvel), *commands_in(act))

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        law = setup.parameters.law
        table = setup.knots[int(law.rotors) :]
        return {
            **constant_attitude_references(samples, law.reference, setup.knots),
            **{column: samples[name] for column, name in zip(names, commands, strict=True)},
            **torque_free_columns(layout.places, table, samples),
        }

    return Columns(observe, derive, fields=commands, units=dict.fromkeys(commands, "rad"))


@cache
def _equations_of(layout: Layout) -> Equations:
    """The law on the equations of motion, the tilt angles being states whose rates are inputs."""
    rotors, tilts = layout.places
    law, motion = full_pose_law_of(layout.tilt_of_rotor), equations_of_motion_of(layout[0])
    speeds_in, tilts_in = entries_of(BODY_STATES, rotors), entries_of(BODY_STATES + rotors, tilts)
    rates_in = entries_of(rotors, tilts)

    @scalar
    def inputs(time: float, state: Vector, parameters: LoopParameters, knots: Vector) -> Values:
        seen = (*body_fields(state), *tilts_in(state), *speeds_in(state))
        rates: Values = law(time, seen, parameters.law, knots)
        return rates

    @scalar
    def state_rates(
        time: float,
        state: Vector,
        inputs: Vector,
        parameters: LoopParameters,
        knots: Vector,
        disturbance: Triple,
    ) -> Values:
        own, angles = parameters.law, tilts_in(state)
        body = motion(state, angles, inputs, own.vehicle, knots, int(own.rotors), disturbance, 0.0)
        return (*body, *rates_in(inputs))

    @scalar
    def observe(
        time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
    ) -> Values:
        angles = tilts_in(state)
        return (*body_fields(state), *angles, *speeds_in(state), *rates_in(inputs), *angles)

    return Equations(
        inputs=inputs,
        inputs_size=rotors + tilts,
        rates=state_rates,
        initial=lambda plan, _setup: (
            *initial_state(plan.scenario, initial_rotor_speeds(plan)),
            *initial_tilts(plan)[0],
        ),
        observe=observe,
    )


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller, vehicle = plan.scenario.controller, plan.scenario.vehicle.resolve()
    assert isinstance(controller, FullPoseController)
    assert isinstance(vehicle, Multirotor)
    law = Parameters(
        vehicle=body_of(vehicle.mass, np.reshape(vehicle.inertia, (3, 3)), vehicle.gravity),
        gains=controller.resolve_gains(),
        reference=plan.reference,
        limits=controller.resolve_limits(),
        tilt_weight=controller.resolve_tilt_weight(vehicle),
        rotors=float(len(plan.knots)),
        failure=controller.resolve_failure(),
    )
    lead = servo_lead(plan.scenario.any_rotorcraft.tilt_servo)
    return ControlSetup(LoopParameters(signature, lead, law), (*plan.knots, *vehicle.table))


@cache
def full_pose_loop(layout: Layout) -> ClosedLoop:
    """Full-pose control of all multirotors of a layout."""
    sampling, equations, places = _sampling_of(layout), _equations_of(layout), layout.places
    speeds_in, stops = entries_of(places.speed_1, places.rotors), rotor_stops(places.rotors)
    for step in (sampling.controls, equations.inputs):
        step.__qualname__ = f"full_pose_{layout.name}"

    @scalar
    def speeds(time: float, values: Vector, parameters: LoopParameters, knots: Vector) -> Values:
        # A pod that turns across its thrust spans one plane with it at any angle: the rank of such
        # rotors' matrix changes only where one of them stops, whichever of them are lost.
        return speeds_in(values)

    return ClosedLoop(
        kind=rotorcraft_kind(places, ("singularity_margin",)),
        parameters=LoopParameters,
        setup=_setup,
        dynamics=Dynamics(
            f"multirotor_{layout.name}",
            places.sizes(places.tilts),
            lambda plan, _setup: (*initial_rotor_speeds(plan), *initial_tilts(plan)[0]),
            places.tilts,
            layout.spins,
            layout.tilt_of_rotor,
        ),
        sampling=sampling,
        columns=_columns_of(layout),
        monitoring=Monitoring(speeds, lambda _sample, _setup: stops),
        equations=equations,
    )


def full_pose_loop_of(scenario: Scenario, _measured: bool) -> ClosedLoop:
    """The full-pose loop of a scenario's multirotor, without layers; it measures nothing."""
    vehicle = scenario.vehicle.resolve()
    assert isinstance(vehicle, Multirotor)
    return full_pose_loop(layout_of_vehicle(vehicle))
