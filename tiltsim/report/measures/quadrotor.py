"""Yaw-position control of the quadrotor and its alleged singular zone (ch. 2)."""

from collections.abc import Sequence
from math import comb
from typing import Final

import numpy as np

from tiltsim_controllers.analysis.singularity import (
    normalized_determinant,
    published_determinant,
    published_singular_curve,
    world_up,
)
from tiltsim_controllers.analysis.stability import is_hurwitz
from tiltsim_controllers.laws import quadrotor_attitude_altitude, yaw_position
from tiltsim_controllers.mathematics.attitude import euler_rates
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2_unrounded"]
_HOVER: Final = _VEHICLE.mass * _VEHICLE.gravity
_SINGULAR: Final = 1e-9


def exact_zero_on_published_curve() -> bool:
    """Whether the exact determinant vanishes somewhere on S = 0."""
    curve = published_singular_curve()
    return bool(np.abs(normalized_determinant(*curve, _HOVER, _VEHICLE)).min() < _SINGULAR)


def exact_zero_within_90_degrees() -> bool:
    """Whether the exact determinant vanishes or changes its sign within 90 degrees."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 301)[1:-1]
    roll, pitch = np.meshgrid(angles, angles)
    return bool((normalized_determinant(roll, pitch, _HOVER, _VEHICLE) <= 0.0).any())


def eq_43_as_printed() -> bool:
    """Whether S is the determinant of the matrix of Eq. (43), with its printed zero."""
    rng = np.random.default_rng(0)
    worst = 0.0
    for phi, theta, psi in rng.uniform(-1.5, 1.5, (200, 3)):
        (sf, st, sp), (cf, cp) = np.sin([phi, theta, psi]), np.cos([phi, psi])
        first = cp * st * cf - cp * st * sf + sp * sf + sp * cf
        second = sp * st * cf - sp * st * sf - cp * sf - cp * cf
        matrix = [[first, sp * cf, cp], [second, -cp * cf, sp], [0.0, sf, st]]
        worst = max(worst, abs(np.linalg.det(matrix) - published_determinant(phi, theta)))
    return bool(worst < 1e-12)


def level_determinant() -> float:
    """The exact determinant at level attitude, over its value in hover."""
    return float(normalized_determinant(0.0, 0.0, _HOVER, _VEHICLE))


def singular_without_thrust() -> bool:
    """Whether the exact determinant is 0 at zero thrust."""
    return float(normalized_determinant(0.3, 0.2, 0.0, _VEHICLE)) == 0.0


def quadrotor_gains_are_stable(law: str) -> bool:
    """Whether Appendix B's gains, of position or altitude, and of yaw stabilize their loops."""
    module = yaw_position if law == "yaw_position" else quadrotor_attitude_altitude
    return all(is_hurwitz((1.0, *gains)) for gains in module.GAIN_SETS["ch02"])


def attitude_altitude_is_singular() -> bool:
    """The matrix from thrust and torques to (z, roll, pitch, yaw) accelerations, over a grid."""
    angles = np.linspace(-1.55, 1.55, 63)
    for roll in angles:
        for pitch in angles:
            rates = euler_rates(np.array([roll, pitch, 0.0]), np.eye(3))
            lift = float(world_up(roll, pitch)[2])
            if abs(lift * np.linalg.det(rates)) < _SINGULAR:
                return True
    return False


def axis_has_no_influence(roll_sign: float, pitch_sign: float) -> bool:
    """Whether the exact determinant stays the same if body axes are reversed."""
    angles = np.linspace(-1.5, 1.5, 61)
    roll, pitch = np.meshgrid(angles, angles)
    exact = normalized_determinant(roll, pitch, _HOVER, _VEHICLE)
    flipped = normalized_determinant(roll_sign * roll, pitch_sign * pitch, _HOVER, _VEHICLE)
    return bool(np.abs(exact - flipped).max() < _SINGULAR)


def zone_holds_the_curve() -> bool:
    """Whether the zone of Eq. (47) contains all of S = 0."""
    roll, pitch = published_singular_curve()
    inside = (np.abs(pitch) <= 0.5) & (roll >= -np.pi / 2) & (roll <= 0.2)
    return bool(inside.all())


def choices_of_six(picked: Sequence[int]) -> tuple[float, ...]:
    """In how many ways each number of outputs can be picked out of six."""
    return tuple(float(comb(6, number)) for number in picked)
