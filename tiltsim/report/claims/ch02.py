"""Chapter 2: yaw-position control of the quadrotor and its alleged singular zone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.draft import draft
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


def _signs_of_axes_matter() -> bool:
    """Whether reversing the body axes changes where S or the exact determinant vanish."""
    angles = np.linspace(-1.5, 1.5, 61)
    roll, pitch = np.meshgrid(angles, angles)
    published = published_determinant(roll, pitch) - published_determinant(roll, -pitch)
    exact = normalized_determinant(roll, pitch, _HOVER, _VEHICLE)
    return bool(
        np.abs(published).max() > _SINGULAR
        or np.abs(exact - normalized_determinant(-roll, -pitch, _HOVER, _VEHICLE)).max() > _SINGULAR
    )


def _crossing_is_harmful(flights: Mapping[str, Metrics]) -> bool:
    """Whether the flight that crosses S = 0 with stable gains diverges there."""
    metrics = flights[_STABLE]
    crossed = metrics["min_published_determinant"] < 0.0 < metrics["max_published_determinant"]
    return bool(metrics["diverged"]) or not crossed


CLAIMS = (
    AnalysisClaim(
        draft(
            "ch. 2, Sec. 3, Eqs. (21), (44)",
            "Yaw-position control has singular attitudes within 90 degrees of roll and pitch",
        ),
        _zero_inside,
        refuted=_ONE_ENTRY,
    ),
    AnalysisClaim(
        draft(
            "ch. 2, Sec. 3, Eqs. (43)-(44)", "S(θ, φ) is the determinant of the matrix in Eq. (43)"
        ),
        _eq_43_as_printed,
    ),
    AnalysisClaim(
        draft(
            "ch. 2, Sec. 4, Fig. 3", "On the curve S(θ, φ) = 0 the decoupling matrix is singular"
        ),
        _exact_on_published_curve,
        refuted="As above: on the curve the exact determinant is far from zero.",
    ),
    AnalysisClaim(
        draft(
            "ch. 2, Sec. 4, Fig. 3",
            "At level attitude the determinant is zero (here over its value in hover)",
        ),
        lambda: float(normalized_determinant(0.0, 0.0, _HOVER, _VEHICLE)),
        published="0.00",
        refuted="As above; the matrix is best conditioned in level hover.",
    ),
    AnalysisClaim(
        draft(
            "ch. 2, Sec. 5", "Attitude-altitude control has singular attitudes within 90 degrees"
        ),
        _attitude_altitude_is_singular,
        published=False,
    ),
    AnalysisClaim(
        draft(
            "ch. 2, App. B, Eqs. (A3)-(A6)",
            "The gains of the yaw-position controller stabilize the linearized system",
        ),
        lambda: _are_stable(GAIN_SETS["ch02"], 4),
        refuted="s⁴ + 10s³ + 20s² + 50s + 500 has roots at 1.30 ± 3.26j: Routh's condition fails.",
    ),
    AnalysisClaim(
        draft(
            "ch. 2, App. B, Eqs. (A8)-(A9)",
            "The gains of the attitude-altitude controller stabilize the linearized system",
        ),
        lambda: _are_stable(quadrotor_attitude_altitude.GAIN_SETS["ch02"], 2),
    ),
    AnalysisClaim(
        draft("ch. 2, Sec. 3.2", "Without thrust the yaw-position matrix is singular"),
        lambda: float(normalized_determinant(0.3, 0.2, 0.0, _VEHICLE)) == 0.0,
    ),
    FlightClaim(
        draft("ch. 2, Sec. 4", "Crossing the curve S = 0 makes the control law fail"),
        (_STABLE,),
        _crossing_is_harmful,
        refuted="With stable gains the same control law crosses it on the way to the circle, "
        "and tracks.",
    ),
    FlightClaim(
        draft("ch. 2, Sec. 6", "The singular matrix is why the yaw-position controller fails"),
        (_STABLE,),
        lambda flights: bool(flights[_STABLE]["diverged"]),
        refuted="The cause is the gains: Appendix B's are unstable on their own, and with stable "
        "ones the flight completes from the same start.",
    ),
    AnalysisClaim(
        draft(
            "ch. 2, Sec. 4", "The direction of the body-fixed axes has no influence on the result"
        ),
        lambda: not _signs_of_axes_matter(),
    ),
    AnalysisClaim(
        draft("ch. 2, Sec. 6", "Choices of four outputs out of six, and of three"),
        lambda: (float(comb(6, 4)), float(comb(6, 3))),
        published=("15", "20"),
    ),
)
