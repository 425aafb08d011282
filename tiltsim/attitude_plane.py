"""The roll-pitch plane of a flight: singular attitudes and the distance to them (ch. 5 to 8).

The decoupling matrix is singular where world up, seen from the body, is perpendicular to the
torque-free force ``n = (-R_theta, R_phi, R)``: a great circle of attitudes, which the plane shows
as the unacceptable-attitude curve ``pitch = atan(-(R cos roll + R_phi sin roll) / R_theta)``.
Points of the plane are (roll, pitch) in rad; ``n`` has shape (N, 3), one row an instant.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from controllers.decoupling_matrix import torque_entries, torque_free_force
from controllers.vehicle import drag_ratio

if TYPE_CHECKING:
    from controllers.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

HALF_WIDTH: Final = pi / 2
"""The plane reaches to this roll and pitch (rad) either way."""

MARGIN_THRESHOLD: Final = 0.2
"""Singularity margin (rad) below which a flight is called close to singular."""

_TINY: Final = 1e-12
"""Below this, relative to the untilted vehicle's 4, a component of ``n`` counts as zero."""


def torque_free_forces(columns: Mapping[str, Floats], vehicle: Vehicle) -> Floats:
    """The torque-free force ``n`` of every sample's tilt angles, shape (N, 3)."""
    tilts = [columns[f"alpha_{rotor}"] for rotor in (1, 2, 3, 4)]
    trig: Any = tuple(part for tilt in tilts for part in (np.sin(tilt), np.cos(tilt)))
    ratio = drag_ratio(vehicle)
    return np.stack(torque_free_force(trig, torque_entries(trig, ratio), ratio), axis=1)


def singular_curves(n: Floats, points: int = 61) -> Floats:
    """Unacceptable-attitude curves, shape (N, points, 2).

    Sampled evenly along the great circle, so that a steep or vertical curve (``R_theta = 0``) is
    followed like any other. NaN where there is none within the plane: ``n`` vertical, or ``n = 0``
    (singular at every attitude).
    """
    nx, ny, nz = n[:, 0], n[:, 1], n[:, 2]
    lean = np.hypot(nx, ny)
    with np.errstate(invalid="ignore", divide="ignore"):
        lean = np.where(lean > _TINY, lean, np.nan)
        level = np.stack([-ny, nx, np.zeros_like(nx)], axis=1) / lean[:, np.newaxis]
        upward = np.stack([-nx * nz, -ny * nz, lean * lean], axis=1)
        upward /= np.linalg.norm(upward, axis=1)[:, np.newaxis]
    turned = np.linspace(0.0, pi, points)[np.newaxis, :, np.newaxis]
    return attitude_of(
        np.cos(turned) * level[:, np.newaxis] + np.sin(turned) * upward[:, np.newaxis]
    )


def forbidden_pitch(n: Floats, side: float, roll: Floats) -> Floats:
    """The interval of pitch that is out of reach at each roll, shape (N, len(roll), 2).

    Out of reach is what lies beyond the curve: where ``n . r3`` has another sign than ``side``, the
    sign at the start of the flight. Empty intervals have both ends equal.
    """
    normal = n[:, :, np.newaxis] * side
    lift = normal[:, 1] * np.sin(roll) + normal[:, 2] * np.cos(roll)
    lean = np.where(np.abs(normal[:, 0]) > _TINY, normal[:, 0], 0.0) + np.zeros_like(lift)
    # n . r3 = lift cos(pitch) - lean sin(pitch): negative where lean tan(pitch) > lift.
    with np.errstate(divide="ignore", invalid="ignore"):
        border = np.arctan(lift / lean)
    low = np.where(lean > 0.0, border, -HALF_WIDTH)
    high = np.where(lean < 0.0, border, HALF_WIDTH)
    reachable = (lean == 0.0) & (lift > _TINY)
    return np.stack([low, np.where(reachable, low, high)], axis=2)


def nearest_singular(n: Floats, attitude: Floats) -> Floats:
    """The singular attitude nearest to each attitude, shape (N, 2); itself where all are equal.

    The rotation that leads there is as large as the singularity margin.
    """
    up = world_up(attitude)
    length = np.linalg.norm(n, axis=1, keepdims=True)
    direction = n / np.where(length > 0.0, length, 1.0)
    flat = up - np.sum(up * direction, axis=1, keepdims=True) * direction
    return np.where(
        np.linalg.norm(flat, axis=1, keepdims=True) > _TINY, attitude_of(flat), attitude
    )


def world_up(attitude: Floats) -> Floats:
    """World up seen from the body at (roll, pitch), shape (..., 2) to (..., 3)."""
    roll, pitch = attitude[..., 0], attitude[..., 1]
    level = np.cos(pitch)
    return np.stack([-np.sin(pitch), np.sin(roll) * level, np.cos(roll) * level], axis=-1)


def attitude_of(up: Floats) -> Floats:
    """Roll and pitch at which the body sees world up along ``up``; inverse of `world_up`."""
    x, y, z = up[..., 0], up[..., 1], up[..., 2]
    return np.stack([np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))], axis=-1)
