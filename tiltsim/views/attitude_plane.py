"""The roll-pitch plane of a flight: singular attitudes and the distance to them (ch. 5 to 8).

The decoupling matrix is singular where world up, seen from the body, is perpendicular to the
torque-free force ``n = (-R_theta, R_phi, R)``: a great circle of attitudes, which the plane shows
as the unacceptable-attitude curve ``pitch = atan(-(R cos roll + R_phi sin roll) / R_theta)``.
Points of the plane are (roll, pitch) in rad; ``n``, shape (N, 3), holds unit vectors along it, one
row an instant, zero where every attitude is singular.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim_controllers.analysis.singularity import torque_free_direction, world_up
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario
    from tiltsim_controllers.vehicle.parameters import Vehicle

HALF_WIDTH: Final = pi / 2
"""The plane reaches to this roll and pitch (rad) either way."""

MARGIN_THRESHOLD: Final = 0.2
"""Singularity margin (rad) below which a flight is called close to singular."""

SUPERVISION_THRESHOLD: Final = 0.01
"""From this share on of what it can do a supervisor counts as acting."""

MIN_DIRECTION_TILT: Final = 1e-3
"""Where ``n`` leans by less (rad), the curve is as near to the square's frame: there is none."""

MOVING_TRAIL_TIME: Final = 1.0
"""How much (s) of the attitude's trail is shown beside a curve that moves."""

_TINY: Final = 1e-12
"""Below this a component of the unit vector ``n`` counts as zero."""


def margin_threshold(scenario: Scenario) -> float:
    """The margin (rad) not to be missed: a supervisor's, else `MARGIN_THRESHOLD`."""
    supervisor = getattr(scenario.controller, "supervisor", None)
    return supervisor.min_margin if supervisor is not None else MARGIN_THRESHOLD


def curve_is_constant(scenario: Scenario) -> bool:
    """Whether the unacceptable-attitude curve is the same throughout a scenario's flights."""
    if scenario.vehicle.model == "quadrotor":
        return True
    return scenario.controller.law == "attitude_altitude" and scenario.gait.type == "fixed"


def torque_free_directions(columns: Mapping[str, Floats], vehicle: Vehicle) -> Floats:
    """The unit vector along ``n`` for every sample's tilt angles, shape (N, 3).

    Upwards; zero where the decoupling matrix is singular at every attitude.
    """
    angles = np.stack([columns[f"alpha_{rotor}"] for rotor in (1, 2, 3, 4)], axis=-1)
    return np.nan_to_num(torque_free_direction(angles, vehicle))


def singular_curves(n: Floats, points: int = 61) -> Floats:
    """Unacceptable-attitude curves, shape (N, points, 2).

    Sampled evenly along the great circle, so that a steep or vertical curve (``R_theta = 0``) is
    followed like any other. NaN where there is none within the plane: ``n`` vertical, as it is for
    red gaits but for what servos and rounding leave (`MIN_DIRECTION_TILT`), or ``n = 0`` (singular
    at every attitude).
    """
    nx, ny, nz = n[:, 0], n[:, 1], n[:, 2]
    lean = np.hypot(nx, ny)
    with np.errstate(invalid="ignore", divide="ignore"):
        lean = np.where(lean > MIN_DIRECTION_TILT, lean, np.nan)
        level = np.stack([-ny, nx, np.zeros_like(nx)], axis=1) / lean[:, np.newaxis]
        upward = np.stack([-nx * nz, -ny * nz, lean * lean], axis=1)
        upward /= np.linalg.norm(upward, axis=1)[:, np.newaxis]
    turned = np.linspace(0.0, pi, points)[np.newaxis, :, np.newaxis]
    return attitude_of(
        np.cos(turned) * level[:, np.newaxis] + np.sin(turned) * upward[:, np.newaxis]
    )


def unreachable_pitch(n: Floats, side: float, roll: Floats) -> Floats:
    """The interval of pitch that is out of reach at each roll, shape (N, len(roll), 2).

    Out of reach is what lies beyond the curve: where ``n . r3`` has another sign than ``side``,
    that of the singularity margin at the start of the flight. Empty intervals have both ends equal.
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
    up = world_up(attitude[:, 0], attitude[:, 1])
    flat = up - np.sum(up * n, axis=1, keepdims=True) * n
    return np.where(
        np.linalg.norm(flat, axis=1, keepdims=True) > _TINY, attitude_of(flat), attitude
    )


def attitude_of(up: Floats) -> Floats:
    """Roll and pitch at which the body sees world up along ``up``, shape (..., 3) to (..., 2)."""
    x, y, z = up[..., 0], up[..., 1], up[..., 2]
    return np.stack([np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))], axis=-1)
