"""Steps of the feedback around a moving reference: position, force, attitude.

Vectors have an entry for each axis; quantities with derivatives are
`tiltsim_controllers.mathematics.moving.Moving`.
"""

from __future__ import annotations

from typing import Any

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.moving import Moving, cosine, sine, square_root, stacked, where


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

    Ch. 3, Eq. 8, takes it for the unit matrix.

    Args:
        roll, pitch: rad, moving.
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
    """Second derivatives (rad/s^3) of the body rates: of ``omega = M eta'``, shape (3,).

    Args:
        attitude: Roll, pitch and yaw, rad, shape (3,).
        jerk: Their third derivatives, rad/s^3, shape (3,).
    """
    rates = Moving(attitude.rate, attitude.acceleration, jerk)
    turned: Moving = body_rate_matrix(attitude[0], attitude[1]) @ rates
    return turned.acceleration


def swept(vector: Moving, omega: Any, omega_rate: Any) -> Moving:
    """The rate of a vector that rotates with the body, with its derivative; body axes.

    Args:
        vector: Moving in body axes, shape (3,).
        omega, omega_rate: Body rates (rad/s) and their rates (rad/s^2), shape (3,) each.
    """
    rate = vector.rate + cross(omega, vector.value)
    second = vector.acceleration + cross(omega_rate, vector.value)
    return Moving(rate, second + cross(omega, vector.rate), 0.0)
