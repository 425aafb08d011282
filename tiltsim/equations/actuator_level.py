"""Vehicles on equations of motion at the level of their actuators: moved by MuJoCo's controls.

Vehicles of the thesis's equations have ideal actuators: pods follow the gait exactly, rotors take
any speed. A layer around the controller (`tiltsim.laws.layers.layer`) changes that through controls
and activations of the MuJoCo model. Here these controls act on a rigid body with massless pods that
follow the equation of their servo, and on rotors with limits. Only the order of the controls is
MuJoCo's, so these flights can check MuJoCo's.
"""

from collections.abc import Callable
from functools import cache
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.models.parts import WRENCH_SIZE
from tiltsim.scenario.rotorcraft import RotorcraftTable
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft import (
    Layout,
    initial_tilts,
    is_fixed_cross,
    layout_of,
    true_rotors,
)
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.attitude import (
    euler_rates,
    quaternion_of_euler,
    quaternion_of_rotation,
    quaternion_product,
    rotation_matrix,
    rotation_of_quaternion,
)
from tiltsim_controllers.mathematics.linear import norm
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.body import BODY_FIELDS, accelerations, joined, rotation_rate
from tiltsim_controllers.vehicle.craft import Craft, craft_of
from tiltsim_controllers.vehicle.rotors import TiltOfRotor, of_tilts, tilts_of, wrench_map

# --- parameters -------------------------------------------------------------------------------


@cache
def mechanics_record(vehicle: Any, tilts: int) -> Any:
    """The type of the true vehicle's and its actuators' parameters."""
    return make_record_type(
        "Mechanics",
        vehicle=vehicle,  # the true one, not the controller's
        servo_frequency=float,  # rad/s, natural
        servo_damping=float,  # ratio
        hinge_inertias=vector_of(tilts),  # kg m^2, of servo and pod
        max_tilt=float,  # rad, at the stops of the servos
        min_speed=float,  # rad/s, along a rotor's spin
        max_speed=float,
    )


def mechanics(plan: FlightPlan) -> Any:
    """The mechanics of a planned flight's rotorcraft."""
    rotorcraft, vehicle = plan.scenario.any_rotorcraft, true_rotors(plan.scenario)
    record: Any = type(vehicle)
    servo, tilts = rotorcraft.tilt_servo, rotorcraft.tilt_count
    return mechanics_record(record, tilts)(
        vehicle,
        servo.natural_frequency,
        servo.damping_ratio,
        rotorcraft.hinge_inertias[:tilts],
        inf if servo.max_angle is None else servo.max_angle,
        *rotorcraft.speeds_along_spin,
    )


# --- states -----------------------------------------------------------------------------------


class Motion(NamedTuple):
    """The motion of a vehicle with M tilts, or its time derivative."""

    position: Any  # m, world axes, shape (3,)
    attitude: Any  # see `Attitude`
    velocity: Any  # m/s, world axes, shape (3,)
    omega: Any  # body rates, rad/s, shape (3,)
    tilts: Any  # rad, shape (M,)
    tilt_rates: Any  # rad/s, shape (M,)


class Attitude(NamedTuple):
    """Representation of the attitude in a state, as functions of arrays."""

    size: int  # number of entries
    rotation: Callable[[Any], Any]  # ``(attitude)``: body to world, shape (3, 3)
    quaternion: Callable[[Any], Any]  # ``(attitude)``: scalar first, shape (4,)
    rates: Callable[[Any, Any], Any]
    """``(attitude, omega)``: its time derivative at body rates (rad/s)."""
    of_euler: Callable[[Any], Any]  # ``(angles)``: from roll, pitch and yaw, rad


def _matrix(attitude: Any) -> Any:
    return attitude.reshape(3, 3)


MATRIX: Final = Attitude(
    9,
    _matrix,
    lambda attitude: quaternion_of_rotation(_matrix(attitude)),
    lambda attitude, omega: rotation_rate(_matrix(attitude), omega),
    rotation_matrix,
)
QUATERNION: Final = Attitude(
    4,
    rotation_of_quaternion,
    lambda attitude: attitude,
    lambda attitude, omega: quaternion_product(attitude, xp.hstack([0.0, 0.5 * omega])),
    quaternion_of_euler,
)
EULER: Final = Attitude(
    3, rotation_matrix, quaternion_of_euler, euler_rates, lambda attitude: attitude
)


class StateLayout(NamedTuple):
    """Places of the parts of a motion at the head of a state."""

    sizes: tuple[tuple[str, int], ...]  # of the fields of `Motion`, in the order of the state

    @property
    def size(self) -> int:
        """Number of entries of the motion."""
        return sum(size for _, size in self.sizes)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates of a motion, three for a rotation."""
        sizes = dict(self.sizes)
        places, speeds = Layout(0, sizes["tilts"]).motion
        turned = BODY_FIELDS[6:9] if sizes["attitude"] == EULER.size else places[3:6]
        vectors = places[:3], turned, speeds[:3], speeds[3:6], places[6:], speeds[6:]
        named = dict(zip(Motion._fields, vectors, strict=True))
        return tuple(name for part in sizes for name in named[part])

    def split(self, state: Any) -> Motion:
        """The parts of a state, shape (``size`` + any,)."""
        ends = np.cumsum([size for _, size in self.sizes]).tolist()
        parts = zip(self.sizes, ends, strict=True)
        return Motion(**{name: state[end - size : end] for (name, size), end in parts})

    def joined(self, motion: Motion) -> Any:
        """The numbers of a motion, shape (``size``,)."""
        return joined(getattr(motion, name) for name, _ in self.sizes)


def as_in_mujoco(tilts: int) -> StateLayout:
    """A state that begins with MuJoCo's ``qpos`` and ``qvel``."""
    qpos = (("position", 3), ("attitude", QUATERNION.size), ("tilts", tilts))
    return StateLayout((*qpos, ("velocity", 3), ("omega", 3), ("tilt_rates", tilts)))


def as_printed(attitude: Attitude, tilts: int) -> StateLayout:
    """A state that begins with the rigid body, as the thesis's equations have it."""
    body = ("position", 3), ("velocity", 3), ("attitude", attitude.size), ("omega", 3)
    return StateLayout((*body, ("tilts", tilts), ("tilt_rates", tilts)))


# --- plants -----------------------------------------------------------------------------------


class ActuatorPlant(NamedTuple):
    """A vehicle whose state is its motion, followed by MuJoCo's activations.

    Its functions are traceable; ``mechanics`` is a `mechanics_record`.
    """

    motion: int  # number of entries of the state before the activations
    names: tuple[str, ...]  # names of their coordinates, see `Equations.states`
    qpos: Callable[[Any], Any]  # ``(state)``: MuJoCo's vector
    qvel: Callable[[Any], Any]  # ``(state)``: MuJoCo's vector
    rates: Callable[..., Any]
    """``(state, ctrl, loads, mechanics, disturbance)``: time derivative of the motion. ``loads``
    are force (N) and torque (N m) on the body, body axes, and torques (N m) about the hinges,
    without rotors and weight; the disturbance is in m/s^2, world axes."""
    project_onto_limits: Callable[[Any, Any], Any] | None
    """``(state, mechanics) -> state`` within limits of rotors and tilts; None where there are no
    limits."""
    initial: Callable[[FlightPlan], Values]  # ``(plan)``: the motion at time zero
    mechanics: Any  # the type of the parameters
    finish: Callable[[Any, Any], Any] | None = None
    """``(state, mechanics) -> state``: corrections at the end of a step; None for none."""


def servo_accelerations(
    craft: Craft, ctrl: Any, thrusts: Any, tilts: Any, rates: Any, loads: Any, mechanics: Any
) -> Any:
    """Accelerations (rad/s^2), shape (M,), of massless pods on a body at rest.

    Each is ``omega^2 (command - alpha) - 2 zeta omega alpha'``, and the torque about the hinge over
    its inertia.

    Args:
        craft: N rotors on M pods.
        ctrl: Begins with the set points of the servos, rad.
        thrusts: Controls of the rotors, (rad/s)^2, shape (N,).
        tilts, rates: rad and rad/s, shape (M,).
        loads: See `ActuatorPlant.rates`.
        mechanics: A `mechanics_record`.
    """
    omega, stop = mechanics.servo_frequency, mechanics.max_tilt
    command = xp.clip(ctrl[: len(tilts)], -stop, stop)
    by_servo = omega * omega * (command - tilts) - 2.0 * mechanics.servo_damping * omega * rates
    torques = loads[WRENCH_SIZE:] + of_tilts(craft.rotors, craft.hinge_loads * thrusts)
    return by_servo + torques / mechanics.hinge_inertias


@cache
def limit_speeds_of(spins: Values, first: int) -> Callable[..., Any]:
    """``(state, mechanics) -> state`` with rotor speeds, or commands of them, within their limits.

    Args:
        spins: Signs of the rotor speeds.
        first: Index of the first of these speeds.
    """
    end = first + len(spins)

    def limit_speeds(state: Any, mechanics: Any) -> Any:
        signs = xp.array(spins)
        speeds = signs * xp.clip(signs * state[first:end], mechanics.min_speed, mechanics.max_speed)
        return xp.hstack([state[:first], speeds, state[end:]])

    return limit_speeds


def _stopped(motion: Motion, stop: Any) -> Motion:
    """A motion with the pods within their stops (rad, to either side)."""
    tilts, rates = motion.tilts, motion.tilt_rates
    blocked = (abs(tilts) > stop) & (tilts * rates > 0.0)
    return motion._replace(
        tilts=xp.clip(tilts, -stop, stop), tilt_rates=xp.where(blocked, 0.0, rates)
    )


@cache
def plant_of(
    attitude: Attitude,
    layout: StateLayout,
    tilt_of_rotor: TiltOfRotor,
    spins: Values,
    vehicle: Any,
    *,
    gyroscopic: float,
    has_limits: bool,
) -> ActuatorPlant:
    """The equations of a plant; all numbers of the vehicle are data.

    Args:
        attitude, layout: Representation of the attitude, and places of the parts of the motion.
        tilt_of_rotor, spins: See `tiltsim.closed_loop.loop.ClosedLoop`.
        vehicle: The type of the vehicle's parameters.
        gyroscopic: Factor of the gyroscopic torque: 0 or 1.
        has_limits: Whether the rotors' speeds or the tilts have limits.
    """
    rotors, tilts = len(tilt_of_rotor), tilts_of(tilt_of_rotor)
    limit_speeds = limit_speeds_of(spins, layout.size)

    def qpos(state: Any) -> Any:
        motion = layout.split(state)
        return joined((motion.position, attitude.quaternion(motion.attitude), motion.tilts))

    def qvel(state: Any) -> Any:
        motion = layout.split(state)
        return joined((motion.velocity, motion.omega, motion.tilt_rates))

    def rates(state: Any, ctrl: Any, loads: Any, mechanics: Any, disturbance: Any) -> Any:
        motion, craft = layout.split(state), craft_of(mechanics.vehicle, tilt_of_rotor)
        thrusts = ctrl[tilts : tilts + rotors]
        # The controls are s varpi |varpi| with the spins s, the map's factors are without s.
        w, pods = xp.array(spins) * thrusts, (motion.tilts, motion.tilt_rates)
        wrench = wrench_map(craft.rotors, motion.tilts) @ w + loads[:WRENCH_SIZE]
        rotation = attitude.rotation(motion.attitude)
        acceleration, turning = accelerations(
            craft.body, rotation, motion.omega, wrench, disturbance, gyroscopic
        )
        moved = Motion(
            position=motion.velocity,
            attitude=attitude.rates(motion.attitude, motion.omega),
            velocity=acceleration,
            omega=turning,
            tilts=motion.tilt_rates,
            tilt_rates=servo_accelerations(craft, ctrl, thrusts, *pods, loads, mechanics),
        )
        return layout.joined(moved)

    def project_onto_limits(state: Any, mechanics: Any) -> Any:
        stopped = _stopped(layout.split(state), mechanics.max_tilt)
        return limit_speeds(joined((layout.joined(stopped), state[layout.size :])), mechanics)

    def normalized(state: Any, mechanics: Any) -> Any:
        """With a quaternion of length one, which no solver keeps."""
        motion = layout.split(state)
        unit = motion._replace(attitude=motion.attitude / norm(motion.attitude))
        return joined((layout.joined(unit), state[layout.size :]))

    def initial(plan: FlightPlan) -> Values:
        """The motion at time zero; pods as in MuJoCo."""
        start = plan.scenario.initial
        angles, angle_rates = initial_tilts(plan) if tilts else ((), ())
        vectors = start.position, start.attitude, start.velocity, start.angular_velocity
        motion = Motion(*map(xp.array, (*vectors, angles, angle_rates)))
        return (*layout.joined(motion._replace(attitude=attitude.of_euler(motion.attitude))),)

    return ActuatorPlant(
        layout.size,
        layout.names,
        qpos,
        qvel,
        rates,
        project_onto_limits if has_limits else None,
        initial,
        mechanics_record(vehicle, tilts),
        normalized if attitude is QUATERNION else None,
    )


def actuator_plant(loop: ClosedLoop) -> ActuatorPlant:
    """The thesis's equations (ch. 2, Eq. 15; ch. 3, Eqs. 1-7) of a model."""
    fixed = is_fixed_cross(loop)
    attitude = EULER if fixed else MATRIX
    return plant_of(
        attitude,
        as_printed(attitude, layout_of(loop).tilts),
        loop.tilt_of_rotor,
        loop.spins,
        loop.vehicle_record,
        gyroscopic=float(fixed),
        has_limits=not fixed,  # whose rotors make any thrust
    )


def rigid_body(loop: ClosedLoop, vehicle: RotorcraftTable) -> ActuatorPlant:
    """The rigid body of a model, the limits of whose rotors and tilts a scenario's table has."""
    return plant_of(
        QUATERNION,
        as_in_mujoco(layout_of(loop).tilts),
        loop.tilt_of_rotor,
        loop.spins,
        loop.vehicle_record,
        gyroscopic=1.0,
        has_limits=vehicle.has_rotor_limits or vehicle.tilt_servo.max_angle is not None,
    )
