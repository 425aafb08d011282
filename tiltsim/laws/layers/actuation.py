"""Real actuators and sensors around any law of the tiltrotor.

`with_actuation` puts a layer between a law and the vehicle. Each control step goes

    sensors -> law -> allocation -> latency -> servos and motors -> faults -> vehicle

and each of these stages does nothing by default. What has to be remembered lies in MuJoCo's state:
the speeds that the motors are told and the commands under way are activations, the commands in
force are controls of actuators that act on nothing. The control step thus stays a pure function
that restarts anywhere, and a scenario that has none of this flies without the layer.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.laws.tiltrotor import rotor_thrust_controls, servo_lead
from tiltsim.models.parts import ExtraActuators
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.laws.allocation import allocate_accelerations
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar
from tiltsim_controllers.vehicle.actuators import (
    Faults,
    RotorFault,
    limited_speed_command_rate,
    rate_limited_command,
    servo_command,
    thrust_factor,
)
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.sensors import (
    Sensor,
    Sensors,
    reading_error,
    reading_index,
    rotate_by_small_angle,
)

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan
    from tiltsim.scenario.scenario import Scenario

COMMANDS: Final = 8
"""What a law of the tiltrotor sends: four tilt angles (rad), four rotor accelerations."""

LAW_CONTROLS: Final = 12
"""Controls of the tiltrotor before those of its law's own states: servos, thrusts, rotor speeds."""

ROTOR_STATES: Final = 4
THRUST_FACTORS: Final = tuple(f"thrust_factor_{rotor}" for rotor in (1, 2, 3, 4))

DEFAULT_SAMPLE_TIME: Final = 0.01
"""s between readings of the sensors where neither they nor a held law say otherwise."""


class Allocation(NamedTuple):
    """How rotor accelerations are kept within the speed limits."""

    active: float  # 0: each rotor stops at its own limit
    horizon: float  # s
    min_speed: float  # rad/s, absolute
    max_speed: float
    vehicle: Vehicle


class Actuation(NamedTuple):
    """The parameters of the layer."""

    sensors: Sensors
    allocation: Allocation
    control_timestep: float  # s; 0 if continuous
    slowest: float  # rad/s, of a rotor along its spin
    fastest: float
    rotor_pole: float  # 1/s, one over the rotors' time constant; 0 where they follow at once
    servo_reach: float  # rad, see `tiltsim_controllers.vehicle.actuators.rate_limited_command`
    faults: Faults


@scalar
def measured_qpos(time: float, qpos: Vector, sensors: Sensors) -> Values:
    """MuJoCo's eleven ``qpos`` of the tiltrotor as the law is told them; tilts are exact."""
    x, y, z, qw, qx, qy, qz, alpha_1, alpha_2, alpha_3, alpha_4 = qpos
    if sensors.active == 0.0:
        return x, y, z, qw, qx, qy, qz, alpha_1, alpha_2, alpha_3, alpha_4
    index = reading_index(time, sensors.period)
    ex, ey, ez = reading_error(sensors.position, sensors.seed, 0.0, index)
    roll, pitch, yaw = reading_error(sensors.attitude, sensors.seed, 6.0, index)
    qw, qx, qy, qz = rotate_by_small_angle(qw, qx, qy, qz, roll, pitch, yaw)
    return x + ex, y + ey, z + ez, qw, qx, qy, qz, alpha_1, alpha_2, alpha_3, alpha_4


@scalar
def measured_qvel(time: float, qvel: Vector, sensors: Sensors) -> Values:
    """MuJoCo's ten ``qvel`` of the tiltrotor as the law is told them; tilt rates are exact."""
    vx, vy, vz, p, q, r, rate_1, rate_2, rate_3, rate_4 = qvel
    if sensors.active == 0.0:
        return vx, vy, vz, p, q, r, rate_1, rate_2, rate_3, rate_4
    index = reading_index(time, sensors.period)
    ex, ey, ez = reading_error(sensors.velocity, sensors.seed, 3.0, index)
    ep, eq, er = reading_error(sensors.body_rates, sensors.seed, 9.0, index)
    return vx + ex, vy + ey, vz + ez, p + ep, q + eq, r + er, rate_1, rate_2, rate_3, rate_4


@scalar
def allocated_accelerations(
    wanted: tuple[float, float, float, float], qpos: Vector, act: Vector, allocation: Allocation
) -> tuple[float, float, float, float]:
    """The law's rotor accelerations (rad/s^2), within the speed limits if asked for."""
    if allocation.active == 0.0:
        return wanted
    roll, pitch, _yaw = euler_from_quaternion(qpos[3], qpos[4], qpos[5], qpos[6])
    return allocate_accelerations(
        wanted,
        (qpos[7], qpos[8], qpos[9], qpos[10]),
        (act[0], act[1], act[2], act[3]),
        roll,
        pitch,
        allocation.vehicle,
        (allocation.min_speed, allocation.max_speed),
        allocation.horizon,
    )


@scalar
def servo_controls(
    time: float, qpos: Vector, commands: Vector, actuation: Actuation
) -> tuple[float, float, float, float]:
    """Set points (rad) of the four tilt servos."""
    reach, faults = actuation.servo_reach, actuation.faults
    return (
        rate_limited_command(servo_command(time, commands[0], faults.rotor_1), qpos[7], reach),
        rate_limited_command(servo_command(time, commands[1], faults.rotor_2), qpos[8], reach),
        rate_limited_command(servo_command(time, commands[2], faults.rotor_3), qpos[9], reach),
        rate_limited_command(servo_command(time, commands[3], faults.rotor_4), qpos[10], reach),
    )


@scalar
def thrust_controls(time: float, act: Vector, faults: Faults) -> tuple[float, float, float, float]:
    """Controls of the four thrust actuators, less what is broken."""
    thrust_1, thrust_2, thrust_3, thrust_4 = rotor_thrust_controls(act)
    return (
        thrust_1 * thrust_factor(time, faults.rotor_1),
        thrust_2 * thrust_factor(time, faults.rotor_2),
        thrust_3 * thrust_factor(time, faults.rotor_3),
        thrust_4 * thrust_factor(time, faults.rotor_4),
    )


@scalar
def motor_controls(
    act: Vector, first: int, commands: Vector, actuation: Actuation
) -> tuple[float, float, float, float]:
    """Rotor accelerations (rad/s^2): at once, or the lag's towards the speeds commanded.

    The commanded speeds are activations from ``first`` on.
    """
    pole = actuation.rotor_pole
    if pole == 0.0:
        return commands[4], commands[5], commands[6], commands[7]
    return (
        pole * (act[first] - act[0]),
        pole * (act[first + 1] - act[1]),
        pole * (act[first + 2] - act[2]),
        pole * (act[first + 3] - act[3]),
    )


@scalar
def speed_command_rates(
    act: Vector, first: int, commands: Vector, actuation: Actuation
) -> tuple[float, float, float, float]:
    """Rates (rad/s^2) of the speeds that the motors are told, activations from ``first`` on."""
    low, high = actuation.slowest, actuation.fastest
    return (
        limited_speed_command_rate(act[first], commands[4], -1.0, low, high),
        limited_speed_command_rate(act[first + 1], commands[5], 1.0, low, high),
        limited_speed_command_rate(act[first + 2], commands[6], -1.0, low, high),
        limited_speed_command_rate(act[first + 3], commands[7], 1.0, low, high),
    )


@scalar
def first_eight(values: Vector) -> Values:
    """The first eight of some numbers."""
    return (
        *(values[0], values[1], values[2], values[3]),
        *(values[4], values[5], values[6], values[7]),
    )


@cache
def _delay_line(first: int, steps: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Scalar code of a line of activations that hands commands on by one place a control step.

    The newest commands lie at ``first``, the oldest ``8 (steps - 1)`` further on. Returns
    ``delivered(act, sent)``, the commands that arrive, and ``rates(act, sent, control_timestep)``,
    with which each place has taken over its neighbour's commands by the next control step.
    """
    if steps == 0:

        @scalar
        def at_once(act: Vector, sent: Values) -> Values:
            return sent

        @scalar
        def no_rates(act: Vector, sent: Values, control_timestep: float) -> Values:
            return ()

        return at_once, no_rates

    oldest = first + COMMANDS * (steps - 1)
    _, older_rates = _delay_line(first + COMMANDS, steps - 1)

    @scalar
    def delivered(act: Vector, sent: Values) -> Values:
        return first_eight(act[oldest:])

    @scalar
    def rates(act: Vector, sent: Values, control_timestep: float) -> Values:
        here = first_eight(act[first:])
        return (
            (sent[0] - here[0]) / control_timestep,
            (sent[1] - here[1]) / control_timestep,
            (sent[2] - here[2]) / control_timestep,
            (sent[3] - here[3]) / control_timestep,
            (sent[4] - here[4]) / control_timestep,
            (sent[5] - here[5]) / control_timestep,
            (sent[6] - here[6]) / control_timestep,
            (sent[7] - here[7]) / control_timestep,
            *older_rates(act, here, control_timestep),
        )

    return delivered, rates


@cache
def with_actuation(loop: ClosedLoop, latency_steps: int) -> ClosedLoop:
    """A loop around the tiltrotor with real sensors and actuators.

    ``latency_steps`` is the number of control steps between a reading and its command taking
    effect.
    """
    law_controls = loop.sampling.controls
    law_act, law_ctrl = loop.dynamics.sizes.act, loop.dynamics.sizes.ctrl
    under_way = COMMANDS * latency_steps
    line_ctrl = law_ctrl + ROTOR_STATES  # the delay line's controls
    memory = line_ctrl + under_way  # the commands in force, last of the controls
    # The delay line follows the speeds that the motors are commanded.
    delivered, line_rates = _delay_line(law_act + ROTOR_STATES, latency_steps)

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        actuation = parameters.layer
        seen_qpos = measured_qpos(time, qpos, actuation.sensors)
        seen_qvel = measured_qvel(time, qvel, actuation.sensors)
        ctrl = law_controls(time, seen_qpos, seen_qvel, act, parameters.inner, knots)
        u1, u2, u3, u4 = allocated_accelerations(
            (ctrl[8], ctrl[9], ctrl[10], ctrl[11]), seen_qpos, act, actuation.allocation
        )
        sent = (ctrl[0], ctrl[1], ctrl[2], ctrl[3], u1, u2, u3, u4)
        commands = delivered(act, sent)
        return (
            *servo_controls(time, qpos, commands, actuation),
            *thrust_controls(time, act, actuation.faults),
            *motor_controls(act, law_act, commands, actuation),
            *ctrl[LAW_CONTROLS:],
            *speed_command_rates(act, law_act, commands, actuation),
            *line_rates(act, sent, actuation.control_timestep),
            *commands,
        )

    @scalar
    def hold(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: Any
    ) -> Values:
        actuation = parameters.layer
        commands = first_eight(ctrl[memory:])
        return (
            *servo_controls(time, qpos, commands, actuation),
            *thrust_controls(time, act, actuation.faults),
            *motor_controls(act, law_act, commands, actuation),
            *ctrl[LAW_CONTROLS:law_ctrl],
            *speed_command_rates(act, law_act, commands, actuation),
            *ctrl[line_ctrl:],
        )

    def initial_activations(plan: FlightPlan, _layer: Actuation, inner: Vector) -> Vector:
        waiting = (*initial_tilts(plan)[0], 0.0, 0.0, 0.0, 0.0) * latency_steps
        return (*inner[:ROTOR_STATES], *waiting)

    layer = Layer(
        f"with_actuation.{latency_steps}",
        Actuation,
        _actuation,
        controls=controls,
        hold=hold,
        actuators=ExtraActuators(states=ROTOR_STATES + under_way, memories=COMMANDS),
        initial_activations=initial_activations,
        derive=_derive,
        units=dict.fromkeys(THRUST_FACTORS, "1"),
    )
    return wrap_loop(loop, layer)


def _derive(
    inner: Callable[[], dict[str, Floats]], samples: Samples, setup: ControlSetup
) -> dict[str, Floats]:
    time = samples["time"].tolist()
    faults = zip(THRUST_FACTORS, setup.parameters.layer.faults, strict=True)
    return {
        **inner(),
        **{name: np.array([thrust_factor(t, fault) for t in time]) for name, fault in faults},
    }


def _actuation(plan: FlightPlan) -> Actuation:
    scenario = plan.scenario
    vehicle, simulation, controller = scenario.rotorcraft, scenario.simulation, scenario.controller
    low, high = vehicle.min_rotor_speed, vehicle.max_rotor_speed
    slowest, fastest = vehicle.speeds_along_spin
    max_rate, time_constant = vehicle.tilt_servo.max_rate, vehicle.rotor_time_constant
    return Actuation(
        sensors=sensor_parameters(scenario),
        allocation=Allocation(
            active=float(controller.prioritizes_attitude),
            horizon=controller.allocation_window,
            min_speed=low or 0.0,
            max_speed=inf if high is None else high,
            vehicle=vehicle.resolve(),
        ),
        control_timestep=simulation.control_timestep,
        slowest=slowest,
        fastest=fastest,
        rotor_pole=0.0 if time_constant is None else 1.0 / time_constant,
        servo_reach=inf if max_rate is None else servo_lead(vehicle.tilt_servo) * max_rate,
        faults=_faults(plan),
    )


def sensor_parameters(scenario: Scenario) -> Sensors:
    """What a scenario's law is told of the vehicle's motion."""
    table, simulation = scenario.sensors, scenario.simulation
    vectors = {
        name: Sensor(getattr(table, f"{name}_noise"), *getattr(table, f"{name}_bias"))
        for name in ("position", "velocity", "attitude", "body_rates")
    }
    return Sensors(
        active=float(table.have_errors),
        seed=float(simulation.seed),
        period=table.sample_time or simulation.control_timestep or DEFAULT_SAMPLE_TIME,
        **vectors,
    )


def _faults(plan: FlightPlan) -> Faults:
    faults = [RotorFault()] * ROTOR_STATES
    gait = plan.gait
    for table in plan.scenario.fault:
        fault = faults[table.rotor - 1]
        if table.type == "stuck_servo":
            planned = tilt_reference(table.time, gait.parameters, gait.knots)[table.rotor - 1]
            angle = planned if table.angle is None else table.angle
            fault = fault._replace(stuck_time=table.time, stuck_angle=angle)
        else:
            factor = 0.0 if table.type == "rotor_loss" else table.factor
            fault = fault._replace(thrust_time=table.time, thrust_factor=factor)
        faults[table.rotor - 1] = fault
    return Faults(*faults)
