"""Rotations between body and world as matrices, ``Rz(yaw) Ry(pitch) Rx(roll)`` (ch. 3, Eq. 2)."""

from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import cross

FLIP: Final = np.array([1.0, -1.0, -1.0])
"""Half a turn about x: between z up and north, east, down; and between forward, left, up and
forward, right, down."""


def rotation_matrix(attitude: Any) -> Any:
    """The body-to-world rotation (3, 3) of roll, pitch and yaw (rad); its last row is world up."""
    (sr, sp, sy), (cr, cp, cy) = xp.sin(attitude), xp.cos(attitude)
    return xp.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def rotation_of_quaternion(quaternion: Any) -> Any:
    """The body-to-world rotation, shape (3, 3), of a unit quaternion ``w, x, y, z``."""
    w, x, y, z = quaternion
    return xp.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def euler_angles(quaternion: Any) -> Any:
    """Roll, pitch and yaw (rad), shape (3,), of a unit quaternion ``w, x, y, z``."""
    w, x, y, z = quaternion
    # Rounding may carry the sine past one at a pitch of 90 degrees.
    return xp.array(
        [
            xp.arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
            xp.arcsin(xp.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
            xp.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)),
        ]
    )


def attitude_error(rotation: Any, desired: Any) -> Any:
    """``(R^T R_d - R_d^T R)^vee / 2``, body axes: the sine of the remaining angle, along its axis.

    It also vanishes half a revolution away. Both rotations are body to world, shape (3, 3).
    """
    turn = rotation.T @ desired
    return 0.5 * xp.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )


def wrapped(angle: Any) -> Any:
    """The equivalent angle (rad) from -pi to pi, for differences of yaw."""
    turns = xp.floor(angle / (2.0 * xp.pi) + 0.5)
    return xp.where(abs(angle) > xp.pi, angle - 2.0 * xp.pi * turns, angle)


def euler_rates(attitude: Any, omega: Any) -> Any:
    """Rates of roll, pitch and yaw (rad/s), shape (3,), at body rates (rad/s), shape (3,)."""
    (sr, sp, _), (cr, cp, _) = xp.sin(attitude), xp.cos(attitude)
    p, q, r = omega
    yaw_rate = (sr * q + cr * r) / cp
    return xp.array([p + sp * yaw_rate, cr * q - sr * r, yaw_rate])


def euler_of_rotation(rotation: Any) -> Any:
    """Roll, pitch and yaw (rad), shape (3,), of a body-to-world rotation, shape (3, 3)."""
    # Rounding may carry the sine past one at a pitch of 90 degrees.
    return xp.array(
        [
            xp.arctan2(rotation[2, 1], rotation[2, 2]),
            xp.arcsin(xp.clip(-rotation[2, 0], -1.0, 1.0)),
            xp.arctan2(rotation[1, 0], rotation[0, 0]),
        ]
    )


def quaternion_product(a: Any, b: Any) -> Any:
    """The rotation ``b`` about axes of the body, after ``a``: shape (4,), scalar first."""
    along, across = a[0] * b[1:] + b[0] * a[1:], cross(a[1:], b[1:])
    return xp.hstack([a[0] * b[0] - a[1:] @ b[1:], along + across])


def quaternion_of_euler(attitude: Any) -> Any:
    """The unit quaternion ``w, x, y, z`` of roll, pitch and yaw (rad)."""
    half = 0.5 * xp.array(attitude)
    (sr, sp, sy), (cr, cp, cy) = xp.sin(half), xp.cos(half)
    return xp.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def quaternion_of_rotation(rotation: Any) -> Any:
    """A unit quaternion ``w, x, y, z`` of a body-to-world rotation, shape (3, 3).

    The diagonal shows which component is the largest; sums of the entries are its products with
    all four. Normalizing removes the rounding error of the rotation.
    """
    (r11, r12, r13), (r21, r22, r23), (r31, r32, r33) = rotation
    most = xp.maximum(xp.maximum(r11, r22), r33)
    by_w = xp.array([1.0 + r11 + r22 + r33, r32 - r23, r13 - r31, r21 - r12])
    by_x = xp.array([r32 - r23, 1.0 + r11 - r22 - r33, r12 + r21, r13 + r31])
    by_y = xp.array([r13 - r31, r12 + r21, 1.0 - r11 + r22 - r33, r23 + r32])
    by_z = xp.array([r21 - r12, r13 + r31, r23 + r32, 1.0 - r11 - r22 + r33])
    others = xp.where(r11 >= most, by_x, xp.where(r22 >= most, by_y, by_z))
    found = xp.where(r11 + r22 + r33 >= most, by_w, others)
    return found / xp.sqrt(found @ found)
