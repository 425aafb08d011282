"""Parameters and steps of the control law of attitude and force, `multirotor`."""

from collections.abc import Sequence
from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import Field

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import GaitParameters
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.feedback import (
    EXACT,
    angular_jerk,
    attitude_jerk,
    body_rate_matrix,
    decoupled,
    force_control,
    integrator_rate,
    limited_acceleration,
    position_feedback,
)
from tiltsim_controllers.laws.gains import Gains, GivenGains, IntegralGains
from tiltsim_controllers.laws.keys import Keys, NonNegative, Vector3, default, record_of, required
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.laws.supervised_vehicles import Watched
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix, wrapped
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.moving import Moving, at_rest, cosine, sine, stacked, value_of
from tiltsim_controllers.mathematics.records import vector_of
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.body import Body, RotorcraftState

ROTATION: Final = 0.0
"""An error of attitude: the rotation that remains, which has no singular pitch."""

EULER_ANGLES: Final = 1.0
"""Another: of roll, pitch and yaw, as in ch. 3."""

INTEGRAL_FIELDS: Final = ("integral_x", "integral_y", "integral_z")
"""The controller's own states: integrals of the position error, m s, world axes."""


class FeedforwardTerms(NamedTuple):
    """The terms that the controller includes: 1 or 0 each."""

    gait_rates: float = 1.0  # tilt rates in Ma
    attitude_rates: float = 1.0  # velocity and acceleration of the roll and pitch references
    reference_derivatives: float = 1.0  # acceleration, jerk and snap of the position reference
    euler_rates: float = 1.0  # exact derivatives of the Euler angles, else the body rates
    gyroscopic_torque: float = 1.0  # omega x I omega
    integral_action: float = 1.0


class Form(NamedTuple):
    """Options that a program of the law is made for; all else is data."""

    dimension: int  # components of force that are outputs, 1 to 3
    norm: str = "speed"  # of the inputs, or "thrust": of the rates of ``w``
    forward: bool = False  # two components are those along x and z, of a vehicle that has three
    losses: bool = False  # whether the controller knows of failures
    supervised: bool = False  # whether a supervisor changes its gait
    own_yaw: bool = False  # whether its decoupler takes yaw and planned tilts even if all rests
    spin: bool = False  # whether it takes along the angular momentum of the rotors


RESTORING: Final = 0.5
"""1/s, the default where rotor speeds would drift."""


class AttitudeForce(Keys):
    """Keys of the law."""

    law: Literal["attitude_force"] = required(
        "feedback linearization of a multirotor: its rotor speeds control the attitude and as "
        "many components of the force as it has; the tilt angles follow the gait"
    )
    dimension: Annotated[int, Field(ge=1, le=3)] | None = default(
        None,
        "how many components of the force are controlled beside the attitude: 1, lift; 2, one "
        "sideways, too, of a vehicle with three that along its x axis; 3, all, so that the "
        "vehicle need not lean; default: as many as the vehicle has at all angles of its gait [-]",
        1,
    )
    decoupler: Literal["none", "conventional", "modified", "exact"] = default(
        "exact",
        "how the vehicle leans to control what its side force leaves of the horizontal position: "
        "as for the tiltrotor; other than exact needs dimension 1 [-]",
    )
    decoupling: Literal["published", "exact"] = default(
        "exact",
        "form of the decoupling matrix; published lacks the factor 2 |rotor speed| in its "
        "attitude rows, as the thesis prints it for the tiltrotor",
    )
    attitude_error: Literal["rotation", "euler_angles"] = default(
        "rotation",
        "what the attitude's error is: the rotation that remains, without any singular attitude, "
        "or roll, pitch and yaw, as in the thesis",
    )
    gains: GivenGains = default("exact", "a named set, or a table of gains or of poles")
    side_gains: Vector3 = default(
        (12.0, 48.0, 64.0),
        "on the errors of acceleration, velocity and position along directions that side force "
        "moves [1/s, 1/s^2, 1/s^3]",
    )
    norm: Literal["speed", "thrust"] = default(
        "speed",
        "of all rotor accelerations that do the same, those of least norm: of the accelerations "
        "themselves, for rotors that turn one way, or of the rates of thrust, for rotors that "
        "reverse",
    )
    slowest_rotor: NonNegative = default(
        5.0, "speed below which norm = thrust accelerates a rotor as if it were that fast [rad/s]"
    )
    restoring: NonNegative | None = default(
        None,
        "rate toward the rotor speeds of least power among those that do the same, "
        "with norm = thrust to those whose thrusts have the least sum of squares; default: "
        f"{RESTORING:g} where they would drift, which is with moving tilts and more rotors than "
        "outputs, else 0 [1/s]",
        0.5,
    )
    turn_time: NonNegative = default(
        0.0, "time in which the reference of roll and pitch is reached, smoothly [s]"
    )


WITH_GAIT: Final[dict[str, Any]] = {
    "gains": Gains,
    "integral": IntegralGains,
    "max_acceleration": float,  # m/s^2 of the feedback, horizontally; integrators stop there
    "max_angular_acceleration": float,  # rad/s^2, desired, per axis
    "anticipation": float,  # s before and after a corner of the gait in which the body turns
    "terms": FeedforwardTerms,
    "gait": GaitParameters,
    "reference": ReferenceParameters,
    "supervisor": Supervisor,
    "limits": RotorRange,  # of prioritized allocation
}
"""Parameters that every law with feed-forward of a gait has beside its keys."""

Parameters = record_of(
    AttitudeForce,
    frozenset({"law", "dimension", "norm"}),  # see `Form`
    vehicle=Body,
    **WITH_GAIT,
    side_integral=float,  # 1/s^4, with the side gains
    rotors=float,  # where in the knots the table of the rotors begins
    restoring=float,  # 1/s, rate toward the least power or sum of w^2
    failure=Failure,
    watched=Watched,
    watched_without=Watched,  # once the failed rotor is known
    upper_side=vector_of(3),  # body axes, of the force with which it lifts, if it has two; else 0
    upper_side_without=vector_of(3),  # once the failed rotor is known
)
"""Parameters of the law: its keys and these."""


def turned(time: Any, angle: Any, duration: Any) -> Any:
    """An angle (rad) that is reached from zero within a duration (s), with continuous acceleration.

    ``angle s^3 (10 - 15 s + 6 s^2)``; without a duration the angle itself.
    """
    turns = time < duration
    period = xp.where(turns, duration, 1.0)
    s = Moving(xp.where(turns, time / period, 1.0), xp.where(turns, 1.0 / period, 0.0), 0.0)
    return angle * (s * s * s * (10.0 + s * (6.0 * s - 15.0)))


class Tracking(NamedTuple):
    """Motion to track, world axes."""

    error: Moving  # position error, m
    acceleration: Moving  # acceleration of the reference, m/s^2, as far as the law passes it on


def tracking(now: RotorcraftState, reference: Any, specific: Any, parameters: Any) -> Tracking:
    """The motion to track.

    Args:
        now: State of the vehicle.
        reference: Position with four derivatives, m and s, world axes, shape (5, 3).
        specific: Force per mass, m/s^2, world axes, shape (3,).
        parameters: Parameters of the controller.
    """
    ahead = parameters.terms.reference_derivatives * reference[2:]
    fall = xp.array([0.0, 0.0, parameters.vehicle.gravity])
    error = Moving(
        reference[0] - now.position, reference[1] - now.velocity, ahead[0] - (specific - fall)
    )
    return Tracking(error, Moving(ahead[0], ahead[1], ahead[2]))


def horizontal_control(
    motion: Tracking, jerk: Any, integrals: Any, parameters: Any
) -> tuple[Moving, Any]:
    """Desired acceleration along x and y (m/s^2), shape (2,), and integrator rates (m).

    Args:
        motion: The motion to track.
        jerk: Jerk of the body, m/s^3, world axes, shape (3,).
        integrals: `INTEGRAL_FIELDS`, shape (3,).
        parameters: Parameters of the controller.
    """
    gains, limit = parameters.gains, parameters.max_acceleration
    k3 = parameters.terms.integral_action * parameters.integral.position
    error, ahead = motion.error[:2], motion.acceleration[:2]
    back = position_feedback(error, ahead.rate - jerk[:2], integrals[:2], (*gains.position, k3))
    rates = integrator_rate(error.value, back.value, limit)
    return ahead + limited_acceleration(back, limit), rates


def side_control(motion: Tracking, integrals: Any, parameters: Any) -> tuple[Any, Any]:
    """Desired jerk (m/s^3) of x and y as far as force moves them, and integrator rates (m)."""
    k4 = parameters.terms.integral_action * parameters.side_integral
    gains = (*parameters.side_gains, k4)
    error, limit = motion.error[:2], parameters.max_acceleration
    return force_control(error, motion.acceleration.rate[:2], integrals[:2], gains, limit)


def altitude_control(motion: Tracking, integrals: Any, parameters: Any) -> tuple[Any, Any]:
    """Desired vertical jerk (m/s^3; ch. 4, Eq. 27, with an integral), and integrator rate (m)."""
    k4 = parameters.terms.integral_action * parameters.integral.altitude
    gains, limit = (*parameters.gains.altitude, k4), parameters.max_acceleration
    return force_control(motion.error[2], motion.acceleration.rate[2], integrals[2], gains, limit)


def euler_control(roll: Moving, pitch: Moving, attitude: Moving, parameters: Any) -> Any:
    """Desired second derivatives (rad/s^3) of the body rates, shape (3,), by Euler angles.

    Args:
        roll, pitch: References, rad; the reference of yaw is at rest.
        attitude: Roll, pitch and yaw, rad, shape (3,).
        parameters: Parameters of the controller.
    """
    yaw = attitude.value[2]
    desired = stacked(roll, pitch, yaw + wrapped(parameters.reference.yaw - yaw))
    limit = parameters.max_angular_acceleration
    jerk = attitude_jerk(desired, attitude, parameters.gains.attitude, limit)
    return angular_jerk(attitude, jerk) if parameters.terms.euler_rates else jerk


def rotation_control(
    attitude: Sequence[Moving], rotation: Any, omega: Any, omega_rate: Any, parameters: Any
) -> Any:
    """Desired second derivatives (rad/s^3) of the body rates, by the rotation that remains.

    Args:
        attitude: References of roll, pitch and yaw, rad.
        rotation: Body to world, shape (3, 3).
        omega, omega_rate: Body rates (rad/s) and their rates (rad/s^2), shape (3,) each.
        parameters: Parameters of the controller.
    """
    desired = rotation_matrix(xp.array([angle.value for angle in attitude]))
    # Rates of the desired attitude in its own axes, then in body axes.
    rates = stacked(*(Moving(angle.rate, angle.acceleration, 0.0) for angle in attitude))
    turning = rotation.T @ (desired @ (body_rate_matrix(*attitude[:2]) @ rates))
    second = turning.rate - cross(omega, turning.value)
    return attitude_jerk(
        Moving(attitude_error(rotation, desired), turning.value, second),
        Moving(0.0, omega, omega_rate),
        parameters.gains.attitude,
        parameters.max_angular_acceleration,
    )


def lean(force: Any, along: Moving, yaw: Any, parameters: Any) -> tuple[Moving, Moving]:
    """References of roll and pitch (rad) by the controller's decoupler.

    Args:
        force: The torque-free force, of any unit, body axes, shape (3,).
        along: The desired acceleration, m/s^2, world axes, shape (3,).
        yaw: rad.
        parameters: Parameters of the controller.
    """
    decoupler, gravity = parameters.decoupler, parameters.vehicle.gravity
    if decoupler == EXACT and parameters.terms.attitude_rates != 0.0:
        roll, pitch = decoupled(decoupler, along, yaw, gravity, force)
        return roll, pitch
    present = along.value, value_of(yaw), gravity, value_of(force)
    roll, pitch = decoupled(decoupler, *present)
    return at_rest(roll), at_rest(pitch)


def desired_direction(along: Moving, yaw: Any, gravity: Any) -> Moving:
    """Direction in which the rotors have to push, in axes of the yaw (rad), shape (3,).

    ``along`` is the desired acceleration, m/s^2, world axes, shape (3,); gravity in m/s^2.
    """
    (x, y, z), s, c = (along[0], along[1], along[2]), sine(yaw), cosine(yaw)
    return stacked(x * c + y * s, y * c - x * s, gravity + z)
