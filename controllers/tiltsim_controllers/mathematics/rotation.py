"""Rotations between body and world, ``Rz(yaw) Ry(pitch) Rx(roll)`` (ch. 3, Eq. 2)."""

from __future__ import annotations

from functools import partial
from math import asin, atan2, sqrt

from tiltsim_controllers.code.tracing import make
from tiltsim_controllers.mathematics.scalar import Quad, Triple

sin, cos = partial(make, "sin"), partial(make, "cos")
"""Sine and cosine of plain and traced numbers."""


def euler_from_quaternion(w: float, x: float, y: float, z: float) -> Triple:
    """Roll, pitch and yaw (rad) of a unit quaternion.

    Args:
        w, x, y, z: the components, real part first
    """
    sin_pitch = 2.0 * (w * y - z * x)
    # Rounding may carry the sine past one at pitch = +-90 degrees.
    if not -1.0 <= sin_pitch <= 1.0:
        sin_pitch = min(1.0, max(-1.0, sin_pitch))
    return (
        atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        asin(sin_pitch),
        atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)),
    )


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Quad:
    """The unit quaternion ``(w, x, y, z)`` of roll, pitch and yaw (rad)."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def rotation_from_euler(roll: float, pitch: float, yaw: float) -> tuple[float, ...]:
    """The body-to-world rotation (ch. 3, Eq. 2) of angles in rad: nine entries, row by row."""
    sr, cr = sin(roll), cos(roll)
    sp, cp = sin(pitch), cos(pitch)
    sy, cy = sin(yaw), cos(yaw)
    return (
        cp * cy,
        sr * sp * cy - cr * sy,
        cr * sp * cy + sr * sy,
        cp * sy,
        sr * sp * sy + cr * cy,
        cr * sp * sy - sr * cy,
        -sp,
        sr * cp,
        cr * cp,
    )


def rotation_from_quaternion(w: float, x: float, y: float, z: float) -> tuple[float, ...]:
    """The body-to-world rotation of a unit quaternion: nine entries, row by row.

    Args:
        w, x, y, z: the components, real part first
    """
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


def quaternion_from_rotation(rotation: tuple[float, ...]) -> Quad:
    """A unit quaternion ``(w, x, y, z)`` of a body-to-world rotation, nine entries, row by row.

    The diagonal shows which component is the largest; sums of the entries are its products with
    all four. Normalizing removes the rounding error of the rotation.
    """
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    if r11 + r22 + r33 >= max(r11, r22, r33):
        w, x, y, z = 1.0 + r11 + r22 + r33, r32 - r23, r13 - r31, r21 - r12
    elif r11 >= r22 and r11 >= r33:
        w, x, y, z = r32 - r23, 1.0 + r11 - r22 - r33, r12 + r21, r13 + r31
    elif r22 >= r33:
        w, x, y, z = r13 - r31, r12 + r21, 1.0 - r11 + r22 - r33, r23 + r32
    else:
        w, x, y, z = r21 - r12, r13 + r31, r23 + r32, 1.0 - r11 - r22 + r33
    scale = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return scale * w, scale * x, scale * y, scale * z
