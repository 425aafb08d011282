"""Steps of the feedback around a moving reference, shared by the parts of gait feed-forward."""

from __future__ import annotations

from tiltsim_controllers.mathematics.jets import (
    Jet,
    Jets3,
    jet_product,
    jet_quotient,
    jet_square_root,
    jet_sum,
)
from tiltsim_controllers.mathematics.scalar import Quad, Triple, clipped, scalar
from tiltsim_controllers.vehicle.rigid_body import euler_derivatives


@scalar
def limited_acceleration(x: Jet, y: Jet, limit: float) -> tuple[Jet, Jet]:
    """A horizontal acceleration scaled back to ``limit`` (m/s^2) where it is longer."""
    square = jet_sum(1.0, jet_product(x, x), 1.0, jet_product(y, y))
    if square[0] <= limit * limit:
        return x, y
    scale = jet_quotient((limit, 0.0, 0.0), jet_square_root(square))
    return jet_product(x, scale), jet_product(y, scale)


@scalar
def position_feedback(error: Jet, jerk_error: float, integral: float, gains: Triple) -> Jet:
    """``k1 e' + k2 e + k3 integral`` of a position error, with its first two derivatives.

    Args:
        error, jerk_error: the error ``e`` with its first two derivatives, and its third, m and s
        integral: its integral, m s
        gains: ``(k1, k2, k3)``, 1/s to 1/s^3
    """
    k1, k2, k3 = gains
    return (
        k1 * error[1] + k2 * error[0] + k3 * integral,
        k1 * error[2] + k2 * error[1] + k3 * error[0],
        k1 * jerk_error + k2 * error[2] + k3 * error[1],
    )


@scalar
def integrator_rate(error: float, desired: float, limit: float) -> float:
    """Rate of an integrator of ``error``: zero where ``desired`` is beyond ``limit`` and grows."""
    if abs(desired) > limit and error * desired > 0.0:
        return 0.0
    return error


@scalar
def force_control(
    error: Jet, acceleration: Jet, integral: float, gains: Quad, limit: float
) -> tuple[float, float]:
    """Desired jerk along an axis that the force moves (ch. 4, Eq. 27), and its integrator's rate.

    Args:
        error, acceleration: the position error and the reference's acceleration with derivatives
        integral: of the error, m s
        gains: ``(k1, k2, k3, k4)``, 1/s to 1/s^4, the last on the integral
        limit: of the acceleration that the error may ask for before its integrator stops, m/s^2
    """
    k1, k2, k3, k4 = gains
    effort = k2 * error[1] + k3 * error[0] + k4 * integral
    jerk = acceleration[1] + k1 * error[2] + k2 * error[1] + k3 * error[0] + k4 * integral
    return jerk, integrator_rate(error[0], effort, k1 * limit)


@scalar
def attitude_jerk(desired: Jet, present: Jet, gains: Triple, limit: float) -> float:
    """Third-order error dynamics (ch. 4, Eq. 26) around a moving reference, with bounded effort.

    ``k1 e'' + k2 e' + k3 e`` while nothing saturates. Read as a cascade (the angle commands a rate,
    the rate an acceleration), the acceleration due to the errors is limited, and the rate to that
    from which it brakes, so that a large error does not stop a rotor.

    Args:
        desired, present: the angle with its first two derivatives, rad and s
        gains: ``(k1, k2, k3)``, 1/s to 1/s^3
        limit: largest acceleration, rad/s^2
    """
    k1, k2, k3 = gains
    rate = clipped(k3 / k2 * (desired[0] - present[0]), -limit * k1 / k2, limit * k1 / k2)
    acceleration = clipped(k2 / k1 * (rate + desired[1] - present[1]) + desired[2], -limit, limit)
    return k1 * (acceleration - present[2])


@scalar
def attitude_motion(attitude: Triple, omega: Triple, omega_rate: Triple, exact: float) -> Jets3:
    """Roll, pitch and yaw with their first two derivatives.

    Args:
        attitude: the angles, rad
        omega, omega_rate: body rates (rad/s) and their rates (rad/s^2)
        exact: 0 to use the body rates for the rates of the angles (ch. 3, Eq. 8).
    """
    roll, pitch, yaw = attitude
    if exact == 0.0:
        return (
            (roll, omega[0], omega_rate[0]),
            (pitch, omega[1], omega_rate[1]),
            (yaw, omega[2], omega_rate[2]),
        )
    d_roll, d_pitch, d_yaw, dd_roll, dd_pitch, dd_yaw = euler_derivatives(
        roll, pitch, omega, omega_rate
    )
    return (roll, d_roll, dd_roll), (pitch, d_pitch, dd_pitch), (yaw, d_yaw, dd_yaw)
