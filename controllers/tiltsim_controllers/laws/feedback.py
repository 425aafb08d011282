"""Steps of the feedback around a moving reference: position, force, attitude, and decouplers.

Vectors have an entry for each axis; quantities with derivatives are
`tiltsim_controllers.mathematics.moving.Moving`.

Attitude and altitude use all four rotor speeds, so the horizontal position is controlled by leaning
the vehicle: a decoupler has the roll and pitch that produce a desired acceleration. The decouplers
differ in their model of the tilted rotors: the conventional one ignores them (ch. 4, Eqs. 7-8), the
modified one has the side force at level attitude, to first order (Eqs. 9-11), the exact one the
whole direction of the force at zero torque.
"""

from collections.abc import Sequence
from typing import Any, Final

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.moving import (
    Moving,
    angle,
    cosine,
    sine,
    square_root,
    stacked,
    value_of,
    where,
)


def error_dynamics(reference: Any, present: Sequence[Any], gains: Sequence[Any]) -> Any:
    """The n-th derivative of outputs with which their errors decay: ``r_n + k_1 e_(n-1) + ...``.

    It is ``r_n + k_1 (r_(n-1) - y_(n-1)) + ... + k_n (r_0 - y_0)`` (ch. 2, Eqs. A2-A5; ch. 4, Eqs.
    26-27), with the reference ``r_0`` to ``r_n``, the present outputs ``y_0`` to ``y_(n-1)``, and
    gains ``k_1`` to ``k_n``, 1/s to 1/s^n.
    """
    *lower, total = reference
    for gain, desired, actual in zip(gains, reversed(lower), reversed(present), strict=True):
        total = total + gain * (desired - actual)
    return total


def limited_acceleration(acceleration: Moving, limit: Any) -> Any:
    """A moving vector scaled back to a limit (m/s^2) where it is longer."""
    square = acceleration @ acceleration
    within = square.value <= limit * limit
    # Harmless numbers on the side that is not selected, as the limit may be infinite.
    scale = xp.where(within, 1.0, limit) / square_root(where(within, 1.0, square))
    return acceleration * where(within, 1.0, scale)


def position_feedback(error: Moving, jerk_error: Any, integral: Any, gains: Any) -> Any:
    """``k1 e' + k2 e + k3 integral`` of a position error, with its first two derivatives.

    Args:
        error: The error ``e`` (m), by axis.
        jerk_error: Its third derivative, m/s^3.
        integral: Its integral, m s.
        gains: ``(k1, k2, k3)``, 1/s to 1/s^3.
    """
    k1, k2, k3 = gains
    rate = Moving(error.rate, error.acceleration, jerk_error)
    return k1 * rate + k2 * error + k3 * Moving(integral, error.value, error.rate)


def integrator_rate(error: Any, desired: Any, limit: Any) -> Any:
    """Rates of integrators of errors: zero where ``desired`` is beyond a limit and grows."""
    return xp.where((abs(desired) > limit) & (error * desired > 0.0), 0.0, error)


def force_control(
    error: Moving, jerk: Any, integral: Any, gains: Any, limit: Any
) -> tuple[Any, Any]:
    """Desired jerk (m/s^3) along axes that the force moves (ch. 4, Eq. 27), and integrator rates.

    Args:
        error: The position error, m.
        jerk: Jerk of the reference, m/s^3.
        integral: Integral of the error, m s.
        gains: ``(k1, k2, k3, k4)``, 1/s to 1/s^4, the last on the integral.
        limit: Acceleration (m/s^2) that the error may demand before its integrator stops.
    """
    k1, k2, k3, k4 = gains
    effort = k2 * error.rate + k3 * error.value + k4 * integral
    rate = integrator_rate(error.value, effort, k1 * limit)
    return jerk + k1 * error.acceleration + effort, rate


def attitude_jerk(desired: Moving, present: Moving, gains: Any, limit: Any) -> Any:
    """Third-order error dynamics (ch. 4, Eq. 26) around a moving reference, with bounded effort.

    ``k1 e'' + k2 e' + k3 e`` while nothing saturates. Read as a cascade (the angle commands a rate,
    the rate an acceleration), the acceleration due to the errors is limited, and the rate to that
    from which it brakes, so that a large error does not stop a rotor.

    Args:
        desired, present: Angles, rad, by axis.
        gains: ``(k1, k2, k3)``, 1/s to 1/s^3, by axis.
        limit: Largest acceleration, rad/s^2.
    """
    k1, k2, k3 = gains
    fastest = limit * k1 / k2
    rate = xp.clip(k3 / k2 * (desired.value - present.value), -fastest, fastest)
    change = k2 / k1 * (rate + desired.rate - present.rate) + desired.acceleration
    return k1 * (xp.clip(change, -limit, limit) - present.acceleration)


def body_rate_matrix(roll: Any, pitch: Any) -> Any:
    """``M(roll, pitch)`` with ``omega = M eta'`` of the rates of roll, pitch and yaw, shape (3, 3).

    The angles (rad) move. Ch. 3, Eq. 8, takes it for the unit matrix.
    """
    sr, cr, sp, cp = sine(roll), cosine(roll), sine(pitch), cosine(pitch)
    rows = (1.0, 0.0, -sp), (0.0, cr, sr * cp), (0.0, -sr, cr * cp)
    return stacked(*(stacked(*row) for row in rows))


def attitude_motion(attitude: Any, omega: Any, omega_rate: Any, *, exact: bool) -> Moving:
    """Roll, pitch and yaw (rad) with their first two derivatives.

    Args:
        attitude: The angles, rad, shape (3,).
        omega, omega_rate: Body rates (rad/s) and their rates (rad/s^2), shape (3,) each.
        exact: Whether to solve ``omega = M eta'`` and ``omega' = M eta'' + M' eta'``; else the body
            rates count as rates of the angles (ch. 3, Eq. 8).
    """
    if not exact:
        return Moving(attitude, omega, omega_rate)
    (sr, sp, _), (cr, cp, _) = xp.sin(attitude), xp.cos(attitude)
    inverse = xp.array([[1.0, sr * sp / cp, cr * sp / cp], [0.0, cr, -sr], [0.0, sr / cp, cr / cp]])
    rate = inverse @ omega
    matrix = body_rate_matrix(*(Moving(attitude[i], rate[i], 0.0) for i in range(2)))
    return Moving(attitude, rate, inverse @ (omega_rate - matrix.rate @ rate))


def angular_jerk(attitude: Moving, jerk: Any) -> Any:
    """Second derivatives (rad/s^3) of the body rates ``omega = M eta'``, shape (3,).

    ``attitude`` is roll, pitch and yaw, rad, ``jerk`` their third derivatives, rad/s^3, shape (3,).
    """
    rates = Moving(attitude.rate, attitude.acceleration, jerk)
    turned: Moving = body_rate_matrix(attitude[0], attitude[1]) @ rates
    return turned.acceleration


def swept(vector: Moving, omega: Any, omega_rate: Any) -> Moving:
    """The rate of a vector (3,) that moves in a body, with its derivative; body axes.

    Body rates (rad/s) and their rates (rad/s^2) have shape (3,).
    """
    rate = vector.rate + cross(omega, vector.value)
    second = vector.acceleration + cross(omega_rate, vector.value)
    return Moving(rate, second + cross(omega, vector.rate), 0.0)


DECOUPLERS: Final = {"none": 0.0, "conventional": 1.0, "modified": 2.0, "exact": 3.0}
"""Decouplers by their name in a scenario."""

NO_DECOUPLER, CONVENTIONAL, MODIFIED, EXACT = DECOUPLERS.values()


@traceable
def conventional_decoupler(ax: Any, ay: Any, yaw: Any, gravity: Any) -> tuple[Any, Any]:
    """Roll and pitch (rad) of a plain quadrotor near hover (ch. 4, Eqs. 7-8).

    Args:
        ax, ay: Desired acceleration, m/s^2, world axes.
        yaw: rad.
        gravity: m/s^2.
    """
    s, c = xp.sin(yaw), xp.cos(yaw)
    return (ax * s - ay * c) / gravity, (ax * c + ay * s) / gravity


@traceable
def modified_decoupler(ax: Any, ay: Any, yaw: Any, gravity: Any, n: Any) -> tuple[Any, Any]:
    """Conventional roll and pitch (rad) plus the side force at level hover (ch. 4, Eqs. 9-11).

    Eq. 11 determines the rotor inputs with zero torque whose vertical force is the weight at level
    attitude. Their force is parallel to ``n``, so ``F_X = m g n_x / n_z`` and ``F_Y = m g n_y /
    n_z``: the printed 4 x 4 inverse in closed form. NaN where no such inputs exist.

    Args:
        ax, ay, yaw, gravity: See `conventional_decoupler`.
        n: The torque-free force, of any unit, body axes, shape (3,).
    """
    roll, pitch = conventional_decoupler(ax, ay, yaw, gravity)
    lift = xp.where(n[2] == 0.0, xp.nan, n[2])
    return roll + n[1] / lift, pitch - n[0] / lift


@traceable
def exact_decoupler(ax: Any, ay: Any, az: Any, yaw: Any, gravity: Any, n: Any) -> tuple[Any, Any]:
    """The roll and pitch (rad) that point the torque-free force along the desired one.

    Solves ``Ry(pitch) Rx(roll) n = d |n|`` with ``d`` the unit vector along ``Rz(-yaw) (ax, ay,
    g + az)``, on the branch that is level when ``n`` and ``d`` are vertical. Where no roll reaches
    ``d`` the nearest one is returned, at rest; NaN where the torque-free force has neither a
    lateral nor a vertical part, and in free fall, ``d = 0``.

    All arguments but gravity may be `Moving`; roll and pitch are then as well.

    Args:
        ax, ay, az: Desired acceleration, m/s^2, world axes.
        yaw, gravity, n: See `modified_decoupler`.
    """
    s, c = sine(yaw), cosine(yaw)
    dx, dy, dz = ax * c + ay * s, ay * c - ax * s, gravity + az
    # The rotors can push along n or against it; the side that points up is used.
    n = n * xp.where(value_of(n[2]) >= 0.0, 1.0, -1.0)
    lateral, desired = n[1] * n[1] + n[2] * n[2], dx * dx + dy * dy + dz * dz
    none = (value_of(lateral) == 0.0) | (value_of(desired) == 0.0)
    lateral, desired = where(none, xp.nan, lateral), where(none, xp.nan, desired)
    # n_y cos(roll) - n_z sin(roll) = d_y |n| / |d|: the component along the pitch axis.
    reach = dy * square_root((lateral + n[0] * n[0]) / desired)
    rest, phase = lateral - reach * reach, angle(n[2], n[1])
    reaches = value_of(rest) > 0.0
    reached = angle(square_root(where(reaches, rest, 1.0)), reach) - phase
    nearest = xp.arctan2(0.0, value_of(reach)) - value_of(phase)
    roll = where(reaches, reached, nearest)
    pitch = angle(dx, dz) - angle(n[0], n[1] * sine(roll) + n[2] * cosine(roll))
    return roll, pitch


def decoupled(decoupler: float, acceleration: Any, yaw: Any, gravity: Any, n: Any) -> Any:
    """Roll and pitch (rad) by a decoupler of `DECOUPLERS` other than none.

    Args:
        decoupler: Its number.
        acceleration: Desired, m/s^2, world axes, shape (3,).
        yaw, gravity, n: See `modified_decoupler`; with the exact one they may move.
    """
    ax, ay, az = acceleration[0], acceleration[1], acceleration[2]
    if decoupler == EXACT:
        return exact_decoupler(ax, ay, az, yaw, gravity, n)
    if decoupler == CONVENTIONAL:
        return conventional_decoupler(ax, ay, yaw, gravity)
    return modified_decoupler(ax, ay, yaw, gravity, n)
