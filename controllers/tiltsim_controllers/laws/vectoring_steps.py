"""Steps of `vectoring`: motion ahead, demanded acceleration, direction of the force, attitude."""

from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.feedback import body_rate_matrix, exact_decoupler
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.linear import cross, norm, solved_symmetric
from tiltsim_controllers.mathematics.moving import (
    Moving,
    cosine,
    sine,
    square_root,
    stacked,
    value_of,
    where,
)

TINY = 1e-24
LEAST_PUSH: Final = 0.25
"""Acceleration of the feedback over the one in hover where nothing is spare."""
STRAIGHT: Final = 0.5, 4.0
"""Acceleration of the feedback straight up over the spare lift, and straight down, m/s^2."""
UNALIGNED: Final = 0.1, 0.3
"""rad, the errors up to which an attitude is aligned, and from which it is not at all."""


class Motion(NamedTuple):
    """A rigid body in motion."""

    position: Any  # (3,), m, world axes
    velocity: Any  # (3,), m/s, world axes
    rotation: Any  # (3, 3), body to world
    omega: Any  # (3,), rad/s, body axes


class Frame(NamedTuple):
    """A rigid body under disturbances."""

    mass: Any  # kg
    gravity: Any  # m/s^2
    inertia: Any  # (3, 3), kg m^2
    gyroscopic: Any  # 1 or 0
    force: Any  # (3,), m/s^2, world axes, of the disturbance
    torque: Any  # (3,), rad/s^2, body axes, likewise


def accelerations(now: Motion, wrench: Any, frame: Frame) -> tuple[Any, Any]:
    """Acceleration (m/s^2, world axes) and angular acceleration (rad/s^2, body axes).

    Args:
        now: Motion of the body.
        wrench: Force (N) and torque (N m) of the rotors, body axes, shape (6,).
        frame: The body.
    """
    weight = xp.array([0.0, 0.0, -frame.gravity])
    momentum = frame.inertia @ now.omega
    turning = wrench[3:] - frame.gyroscopic * cross(now.omega, momentum)
    return (
        now.rotation @ wrench[:3] / frame.mass + frame.force + weight,
        solved_symmetric(frame.inertia, turning) + frame.torque,
    )


def turn_by(vector: Any) -> Any:
    """The rotation, shape (3, 3), of a rotation vector (rad), shape (3,)."""
    angle = xp.sqrt(vector @ vector + TINY)
    half = xp.sin(0.5 * angle) / (0.5 * angle)
    sine, versine = xp.sin(angle) / angle, 0.5 * half * half
    x, y, z = vector
    k = xp.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return xp.eye(3) + sine * k + versine * (k @ k)


def moved(now: Motion, wrench: Any, frame: Frame, time: Any) -> Motion:
    """A body after a time under a constant wrench.

    Args:
        now: Its motion.
        wrench: Force (N) and torque (N m) of its rotors, body axes, shape (6,).
        frame: The body.
        time: s.
    """
    push, turning = accelerations(now, wrench, frame)
    half = 0.5 * time
    return Motion(
        now.position + time * (now.velocity + half * push),
        now.velocity + time * push,
        now.rotation @ turn_by(time * (now.omega + half * turning)),
        now.omega + time * turning,
    )


def braked(error: Any, gain: Any, limit: Any, delay: Any) -> Any:
    """Speed toward zero of an error's length: proportional, or of a braking at a limit.

    Args:
        error: Its length, which may move.
        gain: 1/s, near zero.
        limit: The largest deceleration.
        delay: s, until it begins.
    """
    lost = limit * delay
    slow = gain * value_of(error) < xp.sqrt(lost * lost + 2.0 * limit * value_of(error)) - lost
    root = square_root(where(slow, 1.0, lost * lost + 2.0 * limit * error))
    return where(slow, gain * error, root - lost)


def demanded(error: Moving, jerk_error: Any, ahead: Moving, frame: Frame, p: Any) -> Moving:
    """Acceleration (m/s^2, world axes) that the rotors shall make on top of gravity's, shape (3,).

    The feedback follows a braking curve; all is within the thrust that the vehicle has, lift first.

    Args:
        error: Position error, m.
        jerk_error: Its third derivative, m/s^3.
        ahead: Acceleration of the reference, m/s^2.
        frame: The body.
        p: Parameters of the law.
    """
    slope = Moving(error.rate, error.acceleration, jerk_error)

    def feedback(axes: slice, bandwidth: Any, damping: Any, braking: Any, delay: Any) -> Moving:
        stiffness = bandwidth / (2.0 * damping)  # speed per error, 1/s
        size = square_root(error[axes] @ error[axes] + TINY)
        speed = braked(size, stiffness, 0.6 * braking, delay) / size
        return 2.0 * damping * bandwidth * (speed * error[axes] + slope[axes])

    # Side force alone is faster over a short way than to lean, push and lean back.
    way, height = value_of(error)[:2], abs(value_of(error)[2])
    distance = xp.sqrt(way @ way + TINY)
    leans = xp.clip(distance / p.near - 1.0, 0.0, 1.0)
    push = p.direct + leans * (p.acceleration - p.direct)
    # Reference and disturbance leave a part of the push across, and the feedback a share of it.
    rest = value_of(ahead - frame.force)
    spare = _across(rest[2] + frame.gravity, p) - xp.sqrt(rest[:2] @ rest[:2] + TINY)
    push = push * xp.clip(spare / _across(frame.gravity, p), LEAST_PUSH, 1.0)
    delay = p.reversal + leans * (p.lean_time - p.reversal)
    across = feedback(slice(0, 2), p.position, p.damping, push, delay)
    # Straight up or down, no lean needs the lift.
    straight = xp.clip(1.0 - distance / (height + TINY), 0.0, 1.0)
    spare = STRAIGHT[0] * (p.greatest - frame.gravity)
    ascent = p.ascent + straight * xp.maximum(spare - p.ascent, 0.0)
    descent = p.descent + straight * (STRAIGHT[1] - p.descent)
    upward = feedback(slice(2, 3), p.rise, p.rise_damping, descent, p.reversal)
    # A motion away has to stop before any way back begins; more push stops it, as far as there is
    # time to lean back.
    apart = way @ value_of(slope)[:2] / distance - 0.5 * p.lean_time * push
    stopping = xp.clip(2.0 * p.damping * p.position * apart, 0.0, push)
    side = _within(across, push + stopping)
    rise = _clipped(upward[0], -descent, ascent)
    target = ahead + stacked(side[0], side[1], rise) - frame.force
    lift = _clipped(target[2] + frame.gravity, 0.2 * frame.gravity, p.greatest)
    # No more side force than leaves the lift, and no lean beyond 60 degrees.
    up = lift.value
    side = _within(target[:2], xp.minimum(_across(up, p), 1.7 * up))
    return stacked(side[0], side[1], lift)


def _across(lift: Any, p: Any) -> Any:
    """Greatest acceleration (m/s^2) across that leaves a lift per mass (m/s^2)."""
    left = xp.maximum(p.greatest * p.greatest - lift * lift, 0.04 * p.greatest * p.greatest)
    return xp.sqrt(left)


def _within(vector: Moving, limit: Any) -> Moving:
    """A moving vector no longer than a limit."""
    square = vector @ vector
    is_long = square.value > limit * limit
    scale = where(is_long, limit, 1.0) / square_root(where(is_long, square, 1.0))
    return vector * scale


def _clipped(x: Moving, low: Any, high: Any) -> Moving:
    """A moving number within limits, at rest there."""
    return where(x.value < low, low, where(x.value > high, high, x))


def upward(pose: Moving) -> Moving:
    """World up in body axes, shape (3,), at a pose of roll, pitch and yaw (rad), shape (3,)."""
    roll, pitch = pose[0], pose[1]
    return stacked(-sine(pitch), cosine(pitch) * sine(roll), cosine(pitch) * cosine(roll))


def pointing(force: Moving, axis: Any, yaw: Moving, slope: Any) -> tuple[Any, Any, Any]:
    """The attitude that points an axis along a force, less what the force may leave the axis.

    Args:
        force: Per mass, gravity included, m/s^2, world axes, shape (3,), upward.
        axis: Body axes, moving or not, shape (3,); without side force it points up.
        yaw: rad.
        slope: Side force per lift that needs no lean.

    Returns:
        Body to world, shape (3, 3), and its rates (rad/s) and their rates (rad/s^2), shape (3,)
        each, in its own axes.
    """
    side, lift = force[:2], force[2]
    square, own = side @ side, slope * lift
    leans = square.value >= own.value * own.value
    safe = square_root(where(leans & (square.value > 0.0), square, 1.0))
    share = where(leans, 1.0 - own / safe, 0.0)
    x, y = share * side[0], share * side[1]
    roll, pitch = exact_decoupler(x, y, lift, yaw, 0.0, axis)
    angles = stacked(roll, pitch, yaw)
    rates = Moving(angles.rate, angles.acceleration, xp.zeros(3))
    omega = body_rate_matrix(roll, pitch) @ rates
    return rotation_matrix(angles.value), omega.value, omega.rate


def aligned(angle: Any) -> Any:
    """How far an attitude is aligned, 1 to 0, at an error (rad) of its lean or yaw."""
    return xp.clip((UNALIGNED[1] - angle) / (UNALIGNED[1] - UNALIGNED[0]), 0.0, 1.0)


def turning(now: Motion, desired: Any, rates: Any, second: Any, p: Any) -> Any:
    """Angular acceleration (rad/s^2, body axes) toward a moving attitude, shape (3,).

    The body's z axis first turns to its desired direction by the shortest way; yaw is apart.

    Args:
        now: Motion of the body.
        desired, rates, second: Results of `pointing`.
        p: Parameters of the law.
    """
    error = now.rotation.T @ desired
    z = error[:, 2]
    sine = xp.sqrt(z[0] * z[0] + z[1] * z[1] + TINY)
    angle = xp.arctan2(sine, z[2])
    way = xp.array([-z[1], z[0], 0.0]) / sine
    rest = turn_by(-angle * way) @ error
    yaw = xp.arctan2(rest[1, 0], rest[0, 0])
    gain = p.attitude / (2.0 * p.attitude_damping)
    gain_yaw = p.yaw / (2.0 * p.attitude_damping)
    lean = braked(angle, gain, 0.6 * p.angular, p.reversal) * way
    spin = braked(abs(yaw), gain_yaw, 0.6 * p.yaw_angular, p.reversal) * xp.copysign(1.0, yaw)
    # A yaw rate of the desired attitude belongs to its lean; at another one it turns the nose.
    leading = xp.hstack([1.0, 1.0, aligned(angle)])
    led = leading * (error @ rates)
    # No faster toward a lean than the vehicle can stop, should the lean stop.
    aim = lean + led
    fast = norm(aim[:2] + xp.array([TINY, 0.0]))
    slower = xp.where(fast > p.spin, p.spin / fast, 1.0)
    gap = xp.array([slower, slower, 1.0]) * aim + spin * xp.array([0.0, 0.0, 1.0]) - now.omega
    damping = 2.0 * p.attitude_damping * xp.array([p.attitude, p.attitude, p.yaw])
    limits = p.angular, p.yaw_angular
    ahead = _shared(leading * (error @ second - cross(now.omega, led)), 0.5, limits)
    return ahead + _shared(damping * gap, 1.0, limits)


def _shared(vector: Any, share: Any, limits: tuple[Any, Any]) -> Any:
    """Angular accelerations about x and y, and about z, within a share of their limits."""
    tilt, yaw = share * limits[0], share * limits[1]
    size = norm(vector[:2] + xp.array([TINY, 0.0]))
    scale = xp.where(size > tilt, tilt / size, 1.0)
    return xp.hstack([scale * vector[:2], xp.clip(vector[2], -yaw, yaw)])
