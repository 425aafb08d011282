"""Between ch. 2's axes (x forward, y right, z down) and ours (x forward, y left, z up).

World and body axes are both rotated by half a revolution about x, so the signs of y and z of every
vector flip, and so do those of pitch and yaw. Each function is its own inverse: it converts from
either convention to the other.
"""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Triple, scalar


@scalar
def flip_vector(x: float, y: float, z: float) -> Triple:
    """Convert a vector (position, rate, torque; world or body axes) to the other convention."""
    return x, -y, -z


@scalar
def flip_attitude(roll: float, pitch: float, yaw: float) -> Triple:
    """Convert roll, pitch and yaw (rad) to the other convention.

    The rotation becomes ``D Rz(yaw) Ry(pitch) Rx(roll) D`` with ``D = diag(1, -1, -1)``, which is
    ``Rz(-yaw) Ry(-pitch) Rx(roll)``.
    """
    return roll, -pitch, -yaw


@scalar
def flip_state(state: tuple[float, ...]) -> tuple[float, ...]:
    """Convert a quadrotor's state to the other convention.

    The state is ``(x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate)``; thrust
    is a magnitude and keeps its sign.
    """
    x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate = state
    return (
        *flip_vector(x, y, z),
        *flip_vector(vx, vy, vz),
        *flip_attitude(roll, pitch, yaw),
        *flip_vector(p, q, r),
        thrust,
        thrust_rate,
    )
