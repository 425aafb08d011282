"""Real actuators and sensors around any controller of the tiltrotor.

`with_actuation` puts a layer between controller and vehicle. Each control step goes

    sensors -> controller -> allocation -> latency -> servos and motors -> faults -> vehicle

and by default each of these stages does nothing. Its memory is MuJoCo's state: the speed commands
of the motors and the commands under way are activations, the commands in force are controls of
actuators that act on nothing. So the control step remains a pure function that restarts anywhere,
and a scenario with ideal actuators runs without the layer.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.layers.delay_line import (
    COMMANDS,
    EXTERNAL_COMMANDS,
    delay_line,
    first_eight,
    held_line,
    undelayed,
)
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.laws.layers.sensing import measured_qpos, measured_qvel, sensor_parameters
from tiltsim.laws.tiltrotor import four, rotor_thrust_controls, servo_lead
from tiltsim.models.parts import ExtraActuators
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim.vehicles.rotorcraft.layout import (
    ACCELERATION_1,
    FURTHER_RATES,
    QW,
    QX,
    QY,
    QZ,
    ROTOR_STATES,
    TILT_1,
)
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.laws.allocation import allocate_accelerations
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Values, Vector, clipped, scalar
from tiltsim_controllers.vehicle.actuators import (
    Faults,
    RotorFault,
    rate_limited_command,
    servo_command,
    thrust_factor,
)
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.sensors import Sensors
from tiltsim_controllers.vehicle.states import ROTORS

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

THRUST_FACTORS: Final = tuple(f"thrust_factor_{rotor}" for rotor in ROTORS)


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
def allocated_accelerations(
    demanded: Quad, qpos: Vector, act: Vector, allocation: Allocation
) -> Quad:
    """The demanded rotor accelerations, within the speed limits if allocation is on.

    Args:
        demanded: By the controller, rad/s^2.
        qpos, act: MuJoCo's state.
        allocation: The parameters.
    """
    if allocation.active == 0.0:
        return demanded
    roll, pitch, _yaw = euler_from_quaternion(qpos[QW], qpos[QX], qpos[QY], qpos[QZ])
    return allocate_accelerations(
        demanded,
        four(qpos, TILT_1),
        four(act, 0),
        roll,
        pitch,
        allocation.vehicle,
        (allocation.min_speed, allocation.max_speed),
        allocation.horizon,
    )


@scalar
def _servo_controls(time: float, qpos: Vector, commands: Vector, actuation: Actuation) -> Quad:
    """Set points (rad) of the four tilt servos."""
    a1, a2, a3, a4 = four(qpos, TILT_1)
    reach, faults = actuation.servo_reach, actuation.faults
    return (
        rate_limited_command(servo_command(time, commands[0], faults.rotor_1), a1, reach),
        rate_limited_command(servo_command(time, commands[1], faults.rotor_2), a2, reach),
        rate_limited_command(servo_command(time, commands[2], faults.rotor_3), a3, reach),
        rate_limited_command(servo_command(time, commands[3], faults.rotor_4), a4, reach),
    )


@scalar
def thrust_controls(time: float, act: Vector, faults: Faults) -> Quad:
    """Controls of the four thrust actuators, reduced by faults."""
    thrust_1, thrust_2, thrust_3, thrust_4 = rotor_thrust_controls(act)
    return (
        thrust_1 * thrust_factor(time, faults.rotor_1),
        thrust_2 * thrust_factor(time, faults.rotor_2),
        thrust_3 * thrust_factor(time, faults.rotor_3),
        thrust_4 * thrust_factor(time, faults.rotor_4),
    )


@scalar
def _motor_controls(act: Vector, first: int, commands: Vector, actuation: Actuation) -> Quad:
    """Rotor accelerations (rad/s^2): as commanded, or by the lag behind the speed commands.

    The speed commands are activations from ``first`` on. The plant keeps them within the rotors'
    limits at the end of each step, `clipped` at the stages of an integrator, too.
    """
    pole, low, high = actuation.rotor_pole, actuation.slowest, actuation.fastest
    if pole == 0.0:
        return four(commands, 4)
    return (
        pole * (clipped(act[first], -high, -low) - act[0]),
        pole * (clipped(act[first + 1], low, high) - act[1]),
        pole * (clipped(act[first + 2], -high, -low) - act[2]),
        pole * (clipped(act[first + 3], low, high) - act[3]),
    )


@cache
def with_actuation(loop: ClosedLoop, latency_steps: int, external: bool = False) -> ClosedLoop:
    """A loop around the tiltrotor with real sensors and actuators.

    Args:
        loop: Without them.
        latency_steps: Control steps between a reading and its command taking effect.
        external: Whether commands come from outside. Then `tiltsim.plants.commanded_plant` moves
            the `EXTERNAL_COMMANDS` along the delay line: speeds jump, which no rate of activations
            can do.
    """
    law_controls = loop.sampling.controls
    law_act, law_ctrl = loop.dynamics.sizes.act, loop.dynamics.sizes.ctrl
    under_way = (EXTERNAL_COMMANDS if external else COMMANDS) * latency_steps
    line_ctrl = law_ctrl + ROTOR_STATES  # the delay line's controls
    memory = line_ctrl + under_way  # the commands in force, last of the controls
    # The delay line follows the speed commands of the motors.
    delivered, line_rates = (
        (undelayed, held_line(under_way))
        if external
        else delay_line(law_act + ROTOR_STATES, latency_steps)
    )

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        actuation = parameters.layer
        seen_qpos = measured_qpos(time, qpos, actuation.sensors)
        seen_qvel = measured_qvel(time, qvel, actuation.sensors)
        ctrl = law_controls(time, seen_qpos, seen_qvel, act, parameters.inner, knots)
        u1, u2, u3, u4 = allocated_accelerations(
            four(ctrl, ACCELERATION_1), seen_qpos, act, actuation.allocation
        )
        sent = (ctrl[0], ctrl[1], ctrl[2], ctrl[3], u1, u2, u3, u4)
        commands = delivered(act, sent)
        return (
            *_servo_controls(time, qpos, commands, actuation),
            *thrust_controls(time, act, actuation.faults),
            *_motor_controls(act, law_act, commands, actuation),
            *ctrl[FURTHER_RATES:],
            *four(commands, 4),
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
            *_servo_controls(time, qpos, commands, actuation),
            *thrust_controls(time, act, actuation.faults),
            *_motor_controls(act, law_act, commands, actuation),
            *ctrl[FURTHER_RATES:law_ctrl],
            *four(commands, 4),
            *ctrl[line_ctrl:],
        )

    def initial_activations(plan: FlightPlan, _layer: Actuation, inner: Vector) -> Vector:
        tilts, rotors = initial_tilts(plan)[0], (0.0, 0.0, 0.0, 0.0)
        waiting = (*tilts, *rotors, 0.0) if external else (*tilts, *rotors)
        return (*inner[:ROTOR_STATES], *waiting * latency_steps)

    layer = Layer(
        f"with_actuation.{latency_steps}",
        Actuation,
        _actuation,
        controls=controls,
        hold=hold,
        actuators=ExtraActuators(
            states=ROTOR_STATES + under_way, memories=COMMANDS, begins_with_rotor_speeds=True
        ),
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
