"""The thesis's vehicles at the level of their actuators: moved by the controls of MuJoCo's model.

The thesis's vehicles have ideal actuators: pods follow the gait exactly, rotors take any speed. A
layer around the controller (`tiltsim.laws.layers.layer`) changes that through controls and
activations of the MuJoCo model. Here these controls act on the thesis's rigid body, on massless
pods that follow the equation of their servo, and on rotors with limits. Only the order of the
controls is MuJoCo's, so these flights can check MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim.equations.quadrotor import equations_of_motion, initial_state
from tiltsim.equations.quadrotor import rigid_body as quadrotor_body
from tiltsim.equations.tiltrotor import rigid_body, rotation_of, velocity_of
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim_controllers.mathematics.rotation import (
    quaternion_from_euler,
    quaternion_from_rotation,
    rotation_from_euler,
    to_world,
)
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Values, Vector, clipped, scalar
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

Loads = tuple[float, float, float, float, float, float, float, float, float, float]
"""Force (N) and torque (N m) on the body, body axes, and torques (N m) about the four hinges."""


class Mechanics(NamedTuple):
    """The true vehicle and its actuators."""

    vehicle: Vehicle  # the true one, not the controller's
    servo_frequency: float  # rad/s, natural
    servo_damping: float  # ratio
    hinge_inertia_1: float  # kg m^2, of servo and pod
    hinge_inertia_2: float
    hinge_inertia_3: float
    hinge_inertia_4: float
    max_tilt: float  # rad, at the stops of the servos
    min_speed: float  # rad/s, along a rotor's spin
    max_speed: float


def mechanics(plan: FlightPlan) -> Mechanics:
    """The mechanics of a planned flight's rotorcraft."""
    rotorcraft = plan.scenario.rotorcraft
    servo = rotorcraft.tilt_servo
    hinge_1, hinge_2, hinge_3, hinge_4 = rotorcraft.hinge_inertias
    return Mechanics(
        plan.scenario.true_rotorcraft,
        servo.natural_frequency,
        servo.damping_ratio,
        hinge_1,
        hinge_2,
        hinge_3,
        hinge_4,
        inf if servo.max_angle is None else servo.max_angle,
        *rotorcraft.speeds_along_spin,
    )


@scalar
def external_acceleration(
    rotation: Vector, loads: Loads, mass: float, disturbance: Triple
) -> Triple:
    """Acceleration (m/s^2, world axes) without rotors and weight.

    Args:
        rotation: Body to world, rows first.
        loads: Of all but rotors and weight.
        mass: kg.
        disturbance: m/s^2, world axes.
    """
    force_x, force_y, force_z = to_world(rotation, (loads[0], loads[1], loads[2]))
    gust_x, gust_y, gust_z = disturbance
    return gust_x + force_x / mass, gust_y + force_y / mass, gust_z + force_z / mass


class ActuatorPlant(NamedTuple):
    """A vehicle whose state is its motion, followed by MuJoCo's activations."""

    motion: int  # numbers before the activations
    rotor_states: int  # index of the first control that an activation integrates
    qpos: Callable[[Vector], Values]  # MuJoCo's, from the state
    qvel: Callable[[Vector], Values]
    rates: Callable[[Vector, Vector, Loads, Mechanics, Triple], Values]
    """Time derivative of the motion: state, controls, loads, mechanics, disturbance (m/s^2)."""
    project_onto_limits: Callable[[list[float], Mechanics], list[float]]
    """See `tiltsim.closed_loop.loop.Equations`."""
    initial: Callable[[FlightPlan], Values]  # motion


# --- tiltrotor ---------------------------------------------------------------------------------
# The rigid body as in `tiltsim.equations.tiltrotor`, tilts, tilt rates, then the activations.
TILT_1, TILT_2, TILT_3, TILT_4, RATE_1, RATE_2, RATE_3, RATE_4, SPEED_1 = range(18, 27)


@scalar
def tiltrotor_qpos(state: Vector) -> Values:
    """Position, quaternion and tilts."""
    qw, qx, qy, qz = quaternion_from_rotation(rotation_of(state))
    return (
        state[0], state[1], state[2], qw, qx, qy, qz,
        state[TILT_1], state[TILT_2], state[TILT_3], state[TILT_4],
    )  # fmt: skip


@scalar
def tiltrotor_qvel(state: Vector) -> Values:
    """Velocity, body rates and tilt rates."""
    rates = state[RATE_1], state[RATE_2], state[RATE_3], state[RATE_4]
    return (*velocity_of(state), *rates)


@scalar
def servo_acceleration(command: float, angle: float, rate: float, mechanics: Mechanics) -> float:
    """``omega^2 (command - alpha) - 2 zeta omega alpha'`` (rad/s^2) of a massless pod.

    Args:
        command, angle, rate: set point and tilt, rad, and its rate, rad/s
        mechanics: of the vehicle
    """
    omega, limit = mechanics.servo_frequency, mechanics.max_tilt
    command = clipped(command, -limit, limit)
    return omega * omega * (command - angle) - 2.0 * mechanics.servo_damping * omega * rate


@scalar
def accelerations_by_hinge_torques(loads: Loads, mechanics: Mechanics) -> Quad:
    """What the loads' torques about the hinges add to the servos' accelerations, rad/s^2."""
    return (
        loads[6] / mechanics.hinge_inertia_1,
        loads[7] / mechanics.hinge_inertia_2,
        loads[8] / mechanics.hinge_inertia_3,
        loads[9] / mechanics.hinge_inertia_4,
    )


@scalar
def _tiltrotor_rates(
    state: Vector, ctrl: Vector, loads: Loads, mechanics: Mechanics, disturbance: Triple
) -> Values:
    """Chapter 3's rigid body under thrusts, servos and loads; see `ActuatorPlant.rates`."""
    vehicle = mechanics.vehicle
    a1, a2, a3, a4 = state[TILT_1], state[TILT_2], state[TILT_3], state[TILT_4]
    rate_1, rate_2, rate_3, rate_4 = state[RATE_1], state[RATE_2], state[RATE_3], state[RATE_4]
    torque_x, torque_y, torque_z = loads[3], loads[4], loads[5]
    acceleration = external_acceleration(rotation_of(state), loads, vehicle.mass, disturbance)
    angular_acceleration = (
        torque_x / vehicle.inertia_xx,
        torque_y / vehicle.inertia_yy,
        torque_z / vehicle.inertia_zz,
    )
    push_1, push_2, push_3, push_4 = accelerations_by_hinge_torques(loads, mechanics)
    # The controls are s varpi |varpi| with s = (-1, 1, -1, 1), the equations' are without s.
    squares = (-ctrl[4], ctrl[5], -ctrl[6], ctrl[7])
    return (
        *rigid_body(state, (a1, a2, a3, a4), squares, vehicle, acceleration, angular_acceleration),
        rate_1,
        rate_2,
        rate_3,
        rate_4,
        servo_acceleration(ctrl[0], a1, rate_1, mechanics) + push_1,
        servo_acceleration(ctrl[1], a2, rate_2, mechanics) + push_2,
        servo_acceleration(ctrl[2], a3, rate_3, mechanics) + push_3,
        servo_acceleration(ctrl[3], a4, rate_4, mechanics) + push_4,
    )


@scalar
def limit_speeds(state: list[float], first: int, mechanics: Mechanics) -> list[float]:
    """Rotor speeds, or commands of them, from ``first`` on within the rotors' limits."""
    low, high = mechanics.min_speed, mechanics.max_speed
    limited = state[:]
    for rotor in range(4):
        spin = -1.0 if rotor % 2 == 0 else 1.0
        limited[first + rotor] = spin * clipped(spin * state[first + rotor], low, high)
    return limited


@scalar
def project_tiltrotor(state: list[float], mechanics: Mechanics) -> list[float]:
    """Rotors within their speed limits, pods within their stops."""
    stop = mechanics.max_tilt
    projected = limit_speeds(state, SPEED_1, mechanics)
    for rotor in range(4):
        tilt, rate = state[TILT_1 + rotor], state[RATE_1 + rotor]
        if abs(tilt) > stop:
            projected[TILT_1 + rotor] = stop if tilt > 0.0 else -stop
            projected[RATE_1 + rotor] = 0.0 if tilt * rate > 0.0 else rate
    return projected


def initial_tiltrotor(plan: FlightPlan) -> Values:
    """The motion at time zero; pods as in MuJoCo."""
    initial = plan.scenario.initial
    tilts, tilt_rates = initial_tilts(plan)
    motion = (*initial.position, *initial.velocity)
    rotation = rotation_from_euler(*initial.attitude)
    return (*motion, *rotation, *initial.angular_velocity, *tilts, *tilt_rates)


# --- quadrotor ---------------------------------------------------------------------------------
# Twelve numbers of the rigid body as in `tiltsim.equations.quadrotor`.


@scalar
def quadrotor_qpos(state: Vector) -> Values:
    """Position and quaternion."""
    x, y, z, _, _, _, roll, pitch, yaw, _, _, _ = quadrotor_body(state)
    qw, qx, qy, qz = quaternion_from_euler(roll, pitch, yaw)
    return x, y, z, qw, qx, qy, qz


@scalar
def quadrotor_qvel(state: Vector) -> Values:
    """Velocity and body rates."""
    _, _, _, vx, vy, vz, _, _, _, p, q, r = quadrotor_body(state)
    return vx, vy, vz, p, q, r


@scalar
def _quadrotor_rates(
    state: Vector, ctrl: Vector, loads: Loads, mechanics: Mechanics, disturbance: Triple
) -> Values:
    """Chapter 2's rigid body under thrusts and loads; see `ActuatorPlant.rates`."""
    vehicle = mechanics.vehicle
    torque_x, torque_y, torque_z = loads[3], loads[4], loads[5]
    _, _, _, _, _, _, roll, pitch, yaw, _, _, _ = quadrotor_body(state)
    rotation = rotation_from_euler(roll, pitch, yaw)
    acceleration = external_acceleration(rotation, loads, vehicle.mass, disturbance)
    lever = vehicle.arm_length * vehicle.thrust_coefficient
    inputs = (
        vehicle.thrust_coefficient * (ctrl[0] + ctrl[1] + ctrl[2] + ctrl[3]),
        lever * (ctrl[1] - ctrl[3]) + torque_x,
        lever * (ctrl[2] - ctrl[0]) + torque_y,
        vehicle.drag_coefficient * (ctrl[0] - ctrl[1] + ctrl[2] - ctrl[3]) + torque_z,
    )
    return equations_of_motion(state, inputs, vehicle, acceleration)


@scalar
def project_quadrotor(state: list[float], mechanics: Mechanics) -> list[float]:
    """The state as it is: the rotors make any thrust."""
    return state


ACTUATOR_PLANTS: Final[dict[str, ActuatorPlant]] = {
    "tiltrotor": ActuatorPlant(
        motion=26,
        rotor_states=8,
        qpos=tiltrotor_qpos,
        qvel=tiltrotor_qvel,
        rates=_tiltrotor_rates,
        project_onto_limits=project_tiltrotor,
        initial=initial_tiltrotor,
    ),
    "quadrotor": ActuatorPlant(
        motion=12,
        rotor_states=4,
        qpos=quadrotor_qpos,
        qvel=quadrotor_qvel,
        rates=_quadrotor_rates,
        project_onto_limits=project_quadrotor,
        initial=lambda plan: initial_state(plan.scenario),
    ),
}
"""By the vehicle's model."""
