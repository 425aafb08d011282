"""Between ch. 2's axes (x forward, y right, z down) and ours (x forward, y left, z up).

Both world and body are turned half a revolution about x, so every vector changes the signs of y
and z, and so do pitch and yaw. Each function is its own inverse: it takes either convention to the
other. Nothing else in the package knows that there are two.
"""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Triple, scalar


@scalar
def turned_over(x: float, y: float, z: float) -> Triple:
    """A vector of either convention (position, rate, torque; world or body axes) in the other."""
    return x, -y, -z


@scalar
def attitude_turned_over(roll: float, pitch: float, yaw: float) -> Triple:
    """Roll, pitch and yaw (rad) of either convention in the other.

    The rotation becomes ``D Rz(yaw) Ry(pitch) Rx(roll) D`` with ``D = diag(1, -1, -1)``, which is
    ``Rz(-yaw) Ry(-pitch) Rx(roll)``.
    """
    return roll, -pitch, -yaw


@scalar
def state_turned_over(state: tuple[float, ...]) -> tuple[float, ...]:
    """A quadrotor's state of either convention in the other.

    The state is ``(x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate)``; thrust
    is a magnitude and keeps its sign.
    """
    x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate = state
    return (
        *turned_over(x, y, z),
        *turned_over(vx, vy, vz),
        *attitude_turned_over(roll, pitch, yaw),
        *turned_over(p, q, r),
        *(thrust, thrust_rate),
    )
