"""An error-state Kalman filter: inertial navigation, corrected by readings of other sensors.

The errors are, in this order, a rotation about world axes (``R = exp([theta]x) R_estimate``, rad),
velocity and position in world axes (m/s, m), and the biases of gyro and accelerometer in body axes
(rad/s, m/s^2). With the attitude's error in world axes, a rotation of the body leaves it alone, and
nearly all entries of the Jacobians are zeros and ones, which a trace omits. See J. Sola,
"Quaternion kinematics for the error-state Kalman filter" (2017), chapter 7 on global errors.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.attitude import quaternion_product, rotation_of_quaternion
from tiltsim_controllers.mathematics.linear import cross, solved_symmetric

ERRORS: Final = 15
NAVIGATION_ERRORS: Final = 9
"""The first ones: rotation, velocity and position."""
ROTATION, VELOCITY, POSITION, GYRO_BIAS, FORCE_BIAS = (slice(i, i + 3) for i in range(0, ERRORS, 3))
ROWS, COLUMNS = np.tril_indices(ERRORS)
"""Places of the packed covariance, the lower triangle row by row."""
PACKED: Final = len(ROWS)
_PLACE: Final = np.zeros((ERRORS, ERRORS), int)
_PLACE[ROWS, COLUMNS] = _PLACE[COLUMNS, ROWS] = np.arange(PACKED)


class ImuNoise(NamedTuple):
    """Noise of an inertial measurement unit, as densities, and how its biases walk."""

    gyro: Any = 0.0  # rad/s/sqrt(Hz)
    force: Any = 0.0  # m/s^2/sqrt(Hz)
    gyro_walk: Any = 0.0  # rad/s^2/sqrt(Hz)
    force_walk: Any = 0.0  # m/s^3/sqrt(Hz)


class Estimate(NamedTuple):
    """The state of the filter."""

    position: Any  # (3,), m, world
    velocity: Any  # (3,), m/s, world
    quaternion: Any  # (4,), body to world
    gyro_bias: Any  # (3,), rad/s, body
    force_bias: Any  # (3,), m/s^2, body
    covariance: Any  # (120,), of the errors, packed


class Transition(NamedTuple):
    """How errors at the start of a span of time reach its end."""

    time: Any  # s, length of the span
    turned: Any  # (3, 3), rotation by gyro bias, and velocity by bias of the force
    velocity_by_gyro: Any  # (3, 3)
    position_by_gyro: Any  # (3, 3)
    position_by_force: Any  # (3, 3)
    gained: Any  # (3,), velocity by the specific force, world
    shifted: Any  # (3,), position by the specific force, world


class Reading(NamedTuple):
    """A measurement, as the filter compares it with its state."""

    innovation: Any  # (k,), measured minus expected
    jacobian: Any  # (k, 15), of the expected one by the errors
    variance: Any  # (k,), of its noise


class Outcome(NamedTuple):
    """The comparison of a measurement with the state."""

    innovation: Any  # (k,)
    deviation: Any  # (k,), standard deviation of the innovation
    nis: Any  # innovation squared, normalized by its covariance
    accepted: Any  # 1 where it corrected the state, else 0


def skew(vector: Any) -> Any:
    """The matrix of the vector product ``v x``, shape (3, 3)."""
    x, y, z = vector
    return xp.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def quaternion_of_vector(vector: Any) -> Any:
    """The unit quaternion of a rotation vector (rad), to seventh order in its half."""
    half = 0.5 * vector
    square = half @ half
    along = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    real = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0))
    return normalized(xp.hstack([real, along * half]))


def normalized(quaternion: Any) -> Any:
    """A quaternion of length 1."""
    return quaternion / xp.sqrt(quaternion @ quaternion)


def vector_of_quaternion(quaternion: Any) -> Any:
    """The rotation vector (rad), shape (3,), of a unit quaternion; to fifth order in its half."""
    sine = xp.copysign(1.0, quaternion[0]) * quaternion[1:]
    square = sine @ sine
    return sine * (2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * (5.0 / 56.0))))


def no_transition() -> Transition:
    """The transition of no time at all."""
    none, zeros = xp.zeros((3, 3)), xp.zeros(3)
    return Transition(0.0, none, none, none, none, zeros, zeros)


def integrated(
    now: Estimate, through: Transition, rates: Any, force: Any, timestep: Any, gravity: Any
) -> tuple[Estimate, Transition]:
    """One step of inertial navigation with constant readings, by the midpoint of the attitude.

    Args:
        now: The state; the covariance stays as it is, see `propagated`.
        through: Transition up to now.
        rates: Body rates as measured, rad/s, shape (3,).
        force: Specific force as measured, m/s^2, body axes, shape (3,).
        timestep: s.
        gravity: m/s^2, along -z.
    """
    turn = (rates - now.gyro_bias) * timestep
    middle = quaternion_product(now.quaternion, quaternion_of_vector(0.5 * turn))
    rotation = rotation_of_quaternion(middle)
    specific = rotation @ (force - now.force_bias)
    velocity = now.velocity + timestep * (specific - gravity * xp.array([0.0, 0.0, 1.0]))
    reached = now._replace(
        position=now.position + 0.5 * timestep * (now.velocity + velocity),
        velocity=velocity,
        quaternion=normalized(quaternion_product(now.quaternion, quaternion_of_vector(turn))),
    )
    turned = through.turned - timestep * rotation
    half = 0.5 * (through.turned + turned)
    by_gyro = through.velocity_by_gyro - timestep * (skew(specific) @ half)
    gained = through.gained + timestep * specific
    mean = 0.5 * timestep
    return reached, Transition(
        through.time + timestep,
        turned,
        by_gyro,
        through.position_by_gyro + mean * (through.velocity_by_gyro + by_gyro),
        through.position_by_force + timestep * half,
        gained,
        through.shifted + mean * (through.gained + gained),
    )


def transition_matrix(through: Transition) -> Any:
    """The Jacobian of the errors after a span by the errors before it, shape (15, 15)."""
    one, zero = np.eye(3), np.zeros((3, 3))
    rows = [
        [one, zero, zero, through.turned, zero],
        [-skew(through.gained), one, zero, through.velocity_by_gyro, through.turned],
        [
            -skew(through.shifted),
            through.time * one,
            one,
            through.position_by_gyro,
            through.position_by_force,
        ],
        [zero, zero, zero, one, zero],
        [zero, zero, zero, zero, one],
    ]
    return xp.vstack([xp.hstack(row) for row in rows])


def process_noise(through: Transition, noise: ImuNoise) -> Any:
    """The covariance that a span adds, shape (15, 15), for its mean specific force.

    Left out are the correlations of a bias's walk with the other errors, of second order in time.
    """
    time, one, zero = through.time, np.eye(3), np.zeros((3, 3))
    turning = skew(through.gained)  # the mean force times the time
    square = turning @ turning.T
    by_gyro, by_force = noise.gyro * noise.gyro * time, noise.force * noise.force * time
    cross_v, cross_p = by_gyro / 2.0 * turning, by_gyro * time / 6.0 * turning
    vv = by_force * one + by_gyro / 3.0 * square
    pv = time * (by_force / 2.0 * one + by_gyro / 8.0 * square)
    pp = time * time * (by_force / 3.0 * one + by_gyro / 20.0 * square)
    rows = [
        [by_gyro * one, cross_v, cross_p, zero, zero],
        [-cross_v, vv, pv, zero, zero],
        [-cross_p, pv, pp, zero, zero],
        [zero, zero, zero, noise.gyro_walk * noise.gyro_walk * time * one, zero],
        [zero, zero, zero, zero, noise.force_walk * noise.force_walk * time * one],
    ]
    return xp.vstack([xp.hstack(row) for row in rows])


def propagated(packed: Any, through: Transition, noise: ImuNoise) -> Any:
    """The packed covariance at the end of a span."""
    matrix = transition_matrix(through)
    moved = matrix @ packed[_PLACE] @ matrix.T + process_noise(through, noise)
    return moved[ROWS, COLUMNS]


def corrected(now: Estimate, reading: Reading, gate: Any) -> tuple[Estimate, Outcome]:
    """The state after a measurement, component after component.

    Beyond the ``gate``, the largest normalized square of the innovation, the state stays.
    """
    packed, count = now.covariance, len(reading.innovation)
    full, H = packed[_PLACE], reading.jacobian
    S = H @ full @ H.T + xp.array(
        [[reading.variance[i] * (i == j) for j in range(count)] for i in range(count)]
    )
    nis = reading.innovation @ solved_symmetric(S, reading.innovation)
    accepted = xp.where(nis <= gate, 1.0, 0.0)  # NaN is refused
    change = xp.zeros(ERRORS)
    for row, innovation, variance in zip(H, reading.innovation, reading.variance):
        towards = packed[_PLACE] @ row
        factor = accepted / (row @ towards + variance)
        change = change + factor * (innovation - row @ change) * towards
        packed = packed - factor * towards[ROWS] * towards[COLUMNS]
    deviation = xp.sqrt(xp.array([S[i, i] for i in range(count)]))
    seen = Outcome(reading.innovation, deviation, nis, accepted)
    return injected(now._replace(covariance=packed), change), seen


def injected(now: Estimate, change: Any) -> Estimate:
    """The state with estimated errors taken into it, about which the new errors are defined.

    An error of rotation ``e`` beside the estimated one, ``d``, is ``(1 + [d]x / 2) e`` beside the
    new attitude, to first order in ``d``.
    """
    turn = change[ROTATION]
    reset = np.eye(3) + 0.5 * skew(turn)
    full = now.covariance[_PLACE]
    across = reset @ full[ROTATION]  # (3, 15)
    whole = xp.vstack([xp.hstack([across[:, ROTATION] @ reset.T, across[:, 3:]]), full[3:]])
    # Below the first three rows, the first three columns are the transpose of their part above.
    below = xp.hstack([across[:, 3:].T, full[3:, 3:]])
    whole = xp.vstack([whole[:3], below])
    return Estimate(
        now.position + change[POSITION],
        now.velocity + change[VELOCITY],
        normalized(quaternion_product(quaternion_of_vector(turn), now.quaternion)),
        now.gyro_bias + change[GYRO_BIAS],
        now.force_bias + change[FORCE_BIAS],
        whole[ROWS, COLUMNS],
    )


def errors_of(now: Estimate, truth: Estimate) -> Any:
    """The errors of an estimate, shape (15,), as the filter defines them."""
    w, vector = now.quaternion[0], now.quaternion[1:]
    turn = quaternion_product(truth.quaternion, xp.hstack([w, -vector]))
    return xp.hstack(
        [
            vector_of_quaternion(turn),
            truth.velocity - now.velocity,
            truth.position - now.position,
            truth.gyro_bias - now.gyro_bias,
            truth.force_bias - now.force_bias,
        ]
    )


def nees_of(now: Estimate, truth: Estimate, count: int = ERRORS) -> Any:
    """The square of the first errors, normalized by their covariance.

    It is ``count`` on average where the covariance is true.
    """
    error = errors_of(now, truth)[:count]
    return error @ solved_symmetric(now.covariance[_PLACE][:count, :count], error)


# --- measurements of the sensors


def position_reading(now: Estimate, measured: Any, arm: Any, variance: Any) -> Reading:
    """The position (m, world) of a point of the vehicle.

    Args:
        now: The state.
        measured: m, shape (3,).
        arm: The point from the inertial measurement unit, body axes, m, shape (3,).
        variance: m^2, shape (3,).
    """
    place = rotation_of_quaternion(now.quaternion) @ arm
    zero = np.zeros((3, 3))
    H = xp.hstack([-skew(place), zero, np.eye(3), zero, zero])
    return Reading(measured - now.position - place, H, variance)


def altitude_reading(now: Estimate, measured: Any, arm: Any, variance: Any) -> Reading:
    """The height (m) of a point of the vehicle.

    Args:
        now, arm: See `position_reading`.
        measured, variance: m and m^2, shape (1,).
    """
    whole = position_reading(now, xp.hstack([xp.zeros(2), measured]), arm, variance)
    return Reading(whole.innovation[2:], whole.jacobian[2:], variance)


def velocity_reading(now: Estimate, measured: Any, arm: Any, variance: Any, rates: Any) -> Reading:
    """The velocity (m/s, world) of a point of the vehicle.

    Args:
        now, arm: See `position_reading`.
        measured, variance: m/s and (m/s)^2, shape (3,).
        rates: Body rates as the gyro measures them, rad/s, shape (3,).
    """
    rotation = rotation_of_quaternion(now.quaternion)
    around = rotation @ cross(rates - now.gyro_bias, arm)
    zero = np.zeros((3, 3))
    H = xp.hstack([-skew(around), np.eye(3), zero, rotation @ skew(arm), zero])
    return Reading(measured - now.velocity - around, H, variance)


def attitude_reading(now: Estimate, measured: Any, variance: Any) -> Reading:
    """The attitude as a quaternion, with noise about all axes alike, rad^2, shape (3,)."""
    w, vector = now.quaternion[0], now.quaternion[1:]
    turn = quaternion_product(measured, xp.hstack([w, -vector]))
    zero = np.zeros((3, 3))
    H = xp.hstack([xp.array(np.eye(3)), zero, zero, zero, zero])
    return Reading(vector_of_quaternion(turn), H, variance)


def direction_reading(now: Estimate, measured: Any, field: Any, variance: Any) -> Reading:
    """A vector of the world in body axes, as a magnetometer measures it.

    Args:
        now: The state.
        measured: Shape (3,), body axes.
        field: The vector in world axes, shape (3,).
        variance: Equal on all axes, shape (3,).
    """
    zero = np.zeros((3, 3))
    H = xp.hstack([skew(field), zero, zero, zero, zero])
    return Reading(rotation_of_quaternion(now.quaternion) @ measured - field, H, variance)
