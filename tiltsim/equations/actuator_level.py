"""The equations' vehicles at the level of their actuators: moved by controls of MuJoCo's model.

Vehicles of the thesis's equations have ideal actuators: pods follow the gait exactly, rotors take
any speed. A layer around the controller (`tiltsim.laws.layers.layer`) changes that through controls
and activations of the MuJoCo model. Here these controls act on the equations' rigid body, on
massless pods that follow the equation of their servo, and on rotors with limits. Only the order of
the controls is MuJoCo's, so these flights can check MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from tiltsim.equations.quadrotor import equations_of_motion, initial_state
from tiltsim.equations.quadrotor import rigid_body as quadrotor_body
from tiltsim.equations.solvers import identity
from tiltsim.equations.tiltrotor import rigid_body, rotation_of, velocity_of
from tiltsim.models.parts import WRENCH_SIZE
from tiltsim.models.rotor_table import Multirotor
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim.vehicles.rotorcraft.layout import Layout, layout_of
from tiltsim.vehicles.rotorcraft.rotors import true_rotors
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.rotation import (
    quaternion_from_euler,
    quaternion_from_rotation,
    rotation_from_euler,
    to_world,
)
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Values, Vector, clipped, scalar
from tiltsim_controllers.mathematics.vectors import (
    componentwise,
    entries_of,
    tuple_text,
    written_out,
)
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor, effectiveness_of
from tiltsim_controllers.vehicle.multirotor import BODY_STATES, body_rates, inverse_inertia_times
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotor_code import rotor_code_of

if TYPE_CHECKING:
    from tiltsim.closed_loop.loop import Dynamics
    from tiltsim.scenario.scenario import FlightPlan

Loads = Values
"""Force (N) and torque (N m) on the body, body axes, then torques (N m) about the hinges."""


@cache
def mechanics_record(vehicle: Any, rotors: int, tilts: int) -> Any:
    """The type of the true vehicle's and its actuators' parameters."""
    return make_record_type(
        "Mechanics",
        vehicle=vehicle,  # the true one, not the controller's
        servo_frequency=float,  # rad/s, natural
        servo_damping=float,  # ratio
        hinge_inertias=vector_of(tilts),  # kg m^2, of servo and pod
        hinge_loads=vector_of(rotors),  # see `Rotor.hinge_load`
        max_tilt=float,  # rad, at the stops of the servos
        min_speed=float,  # rad/s, along a rotor's spin
        max_speed=float,
    )


def mechanics(plan: FlightPlan) -> Any:
    """The mechanics of a planned flight's rotorcraft."""
    return mechanics_around(true_rotors(plan.scenario), plan)


def mechanics_around(vehicle: Any, plan: FlightPlan) -> Any:
    """The mechanics of a planned flight, around the parameters of its true vehicle."""
    rotorcraft = plan.scenario.any_rotorcraft
    servo, tilts = rotorcraft.tilt_servo, rotorcraft.tilt_count
    kind: Any = type(vehicle)
    true = plan.scenario.true_vehicle
    return mechanics_record(kind, rotorcraft.rotor_count, tilts)(
        vehicle,
        servo.natural_frequency,
        servo.damping_ratio,
        rotorcraft.hinge_inertias[:tilts],
        tuple(rotor.hinge_load for rotor in true.rotors)
        if isinstance(true, Multirotor)
        else (0.0,) * rotorcraft.rotor_count,
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
    qpos: Callable[[Vector], Values]  # MuJoCo's, from the state
    qvel: Callable[[Vector], Values]
    rates: Callable[[Vector, Vector, Loads, Any, Triple], Values]
    """Time derivative of the motion: state, controls, loads, mechanics, disturbance (m/s^2)."""
    project_onto_limits: Callable[[list[float], Any], list[float]]
    """See `tiltsim.closed_loop.loop.Equations`."""
    initial: Callable[[FlightPlan], Values]  # motion
    mechanics: Any  # the type of the parameters
    read: Callable[[FlightPlan], Any] = mechanics  # these
    name: str = "on_equations"  # part of the name of compiled code
    finish: Callable[[list[float], Any], list[float]] = identity
    """``(state, mechanics)``: what else is mended at the end of a step."""


# --- vehicles with a rotation matrix ------------------------------------------------------------
# The rigid body as in `tiltsim.equations.tiltrotor`, tilts, tilt rates, then the activations.


@scalar
def servo_acceleration(command: float, angle: float, rate: float, mechanics: Any) -> float:
    """``omega^2 (command - alpha) - 2 zeta omega alpha'`` (rad/s^2) of a massless pod.

    Args:
        command, angle, rate: set point and tilt, rad, and its rate, rad/s
        mechanics: of the vehicle
    """
    omega: float = mechanics.servo_frequency
    damping: float = mechanics.servo_damping
    command = clipped(command, -mechanics.max_tilt, mechanics.max_tilt)
    return omega * omega * (command - angle) - 2.0 * damping * omega * rate


@cache
def servo_accelerations_of(tilt_of_rotor: TiltOfRotor, tilts: int) -> Callable[..., Values]:
    """Scalar code of what torques about the hinges add to the tilts on a body at rest, rad/s^2.

    It is ``(ctrl, thrusts, angles, rates, loads, mechanics) -> accelerations``, where ``thrusts``
    are the rotors' controls, (rad/s)^2. On the cross, without a table of rotors, they pass through
    the hinges at a right angle.
    """
    name = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in tilt_of_rotor)
    hinges = written_out(
        f"torques_about_hinges_{tilts}_{name}",
        "loads, thrusts, per_thrust",
        tuple_text(
            " + ".join(
                [f"loads[{WRENCH_SIZE + tilt}]"]
                + [
                    f"per_thrust[{i}] * thrusts[{i}]"
                    for i, o in enumerate(tilt_of_rotor)
                    if o == tilt
                ]
            )
            for tilt in range(tilts)
        ),
    )
    accelerations: Callable[..., Values] = componentwise(
        "servo_accelerations", "ctrl, angles, rates, hinges, mechanics",
        "by_servo(ctrl#, angles#, rates#, mechanics) + hinges# / mechanics.hinge_inertias#", tilts,
        by_servo=servo_acceleration,
    )  # fmt: skip

    @scalar
    def servo_accelerations(
        ctrl: Vector, thrusts: Values, angles: Values, rates: Values, loads: Loads, mechanics: Any
    ) -> Values:
        torques = hinges(loads, thrusts, mechanics.hinge_loads)
        return accelerations(ctrl, angles, rates, torques, mechanics)

    return servo_accelerations


@cache
def limit_speeds_of(spins: Values, first: int) -> Callable[..., list[float]]:
    """Scalar code ``(state, mechanics) -> state`` that keeps rotor speeds within their limits.

    They, or commands of them, are the state's entries from ``first`` on.
    """

    @scalar
    def limit_speeds(state: list[float], mechanics: Any) -> list[float]:
        low, high = mechanics.min_speed, mechanics.max_speed
        limited = state[:]
        for rotor in range(len(spins)):
            spin = spins[rotor]
            limited[first + rotor] = spin * clipped(spin * state[first + rotor], low, high)
        return limited

    return limit_speeds


@scalar
def stop_pods(state: list[float], tilt_1: int, rate_1: int, tilts: int, stop: float) -> list[float]:
    """The state with its pods within their stops.

    Args:
        state: Of the vehicle.
        tilt_1, rate_1: Index of the first tilt and of its rate.
        tilts: How many there are.
        stop: rad, to either side.
    """
    stopped = state[:]
    for index in range(tilts):
        tilt, rate = state[tilt_1 + index], state[rate_1 + index]
        if abs(tilt) > stop:
            stopped[tilt_1 + index] = stop if tilt > 0.0 else -stop
            stopped[rate_1 + index] = 0.0 if tilt * rate > 0.0 else rate
    return stopped


@scalar
def _tiltrotor_body(
    state: Vector, tilts: Quad, thrusts: Quad, loads: Loads, vehicle: Vehicle, disturbance: Triple
) -> Values:
    """Chapter 3's rigid body; arguments as in `_body_motion_of`."""
    angular_acceleration = (
        loads[3] / vehicle.inertia_xx,
        loads[4] / vehicle.inertia_yy,
        loads[5] / vehicle.inertia_zz,
    )
    acceleration = external_acceleration(rotation_of(state), loads, vehicle.mass, disturbance)
    # The controls are s varpi |varpi| with s = (-1, 1, -1, 1), the equations' are without s.
    squares = (-thrusts[0], thrusts[1], -thrusts[2], thrusts[3])
    return rigid_body(state, tilts, squares, vehicle, acceleration, angular_acceleration)


@cache
def _body_motion_of(spins: Values, tilt_of_rotor: TiltOfRotor) -> Callable[..., Values]:
    """Scalar code of the rates of the rigid body's eighteen numbers, without gyroscopic torque.

    It is ``(state, tilts, thrusts, loads, vehicle, disturbance) -> rates``, where ``thrusts`` are
    controls, (rad/s)^2, and ``disturbance`` is in m/s^2.
    """
    if not tilt_of_rotor:
        return _tiltrotor_body
    wrench = effectiveness_of(tilt_of_rotor).wrench
    senses = "".join("p" if spin > 0.0 else "m" for spin in spins)
    signs = ["" if spin > 0.0 else "-" for spin in spins]
    squares = written_out(
        f"signed_{senses}", "thrusts", tuple_text(f"{s}thrusts[{i}]" for i, s in enumerate(signs))
    )

    @scalar
    def body_motion(
        state: Vector,
        tilts: Values,
        thrusts: Values,
        loads: Loads,
        rotors: Any,
        disturbance: Triple,
    ) -> Values:
        body = rotors.body
        acceleration = external_acceleration(rotation_of(state), loads, body.mass, disturbance)
        turning = inverse_inertia_times(body, (loads[3], loads[4], loads[5]))
        pushed = wrench(tilts, squares(thrusts), rotors.effects, 0)
        return body_rates(state, pushed, body, acceleration, turning, 0.0)

    return body_motion


@cache
def _tilting_plant(layout: Layout, spins: Values, tilt_of_rotor: TiltOfRotor) -> ActuatorPlant:
    """The plant of the tiltrotor, or of a multirotor."""
    rotors, tilts = layout
    angles, rates = entries_of(BODY_STATES, tilts), entries_of(BODY_STATES + tilts, tilts)
    thrusts = entries_of(layout.thrust_1, rotors)
    motion = BODY_STATES + 2 * tilts
    body_motion = _body_motion_of(spins, tilt_of_rotor)
    servos = servo_accelerations_of(tilt_of_rotor, tilts)
    limit_speeds = limit_speeds_of(spins, motion)

    @scalar
    def qpos(state: Vector) -> Values:
        qw, qx, qy, qz = quaternion_from_rotation(rotation_of(state))
        return (state[0], state[1], state[2], qw, qx, qy, qz, *angles(state))

    @scalar
    def qvel(state: Vector) -> Values:
        return (*velocity_of(state), *rates(state))

    @scalar
    def motion_rates(
        state: Vector, ctrl: Vector, loads: Loads, mechanics: Any, disturbance: Triple
    ) -> Values:
        alpha, alpha_rates, pushed = angles(state), rates(state), thrusts(ctrl)
        vehicle = mechanics.vehicle
        return (
            *body_motion(state, alpha, pushed, loads, vehicle, disturbance),
            *alpha_rates,
            *servos(ctrl, pushed, alpha, alpha_rates, loads, mechanics),
        )

    @scalar
    def project(state: list[float], mechanics: Any) -> list[float]:
        limited = limit_speeds(state, mechanics)
        return stop_pods(limited, BODY_STATES, BODY_STATES + tilts, tilts, mechanics.max_tilt)

    def initial(plan: FlightPlan) -> Values:
        """The motion at time zero; pods as in MuJoCo."""
        start = plan.scenario.initial
        tilts, tilt_rates = initial_tilts(plan)
        body = (*start.position, *start.velocity, *rotation_from_euler(*start.attitude))
        return (*body, *start.angular_velocity, *tilts, *tilt_rates)

    record = rotor_code_of(tilt_of_rotor).record if tilt_of_rotor else Vehicle
    kind = mechanics_record(record, rotors, tilts)
    return ActuatorPlant(motion, qpos, qvel, motion_rates, project, initial, kind)


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
    state: Vector, ctrl: Vector, loads: Loads, mechanics: Any, disturbance: Triple
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


QUADROTOR_PLANT: Final = ActuatorPlant(
    motion=12,
    qpos=quadrotor_qpos,
    qvel=quadrotor_qvel,
    rates=_quadrotor_rates,
    project_onto_limits=identity,  # the rotors make any thrust
    initial=lambda plan: initial_state(plan.scenario),
    mechanics=mechanics_record(Vehicle, 4, 0),
)


def actuator_plant(dynamics: Dynamics) -> ActuatorPlant:
    """The plant of a model."""
    if dynamics.model == "quadrotor":
        return QUADROTOR_PLANT
    return _tilting_plant(layout_of(dynamics), dynamics.spins, dynamics.tilt_of_rotor)
