"""Position control that demands an acceleration, and the attitude that makes it.

Shared by the laws that demand a wrench or thrusts: `geometric`, `pid` and `indi`.
"""

from __future__ import annotations

from typing import Any, Final

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.decouplers import exact_decoupler
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.linear import cross, norm

UP: Final = (0.0, 0.0, 1.0)


def shortened(vector: Any, limit: Any) -> Any:
    """A vector of the same direction, shape (3,), no longer than a limit."""
    square = vector @ vector
    is_long = square > limit * limit
    return xp.where(is_long, limit / xp.sqrt(xp.where(is_long, square, 1.0)), 1.0) * vector


def tracking_errors(observed: Observed) -> tuple[Any, Any]:
    """Reference minus actual position (m) and velocity (m/s), world axes, shape (3,) each."""
    reference = observed.reference
    return reference.position - observed.position, reference.velocity - observed.velocity


def demanded_acceleration(
    observed: Observed, position_gain: Any, velocity_gain: Any, limit: Any
) -> Any:
    """The reference's acceleration plus feedback of position and velocity, m/s^2, world, (3,).

    Args:
        observed: By the law.
        position_gain, velocity_gain: 1/s^2 and 1/s.
        limit: Largest length of the feedback, m/s^2.
    """
    error, speed = tracking_errors(observed)
    feedback = shortened(position_gain * error + velocity_gain * speed, limit)
    return feedback + observed.reference.acceleration


def pointing_attitude(observed: Observed, acceleration: Any, axis: Any) -> Any:
    """The rotation, shape (3, 3), that points a body axis along the force for an acceleration.

    Args:
        observed: Observation by the law; the yaw comes from its reference.
        acceleration: m/s^2, world axes, shape (3,).
        axis: Axis of the force, body axes, shape (3,).
    """
    (ax, ay, az), yaw = acceleration, observed.reference.attitude[2]
    roll, pitch = exact_decoupler(ax, ay, az, yaw, observed.vehicle.gravity, axis)
    return rotation_matrix(xp.array([roll, pitch, yaw]))


def pointing_rates(observed: Observed, acceleration: Any, axis: Any, attitude: Any) -> Any:
    """Rates (rad/s, the present body axes) of `pointing_attitude` as the reference accelerates.

    The force turns with the reference's jerk, and the yaw stays. The jerk of the feedback is left
    out.

    Args:
        observed: By the law.
        acceleration: Demanded, m/s^2, world axes, shape (3,).
        axis: Axis of the force, body axes, shape (3,).
        attitude: `pointing_attitude`, shape (3, 3).
    """
    force = acceleration + observed.vehicle.gravity * xp.array(UP)
    turning = cross(force, observed.reference.jerk) / (force @ force)
    # Turning about the force as well keeps the yaw: no rate about the axis across pitch and roll.
    direction, nose, cos_pitch = attitude @ axis, attitude[:, 0], norm(attitude[:2, 0])
    across = (xp.array(UP) - nose[2] * nose) / cos_pitch
    turning = turning - (turning @ across) / (direction @ across) * direction
    return observed.rotation.T @ turning


def push_along(observed: Observed, acceleration: Any, axis: Any) -> Any:
    """The component (N) along a body axis of the force for an acceleration (m/s^2, world)."""
    body = observed.vehicle
    force = observed.rotation.T @ (acceleration + body.gravity * xp.array(UP))
    return body.mass * (force @ axis) / norm(axis)


def torque_for(observed: Observed, angular: Any) -> Any:
    """The torque (N m) of an angular acceleration (rad/s^2), body axes, shape (3,) each."""
    momentum = observed.inertia @ observed.body_rates
    return observed.inertia @ angular + observed.gyroscopic * cross(observed.body_rates, momentum)
