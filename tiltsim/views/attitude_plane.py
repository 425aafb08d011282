"""The roll-pitch plane of a flight: singular attitudes and the distance to them (ch. 5 to 8).

The decoupling matrix is singular where the world's up direction, in body axes, is perpendicular to
the torque-free force ``n = (-R_theta, R_phi, R)``. These singular attitudes (the thesis calls them
unacceptable) form a great circle, in the plane the curve
``pitch = atan(-(R cos roll + R_phi sin roll) / R_theta)``. Attitudes beyond the curve are
unreachable: every path to them crosses a singular attitude.

Points of the plane are (roll, pitch) in rad. ``n``, shape (N, 3), holds one unit vector per sample,
zero where every attitude is singular.
"""

from collections.abc import Mapping
from math import pi
from typing import Final

import numpy as np

from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.analysis.singularity import torque_free_direction, world_up
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.body import TILT_FIELDS
from tiltsim_controllers.vehicle.parameters import Vehicle

HALF_WIDTH: Final = pi / 2  # largest absolute roll and pitch in the plane, rad
MARGIN_THRESHOLD: Final = 0.2
"""Singularity margin (rad) below which an attitude counts as close to singular."""

SUPERVISION_THRESHOLD: Final = 0.01
"""Supervisor output (0 to 1) above which the supervisor counts as active."""

MIN_DIRECTION_TILT: Final = 1e-3
"""Angle (rad) of ``n`` to the body's z axis below which no curve is drawn.

The curve is as close to the border of the plane as that.
"""

MOVING_TRAIL_TIME: Final = 1.0  # length (s) of the attitude's trail where the singular curve moves
_TINY: Final = 1e-12  # threshold below which a component of the unit vector ``n`` counts as zero


def margin_threshold(scenario: Scenario) -> float:
    """The margin (rad) that a flight should keep: its supervisor's, else `MARGIN_THRESHOLD`."""
    supervisor = scenario.controller.supervision
    return supervisor.min_margin if supervisor is not None else MARGIN_THRESHOLD


def curve_is_constant(scenario: Scenario) -> bool:
    """Whether the curve of singular attitudes is the same throughout a scenario's flights."""
    if not scenario.vehicle.has_tilting_rotors:
        return True
    controller = scenario.controller
    follows = not (controller.commands_tilts or controller.is_external)
    return follows and scenario.gait.type == "fixed"


def torque_free_directions(columns: Mapping[str, Floats], vehicle: Vehicle) -> Floats:
    """The unit vector along ``n`` for the tilt angles of every sample, shape (N, 3).

    Its z component is not negative; it is zero where every attitude is singular.
    """
    angles = np.stack([columns[name] for name in TILT_FIELDS], axis=-1)
    return np.nan_to_num(torque_free_direction(angles, vehicle))


def side_of(margin: Floats) -> float:
    """The sign of the singularity margin at the start of a flight: its reachable attitudes."""
    return float(np.sign(margin[0])) or 1.0


def singular_curves(n: Floats, points: int = 61) -> Floats:
    """Curves of singular attitudes, shape (N, points, 2).

    Sampled evenly along the great circle, so that steep and vertical curves (``R_theta = 0``) need
    no special case. NaN where the plane has none: with ``n`` vertical, as for red gaits up to servo
    errors and rounding (`MIN_DIRECTION_TILT`), or zero (every attitude singular).
    """
    nx, ny, nz = n[:, 0], n[:, 1], n[:, 2]
    tilt = np.hypot(nx, ny)
    with np.errstate(invalid="ignore", divide="ignore"):
        tilt = np.where(tilt > MIN_DIRECTION_TILT, tilt, np.nan)
        level = np.stack([-ny, nx, np.zeros_like(nx)], axis=1) / tilt[:, np.newaxis]
        upward = np.stack([-nx * nz, -ny * nz, tilt * tilt], axis=1)
        upward /= np.linalg.norm(upward, axis=1)[:, np.newaxis]
    angle = np.linspace(0.0, pi, points)[np.newaxis, :, np.newaxis]
    return attitude_of(np.cos(angle) * level[:, np.newaxis] + np.sin(angle) * upward[:, np.newaxis])


def unreachable_pitch(n: Floats, side: float, roll: Floats) -> Floats:
    """The lower and upper end of unreachable pitch (rad) at each roll, shape (N, len(roll), 2).

    Attitudes where ``n . r3`` has another sign than ``side``, the singularity margin's at the start
    of the flight, lie beyond the curve. Both ends are equal where every pitch is reachable.
    """
    normal = n[:, :, np.newaxis] * side
    lift = normal[:, 1] * np.sin(roll) + normal[:, 2] * np.cos(roll)
    forward = np.where(np.abs(normal[:, 0]) > _TINY, normal[:, 0], 0.0) + np.zeros_like(lift)
    # n . r3 = lift cos(pitch) - forward sin(pitch): negative where forward tan(pitch) > lift.
    with np.errstate(divide="ignore", invalid="ignore"):
        border = np.arctan(lift / forward)
    low = np.where(forward > 0.0, border, -HALF_WIDTH)
    high = np.where(forward < 0.0, border, HALF_WIDTH)
    reachable = (forward == 0.0) & (lift > _TINY)
    return np.stack([low, np.where(reachable, low, high)], axis=2)


def nearest_singular(n: Floats, attitude: Floats) -> Floats:
    """The singular attitude nearest to each attitude, shape (N, 2).

    The rotation between the two is the singularity margin. Where all singular attitudes are equally
    near, the attitude itself is returned.
    """
    up = world_up(attitude[:, 0], attitude[:, 1])
    projected = up - np.sum(up * n, axis=1, keepdims=True) * n
    exists = np.linalg.norm(projected, axis=1, keepdims=True) > _TINY
    return np.where(exists, attitude_of(projected), attitude)


def attitude_of(up: Floats) -> Floats:
    """Roll and pitch, shape (..., 2), for the world's up direction in body axes, (..., 3)."""
    x, y, z = up[..., 0], up[..., 1], up[..., 2]
    return np.stack([np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))], axis=-1)
