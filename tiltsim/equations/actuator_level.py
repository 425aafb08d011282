"""The vehicles on the thesis's equations, driven as MuJoCo drives them: by the controls of a model.

The thesis's vehicles do as they are told: pods stand at the gait's angles, rotors take any speed.
With a layer around the law (`tiltsim.laws.layers.layer`) they do not, and what the layer says, it
says as controls and activations of the MuJoCo model. Here these controls act on the thesis's rigid
body, on pods without mass that follow the equation of their servo, and on rotors with limits.
Nothing of MuJoCo is in it but the order of the controls, so that its flights can be checked against
these.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim.equations.quadrotor import equations_of_motion, initial_state
from tiltsim.equations.tiltrotor import rigid_body
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
    from tiltsim.scenario.flight_plan import FlightPlan

Wrench = tuple[float, float, float, float, float, float]
"""Force (N) and torque (N m) on the body, body axes."""


class Mechanics(NamedTuple):
    """What the controls drive."""

    vehicle: Vehicle  # that flies, not the one that the law knows
    servo_frequency: float  # rad/s, natural
    servo_damping: float  # ratio
    max_tilt: float  # rad, where the servos stop
    min_speed: float  # rad/s, along a rotor's spin
    max_speed: float


def mechanics(plan: FlightPlan) -> Mechanics:
    """The mechanics of a scenario's rotorcraft."""
    scenario = plan.scenario
    vehicle = scenario.rotorcraft
    servo = vehicle.tilt_servo
    min_speed, max_speed = vehicle.speeds_along_spin
    return Mechanics(
        scenario.true_rotorcraft,
        servo.natural_frequency,
        servo.damping_ratio,
        max_tilt=inf if servo.max_angle is None else servo.max_angle,
        min_speed=min_speed,
        max_speed=max_speed,
    )


@scalar
def external_acceleration(
    rotation: Vector, wrench: Wrench, mass: float, disturbance: Triple
) -> Triple:
    """The acceleration (m/s^2, world) by a wrench's force and a disturbance (m/s^2, world)."""
    force_x, force_y, force_z = to_world(rotation, (wrench[0], wrench[1], wrench[2]))
    gust_x, gust_y, gust_z = disturbance
    return gust_x + force_x / mass, gust_y + force_y / mass, gust_z + force_z / mass


class ActuatorPlant(NamedTuple):
    """A vehicle whose state is that of its motion, followed by MuJoCo's activations."""

    motion: int  # how many numbers come before the activations
    rotor_states: int  # which of the controls is the first that an activation integrates
    qpos: Callable[[Vector], Values]  # of the state, as MuJoCo has them
    qvel: Callable[[Vector], Values]
    rates: Callable[[Vector, Vector, Wrench, Mechanics, Triple], Values]
    """Time derivative of the motion: state, controls, wrench, mechanics, disturbance (m/s^2)."""
    project_onto_limits: Callable[
        [list[float], Mechanics], list[float]
    ]  # see `tiltsim.closed_loop.loop.Equations`
    initial: Callable[[FlightPlan], Values]  # motion


# --- tiltrotor ---------------------------------------------------------------------------------
# Eighteen numbers of the rigid body as in `tiltsim.equations.tiltrotor`, tilts, tilt rates.


@scalar
def rotation_of(state: Vector) -> Values:
    """The nine entries, rows first, of the body-to-world rotation."""
    return (
        *(state[6], state[7], state[8], state[9], state[10], state[11]),
        *(state[12], state[13], state[14]),
    )


@scalar
def tiltrotor_qpos(state: Vector) -> Values:
    """Position, quaternion and tilts."""
    qw, qx, qy, qz = quaternion_from_rotation(rotation_of(state))
    return (
        *(state[0], state[1], state[2], qw, qx, qy, qz),
        *(state[18], state[19], state[20], state[21]),
    )


@scalar
def tiltrotor_qvel(state: Vector) -> Values:
    """Velocity, body rates and tilt rates."""
    return (
        *(state[3], state[4], state[5], state[15], state[16], state[17]),
        *(state[22], state[23], state[24], state[25]),
    )


@scalar
def servo_acceleration(command: float, angle: float, rate: float, mechanics: Mechanics) -> float:
    """``omega^2 (command - alpha) - 2 zeta omega alpha'`` (rad/s^2) of a pod without mass."""
    omega, limit = mechanics.servo_frequency, mechanics.max_tilt
    command = clipped(command, -limit, limit)
    return omega * omega * (command - angle) - 2.0 * mechanics.servo_damping * omega * rate


@scalar
def tiltrotor_rates(
    state: Vector, ctrl: Vector, wrench: Wrench, mechanics: Mechanics, disturbance: Triple
) -> Values:
    """Chapter 3's rigid body under thrusts, servos and a wrench."""
    vehicle = mechanics.vehicle
    _, _, _, torque_x, torque_y, torque_z = wrench
    tilts: Quad = (state[18], state[19], state[20], state[21])
    push = external_acceleration(rotation_of(state), wrench, vehicle.mass, disturbance)
    turn = (
        torque_x / vehicle.inertia_xx,
        torque_y / vehicle.inertia_yy,
        torque_z / vehicle.inertia_zz,
    )
    # The controls are s varpi |varpi| with s = (-1, 1, -1, 1), the equations' are without s.
    squares = (-ctrl[4], ctrl[5], -ctrl[6], ctrl[7])
    return (
        *rigid_body(state, tilts, squares, vehicle, push, turn),
        *(state[22], state[23], state[24], state[25]),
        servo_acceleration(ctrl[0], state[18], state[22], mechanics),
        servo_acceleration(ctrl[1], state[19], state[23], mechanics),
        servo_acceleration(ctrl[2], state[20], state[24], mechanics),
        servo_acceleration(ctrl[3], state[21], state[25], mechanics),
    )


@scalar
def project_tiltrotor(state: list[float], mechanics: Mechanics) -> list[float]:
    """Rotors within their limits, pods not beyond their stops."""
    low, high, stop = mechanics.min_speed, mechanics.max_speed, mechanics.max_tilt
    projected = state[:]
    for rotor in range(4):
        spin = -1.0 if rotor % 2 == 0 else 1.0
        projected[26 + rotor] = spin * clipped(spin * state[26 + rotor], low, high)
        tilt, rate = state[18 + rotor], state[22 + rotor]
        if abs(tilt) > stop:
            projected[18 + rotor] = stop if tilt > 0.0 else -stop
            projected[22 + rotor] = 0.0 if tilt * rate > 0.0 else rate
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
    qw, qx, qy, qz = quaternion_from_euler(state[6], state[7], state[8])
    return state[0], state[1], state[2], qw, qx, qy, qz


@scalar
def quadrotor_qvel(state: Vector) -> Values:
    """Velocity and body rates."""
    return state[3], state[4], state[5], state[9], state[10], state[11]


@scalar
def quadrotor_rates(
    state: Vector, ctrl: Vector, wrench: Wrench, mechanics: Mechanics, disturbance: Triple
) -> Values:
    """Chapter 2's rigid body under thrusts and a wrench."""
    vehicle = mechanics.vehicle
    _, _, _, torque_x, torque_y, torque_z = wrench
    rotation = rotation_from_euler(state[6], state[7], state[8])
    push = external_acceleration(rotation, wrench, vehicle.mass, disturbance)
    lever = vehicle.arm_length * vehicle.thrust_coefficient
    inputs = (
        vehicle.thrust_coefficient * (ctrl[0] + ctrl[1] + ctrl[2] + ctrl[3]),
        lever * (ctrl[1] - ctrl[3]) + torque_x,
        lever * (ctrl[2] - ctrl[0]) + torque_y,
        vehicle.drag_coefficient * (ctrl[0] - ctrl[1] + ctrl[2] - ctrl[3]) + torque_z,
    )
    return equations_of_motion(state, inputs, vehicle, push)


@scalar
def project_quadrotor(state: list[float], mechanics: Mechanics) -> list[float]:
    """As it is: its rotors make any thrust."""
    return state


ACTUATOR_PLANTS: Final[dict[str, ActuatorPlant]] = {
    "tiltrotor": ActuatorPlant(
        motion=26,
        rotor_states=8,
        qpos=tiltrotor_qpos,
        qvel=tiltrotor_qvel,
        rates=tiltrotor_rates,
        project_onto_limits=project_tiltrotor,
        initial=initial_tiltrotor,
    ),
    "quadrotor": ActuatorPlant(
        motion=12,
        rotor_states=4,
        qpos=quadrotor_qpos,
        qvel=quadrotor_qvel,
        rates=quadrotor_rates,
        project_onto_limits=project_quadrotor,
        initial=lambda plan: initial_state(plan.scenario),
    ),
}
"""By the vehicle's model."""
