"""Parameters and steps of the multirotor's control law, `tiltsim_controllers.laws.multirotor`."""

from __future__ import annotations

from math import cos, sin
from typing import Any, Final, NamedTuple

from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING, Gains
from tiltsim_controllers.laws.decouplers import (
    CONVENTIONAL,
    EXACT,
    conventional_decoupler,
    exact_decoupler,
    modified_decoupler,
)
from tiltsim_controllers.laws.failures import Failure
from tiltsim_controllers.laws.feedback import attitude_jerk, force_control
from tiltsim_controllers.laws.full_pose import attitude_error
from tiltsim_controllers.laws.gains import IntegralGains
from tiltsim_controllers.laws.gait_feedforward import FeedforwardTerms, decoupled_attitude
from tiltsim_controllers.laws.multirotor_supervisor import Watched
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.jets import (
    Jet,
    Jets3,
    jet_cosine,
    jet_product,
    jet_sine,
    jet_sum,
)
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_body, to_world
from tiltsim_controllers.mathematics.scalar import Triple, Values, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.multirotor import Body
from tiltsim_controllers.vehicle.rigid_body import cross

EULER_ANGLES: Final = 0.0
ROTATION: Final = 1.0

ATTITUDE_ERRORS: Final = {"euler_angles": EULER_ANGLES, "rotation": ROTATION}
"""What the attitude's error dynamics act on, by name: roll, pitch and yaw as in ch. 3, or the
rotation that remains, which has no singular pitch."""


class Form(NamedTuple):
    """What the code of the law is made for; all else is data."""

    dimension: int  # components of force that are outputs, 1 to 3
    norm: str = "speed"  # in `tiltsim_controllers.laws.multirotor_inputs.NORMS`
    forward: bool = False  # two components are those along x and z, of a vehicle that has three
    losses: bool = False  # whether the controller knows of failures
    prioritized: bool = False  # whether it keeps within rotor limits (`allocation`)
    supervised: bool = False  # whether a supervisor changes its gait

    @property
    def name(self) -> str:
        """For file names."""
        options = "_forward" * self.forward, "_losses" * self.losses
        further = "_prioritized" * self.prioritized, "_supervised" * self.supervised
        return f"{self.dimension}{''.join((*options, *further))}_{self.norm}"


class SideGains(NamedTuple):
    """Gains of x and y as far as force moves them, without leaning."""

    side_1: float = 12.0  # 1/s, on the acceleration
    side_2: float = 48.0  # 1/s^2
    side_3: float = 64.0  # 1/s^3, on the position
    side_integral: float = 0.0  # 1/s^4


class Direction(NamedTuple):
    """A vector in body axes."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Parameters(NamedTuple):
    """Parameters of the controller."""

    vehicle: Body
    gains: Gains
    integral: IntegralGains
    side: SideGains
    max_acceleration: float  # m/s^2 of the feedback, horizontally; integrators stop there
    max_angular_acceleration: float  # rad/s^2, desired, per axis
    anticipation: float  # s before and after a corner of the gait in which the body turns
    terms: FeedforwardTerms
    gait: GaitParameters
    reference: ReferenceParameters
    decoupler: float  # see `tiltsim_controllers.laws.decouplers`; dimension 1 knows all
    rotors: float  # where in the knots the table of the rotors begins
    decoupling: float = EXACT_DECOUPLING  # published: rows of the torque as in ch. 3
    attitude: float = ROTATION
    restoring: float = 0.0  # 1/s, rate towards the least power or sum of w^2
    slowest: float = 0.0  # rad/s, thrust norm: a slower rotor is accelerated as if it were so fast
    failure: Failure = Failure()
    turn_time: float = 0.0  # s in which a reference of roll and pitch is reached, smoothly
    limits: RotorRange = RotorRange()  # of prioritized allocation
    supervisor: Supervisor = Supervisor()
    watched: Watched = Watched()
    watched_without: Watched = Watched()  # the same once the failed rotor is known
    upper_side: Direction = Direction()  # of the force with which it lifts, if it has two; else 0
    upper_side_without: Direction = Direction()  # the same once the failed rotor is known


@scalar
def turned(time: float, angle: float, duration: float) -> Jet:
    """An angle (rad) that is reached from zero within a duration (s), with continuous acceleration.

    ``angle s^3 (10 - 15 s + 6 s^2)``; without a duration the angle itself.
    """
    if time >= duration:
        return angle, 0.0, 0.0
    s = time / duration
    left = 1.0 - s
    return (
        angle * (s * s * s * (10.0 + s * (6.0 * s - 15.0))),
        angle * (30.0 * s * s * left * left) / duration,
        angle * (60.0 * s * left * (1.0 - 2.0 * s)) / (duration * duration),
    )


@scalar
def rotation_control(
    roll_ref: Jet,
    pitch_ref: Jet,
    rotation: Values,
    omega: Triple,
    omega_rate: Triple,
    parameters: Any,
) -> Triple:
    """Desired second derivatives (rad/s^3) of the body rates, by the rotation that remains.

    Args:
        roll_ref, pitch_ref: references with derivatives, rad; that of yaw is at rest
        rotation: body to world, rows first
        omega, omega_rate: body rates (rad/s) and their rates (rad/s^2)
        parameters: of the controller
    """
    gains, limit = parameters.gains, parameters.max_angular_acceleration
    desired = rotation_from_euler(roll_ref[0], pitch_ref[0], parameters.reference.yaw)
    error = attitude_error(rotation, desired)
    # Rates of the desired attitude in its own axes, then in those of the body.
    sin_roll, cos_roll = sin(roll_ref[0]), cos(roll_ref[0])
    q, r = pitch_ref[1] * cos_roll, -pitch_ref[1] * sin_roll
    p_rate = roll_ref[2]
    q_rate = pitch_ref[2] * cos_roll + r * roll_ref[1]
    r_rate = -pitch_ref[2] * sin_roll - q * roll_ref[1]
    rate = to_body(rotation, to_world(desired, (roll_ref[1], q, r)))
    swept = cross(omega, rate)
    x, y, z = to_body(rotation, to_world(desired, (p_rate, q_rate, r_rate)))
    second = (x - swept[0], y - swept[1], z - swept[2])
    return (
        attitude_jerk(
            (error[0], rate[0], second[0]),
            (0.0, omega[0], omega_rate[0]),
            (gains.roll_1, gains.roll_2, gains.roll_3),
            limit,
        ),
        attitude_jerk(
            (error[1], rate[1], second[1]),
            (0.0, omega[1], omega_rate[1]),
            (gains.pitch_1, gains.pitch_2, gains.pitch_3),
            limit,
        ),
        attitude_jerk(
            (error[2], rate[2], second[2]),
            (0.0, omega[2], omega_rate[2]),
            (gains.yaw_1, gains.yaw_2, gains.yaw_3),
            limit,
        ),
    )


@scalar
def side_control(
    errors: Jets3, accelerations: Jets3, integrals: Triple, parameters: Any
) -> tuple[float, float, float, float]:
    """Desired jerk (m/s^3) of x and y as far as force moves them, and the integrators' rates.

    Args:
        errors, accelerations: as `tracking_errors` returns them
        integrals: of the position errors, m s
        parameters: of the controller
    """
    side = parameters.side
    gains = (
        side.side_1,
        side.side_2,
        side.side_3,
        parameters.terms.integral_action * side.side_integral,
    )
    limit = parameters.max_acceleration
    x, x_rate = force_control(errors[0], accelerations[0], integrals[0], gains, limit)
    y, y_rate = force_control(errors[1], accelerations[1], integrals[1], gains, limit)
    return x, y, x_rate, y_rate


@scalar
def lean(force: Jets3, x: Jet, y: Jet, z: Jet, yaw: Jet, parameters: Any) -> tuple[Jet, Jet]:
    """References of roll and pitch with derivatives by the controller's decoupler.

    Args:
        force: the torque-free force, of arbitrary unit, body axes
        x, y, z: the desired acceleration, m/s^2, world axes
        yaw: rad
        parameters: of the controller
    """
    gravity = parameters.vehicle.gravity
    n = (force[0][0], force[1][0], force[2][0])
    if parameters.decoupler == EXACT:
        if parameters.terms.attitude_rates != 0.0:
            return decoupled_attitude(x, y, z, yaw, force, parameters)
        roll, pitch = exact_decoupler(x[0], y[0], z[0], yaw[0], gravity, n)
    elif parameters.decoupler == CONVENTIONAL:
        roll, pitch = conventional_decoupler(x[0], y[0], yaw[0], gravity)
    else:
        roll, pitch = modified_decoupler(x[0], y[0], yaw[0], gravity, n)
    return (roll, 0.0, 0.0), (pitch, 0.0, 0.0)


@scalar
def desired_direction(x: Jet, y: Jet, z: Jet, yaw: Jet, gravity: float) -> Jets3:
    """Where the rotors have to push: along ``(x, y, gravity + z)``, in axes of the yaw.

    Args:
        x, y, z: the desired acceleration, m/s^2, world axes
        yaw: rad
        gravity: m/s^2
    """
    s, c = jet_sine(yaw), jet_cosine(yaw)
    return (
        jet_sum(1.0, jet_product(x, c), 1.0, jet_product(y, s)),
        jet_sum(1.0, jet_product(y, c), -1.0, jet_product(x, s)),
        (gravity + z[0], z[1], z[2]),
    )
