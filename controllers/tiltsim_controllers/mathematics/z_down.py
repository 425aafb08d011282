"""Between ch. 2's axes (x forward, y right, z down) and ours (x forward, y left, z up).

Both world and body are turned half a revolution about x, so every vector changes the signs of y
and z, and so do pitch and yaw. Each function is its own inverse: it takes either convention to the
other. Nothing else in the package knows that there are two.
"""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Triple, scalar


@scalar
def flip_vector(x: float, y: float, z: float) -> Triple:
    """A vector of either convention (position, rate, torque; world or body axes) in the other."""
    return x, -y, -z


@scalar
def flip_attitude(roll: float, pitch: float, yaw: float) -> Triple:
    """Roll, pitch and yaw (rad) of either convention in the other.

    The rotation becomes ``D Rz(yaw) Ry(pitch) Rx(roll) D`` with ``D = diag(1, -1, -1)``, which is
    ``Rz(-yaw) Ry(-pitch) Rx(roll)``.
    """
    return roll, -pitch, -yaw


@scalar
def flip_state(state: tuple[float, ...]) -> tuple[float, ...]:
    """A quadrotor's state of either convention in the other.

    The state is ``(x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate)``; thrust
    is a magnitude and keeps its sign.
    """
    x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate = state
    return (
        *flip_vector(x, y, z),
        *flip_vector(vx, vy, vz),
        *flip_attitude(roll, pitch, yaw),
        *flip_vector(p, q, r),
        *(thrust, thrust_rate),
    )
