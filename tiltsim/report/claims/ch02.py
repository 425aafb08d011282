"""Chapter 2: yaw-position control of the quadrotor and its alleged singular zone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import comb
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.statement import read_statements
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_determinant,
    published_singular_curve,
)
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.stability import is_hurwitz
from tiltsim_controllers.laws import quadrotor_attitude_altitude
from tiltsim_controllers.laws.yaw_position import GAIN_SETS, euler_rates
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2_unrounded"]
_HOVER: Final = _VEHICLE.mass * _VEHICLE.gravity
_SINGULAR: Final = 1e-9
_STABLE: Final = "ch02_singular_zone/exact_law#stable_gains"
_ONE_ENTRY: Final = (
    "Entry (3,1) of Eq. (43) is printed as 0; its own factors give -cos²θ (cos φ - sin φ), with "
    "which the determinant is -1 everywhere. The exact determinant, -d³ζ² cos φ / "
    "(I_x I_y I_z m³ cos θ), has no zero within 90 degrees."
)


def _exact_on_published_curve() -> bool:
    curve = published_singular_curve()
    return bool(np.abs(normalized_determinant(*curve, _HOVER, _VEHICLE)).min() < _SINGULAR)


def _zero_inside() -> bool:
    angles = np.linspace(-np.pi / 2, np.pi / 2, 301)[1:-1]
    roll, pitch = np.meshgrid(angles, angles)
    return bool((normalized_determinant(roll, pitch, _HOVER, _VEHICLE) <= 0.0).any())


def _eq_43_as_printed() -> bool:
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


def _are_stable(gains: Sequence[float], first: int) -> bool:
    """Whether the loop of the first gains and the loop of the others are stable."""
    return is_hurwitz((1.0, *gains[:first])) and is_hurwitz((1.0, *gains[first:]))


def _attitude_altitude_is_singular() -> bool:
    """The matrix from thrust and torques to (z, roll, pitch, yaw) accelerations, over a grid."""
    angles = np.linspace(-1.55, 1.55, 63)
    for roll in angles:
        for pitch in angles:
            rates = np.array([euler_rates(roll, pitch, *axis) for axis in np.eye(3)]).T
            lift = float(world_up(roll, pitch)[2])
            if abs(lift * np.linalg.det(rates)) < _SINGULAR:
                return True
    return False


def _axis_has_no_influence(roll_sign: float, pitch_sign: float) -> bool:
    """Whether S and the exact determinant stay the same if body axes are reversed."""
    angles = np.linspace(-1.5, 1.5, 61)
    roll, pitch = np.meshgrid(angles, angles)
    flipped = (roll_sign * roll, pitch_sign * pitch)
    published = published_determinant(roll, pitch) - published_determinant(*flipped)
    exact = normalized_determinant(roll, pitch, _HOVER, _VEHICLE)
    exact = exact - normalized_determinant(*flipped, _HOVER, _VEHICLE)
    return bool(max(np.abs(published).max(), np.abs(exact).max()) < _SINGULAR)


def _zone_holds_the_curve() -> bool:
    """Whether the zone of Eq. (47) contains all of S = 0."""
    roll, pitch = published_singular_curve()
    inside = (np.abs(pitch) <= 0.5) & (roll >= -np.pi / 2) & (roll <= 0.2)
    return bool(inside.all())


def _crossing_is_harmful(flights: Mapping[str, Metrics]) -> bool:
    """Whether the flight that crosses S = 0 with stable gains diverges there."""
    metrics = flights[_STABLE]
    crossed = metrics["min_published_determinant"] < 0.0 < metrics["max_published_determinant"]
    return bool(metrics["diverged"]) or not crossed


THESIS: Final = read_statements("ch02")

CLAIMS = (
    AnalysisClaim(THESIS["ch2-singular-zone"], _zero_inside, refuted=_ONE_ENTRY),
    AnalysisClaim(THESIS["ch2-surface"], _eq_43_as_printed),
    AnalysisClaim(
        THESIS["ch2-on-curve"],
        _exact_on_published_curve,
        refuted="As above: on the curve the exact determinant is far from zero.",
    ),
    AnalysisClaim(
        THESIS["ch2-level"],
        lambda: float(normalized_determinant(0.0, 0.0, _HOVER, _VEHICLE)),
        published="0.00",
        refuted="As above; the matrix is best conditioned in level hover.",
    ),
    AnalysisClaim(THESIS["ch2-attitude-altitude"], _attitude_altitude_is_singular, published=False),
    AnalysisClaim(
        THESIS["ch2-position-gains"],
        lambda: _are_stable(GAIN_SETS["ch02"], 4),
        refuted="s⁴ + 10s³ + 20s² + 50s + 500 has roots at 1.30 ± 3.26j: Routh's condition fails.",
    ),
    AnalysisClaim(
        THESIS["ch2-altitude-gains"],
        lambda: _are_stable(quadrotor_attitude_altitude.GAIN_SETS["ch02"], 2),
    ),
    AnalysisClaim(
        THESIS["ch2-no-thrust"],
        lambda: float(normalized_determinant(0.3, 0.2, 0.0, _VEHICLE)) == 0.0,
    ),
    FlightClaim(
        THESIS["ch2-crossing"],
        (_STABLE,),
        _crossing_is_harmful,
        refuted="With stable gains the same control law crosses it on the way to the circle, "
        "and tracks.",
    ),
    FlightClaim(
        THESIS["ch2-cause"],
        (_STABLE,),
        lambda flights: bool(flights[_STABLE]["diverged"]),
        refuted="The cause is the gains: Appendix B's are unstable on their own, and with stable "
        "ones the flight completes from the same start.",
    ),
    AnalysisClaim(
        THESIS["ch2-axes"], partial(_axis_has_no_influence, 1.0, -1.0), case="pitch reversed"
    ),
    AnalysisClaim(
        THESIS["ch2-axes"],
        partial(_axis_has_no_influence, -1.0, 1.0),
        case="roll reversed",
        refuted="S changes by up to 1.0. A quadrotor is mirror-symmetric, so this alone proves S "
        "wrong; the exact determinant does not change.",
        finding="quadrotor",
    ),
    AnalysisClaim(THESIS["ch2-zone-holds-curve"], _zone_holds_the_curve),
    AnalysisClaim(
        THESIS["ch2-choices"],
        lambda: (float(comb(6, 4)), float(comb(6, 3))),
        published=("15", "20"),
    ),
)
