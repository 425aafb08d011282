"""Position control that demands an acceleration, and the attitude that makes it.

Shared by the laws that demand a wrench or thrusts: `geometric`, `pid` and `indi`.
"""

from __future__ import annotations

from math import sqrt

from tiltsim_controllers.laws.decouplers import exact_decoupler
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_body, to_world
from tiltsim_controllers.mathematics.scalar import Triple, Values, scalar
from tiltsim_controllers.vehicle.multirotor import Body, inertia_times
from tiltsim_controllers.vehicle.rigid_body import cross


@scalar
def shortened(vector: Triple, limit: float) -> Triple:
    """A vector of the same direction, no longer than a limit."""
    x, y, z = vector
    length = sqrt(x * x + y * y + z * z)
    scale = limit / length if length > limit else 1.0
    return scale * x, scale * y, scale * z


@scalar
def tracking_errors(observed: Observed) -> tuple[Triple, Triple]:
    """Reference minus actual position (m) and velocity (m/s), world axes."""
    reference = observed.reference
    x, y, z = observed.position
    vx, vy, vz = observed.velocity
    return (
        (reference.position[0] - x, reference.position[1] - y, reference.position[2] - z),
        (reference.velocity[0] - vx, reference.velocity[1] - vy, reference.velocity[2] - vz),
    )


@scalar
def demanded_acceleration(
    observed: Observed, position_gain: float, velocity_gain: float, limit: float
) -> Triple:
    """The reference's acceleration plus feedback of position and velocity, m/s^2, world axes.

    Args:
        observed: by the law
        position_gain, velocity_gain: 1/s^2 and 1/s
        limit: of the feedback's length, m/s^2
    """
    error, speed = tracking_errors(observed)
    x, y, z = shortened(
        (
            position_gain * error[0] + velocity_gain * speed[0],
            position_gain * error[1] + velocity_gain * speed[1],
            position_gain * error[2] + velocity_gain * speed[2],
        ),
        limit,
    )
    ax, ay, az = observed.reference.acceleration
    return x + ax, y + ay, z + az


@scalar
def pointing_attitude(observed: Observed, acceleration: Triple, axis: Triple) -> Values:
    """The rotation, rows first, that points an axis of the body along the demanded force.

    That of an ``acceleration`` (m/s^2, world axes); the yaw is the reference's.
    """
    ax, ay, az = acceleration
    yaw = observed.reference.attitude[2]
    roll, pitch = exact_decoupler(ax, ay, az, yaw, observed.vehicle.gravity, axis)
    return rotation_from_euler(roll, pitch, yaw)


@scalar
def pointing_rates(
    observed: Observed, acceleration: Triple, axis: Triple, attitude: Values
) -> Triple:
    """Rates (rad/s, the present body axes) of `pointing_attitude` as the reference accelerates.

    The force turns with the reference's jerk, and the yaw stays. What the feedback adds to the
    jerk is left out.

    Args:
        observed: by the law
        acceleration: demanded, m/s^2, world axes
        axis: of the force, body axes
        attitude: `pointing_attitude`
    """
    fx, fy, fz = acceleration
    fz += observed.vehicle.gravity
    square = fx * fx + fy * fy + fz * fz
    wx, wy, wz = cross((fx, fy, fz), observed.reference.jerk)
    wx, wy, wz = wx / square, wy / square, wz / square
    # Turning about the force as well keeps the yaw: no rate about the axis across pitch and roll.
    dx, dy, dz = to_world(attitude, axis)
    cos_pitch = sqrt(attitude[0] * attitude[0] + attitude[3] * attitude[3])
    mx, my = -attitude[6] * attitude[0] / cos_pitch, -attitude[6] * attitude[3] / cos_pitch
    along = (wx * mx + wy * my + wz * cos_pitch) / (dx * mx + dy * my + dz * cos_pitch)
    return to_body(observed.rotation, (wx - along * dx, wy - along * dy, wz - along * dz))


@scalar
def push_along(observed: Observed, acceleration: Triple, axis: Triple) -> float:
    """The part (N) along an axis of the body of the force for an acceleration (m/s^2, world)."""
    body = observed.vehicle
    ax, ay, az = acceleration
    fx, fy, fz = to_body(observed.rotation, (ax, ay, az + body.gravity))
    x, y, z = axis
    return body.mass * (fx * x + fy * y + fz * z) / sqrt(x * x + y * y + z * z)


@scalar
def torque_for(body: Body, rates: Triple, angular: Triple, gyroscopic: float) -> Triple:
    """The torque (N m) of an angular acceleration (rad/s^2), body axes.

    Args:
        body: its inertia counts
        rates: of the body, rad/s
        angular: the angular acceleration
        gyroscopic: factor of the gyroscopic torque, 1 or 0
    """
    x, y, z = inertia_times(body, angular)
    gx, gy, gz = cross(rates, inertia_times(body, rates))
    return x + gyroscopic * gx, y + gyroscopic * gy, z + gyroscopic * gz
