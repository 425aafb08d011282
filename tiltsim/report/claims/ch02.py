"""Chapter 2: yaw-position control of the quadrotor and its alleged singular zone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import comb
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.statement import Statement
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


_SURFACE: Final = ("singular-surface",)

ZONE = Statement(
    id="ch2-singular-zone",
    source="ch. 2, Sec. 3, Eqs. (21), (44)",
    text="Yaw-position control has singular attitudes within 90 degrees of roll and pitch",
    thesis="“… there exists a singular region within the space of interest, φ ∈ (−π/2, π/2), "
    "θ ∈ (−π/2, π/2).”",
    criterion="The exact determinant vanishes or changes sign at an attitude of a fine grid within "
    "90 degrees",
    finding="quadrotor",
    pictures=_SURFACE,
)
SURFACE = Statement(
    id="ch2-surface",
    source="ch. 2, Sec. 3, Eqs. (43)-(44)",
    text="S(θ, φ) is the determinant of the matrix in Eq. (43)",
    thesis="“|P · Δ · Q| = -1 + cos² θ cos² φ - cos² θ cos φ sin φ” (Eq. 44).",
    criterion="The determinant of the matrix as printed equals S to 1e-12 at 200 random attitudes",
)
ON_CURVE = Statement(
    id="ch2-on-curve",
    source="ch. 2, Sec. 4, Fig. 3",
    text="On the curve S(θ, φ) = 0 the decoupling matrix is singular",
    thesis="“Figure 3 plots the singular curve, given S(θ, φ) = 0, where the attitudes on the "
    "curve introduce the singular decoupling matrix.”",
    criterion="The exact determinant, over its value in hover, is below 1e-9 somewhere on the "
    "curve",
    finding="quadrotor",
    pictures=_SURFACE,
)
LEVEL = Statement(
    id="ch2-level",
    source="ch. 2, Sec. 4, Fig. 3",
    text="At level attitude the determinant is zero (here over its value in hover)",
    thesis="“… we can find in Figure 3 that (θ, φ) = (0,0) is on the singular curve, while the "
    "quadrotor is near this state during most flights.”",
    criterion="The exact determinant at level attitude, over its value in hover, is 0.00",
    finding="quadrotor",
    pictures=_SURFACE,
)
ATTITUDE_ALTITUDE = Statement(
    id="ch2-attitude-altitude",
    source="ch. 2, Sec. 5",
    text="Attitude-altitude control has singular attitudes within 90 degrees",
    thesis="“… attitude–altitude output-based (ϕ, θ, ψ, z) feedback linearization does not.”",
    criterion="The determinant of the matrix from thrust and torques to the four accelerations is "
    "below 1e-9 nowhere on a grid up to 1.55 rad",
)
POSITION_GAINS = Statement(
    id="ch2-position-gains",
    source="ch. 2, App. B, Eqs. (A3)-(A6)",
    text="The gains of the yaw-position controller stabilize the linearized system",
    thesis="“The stability proof for linear systems applies here. It can be found if one "
    "substitutes (A1)–(A6) into Equation (20).”",
    criterion="All roots of s⁴ + k₁s³ + k₂s² + k₃s + k₄, and of the yaw loop, have negative real "
    "parts",
    finding="quadrotor",
)
ALTITUDE_GAINS = Statement(
    id="ch2-altitude-gains",
    source="ch. 2, App. B, Eqs. (A8)-(A9)",
    text="The gains of the attitude-altitude controller stabilize the linearized system",
    thesis="“PD controllers also work with slight changes (lower order).”",
    criterion="All roots of s² + 10s + 10 have negative real parts",
)
NO_THRUST = Statement(
    id="ch2-no-thrust",
    source="ch. 2, Sec. 3.1",
    text="Without thrust the yaw-position matrix is singular",
    thesis="The condition for an invertible matrix requires “ζ ≠ 0”.",
    criterion="The exact determinant is 0 at zero thrust",
)
CROSSING = Statement(
    id="ch2-crossing",
    source="ch. 2, Sec. 4",
    text="Crossing the curve S = 0 makes the control law fail",
    thesis="“Crossing the 'circular' area is strictly prohibited, since it causes the "
    "noninvertible problem in the decoupling matrix.”",
    criterion="A flight with stable gains, in which S changes its sign, is lost",
    finding="quadrotor",
    pictures=("through-the-curve",),
)
CAUSE = Statement(
    id="ch2-cause",
    source="ch. 2, Sec. 6",
    text="The singular matrix is why the yaw-position controller fails",
    thesis="“… the relevant controller risks encountering the singular decoupling matrix that "
    "causes the failure in controlling.”",
    criterion="The same flight is lost with gains that satisfy Routh's condition, too",
    finding="quadrotor",
    pictures=("through-the-curve",),
)
AXES = Statement(
    id="ch2-axes",
    source="ch. 2, Sec. 4",
    text="The direction of the body-fixed axes has no influence on the result",
    thesis="“… this result is not influenced by changing the definition of the positive direction "
    "of the body-fixed frame.”",
    criterion="With the axis reversed, S and the exact determinant are the same at every attitude "
    "of a grid, to 1e-9",
)
ELIMINATED = Statement(
    id="ch2-zone-holds-curve",
    source="ch. 2, Sec. 5, Eq. (47), Fig. 5",
    text="The zone of the attitude-altitude controller contains the whole curve S = 0",
    thesis="“Based on this, the singular curve in Figure 4 is eliminated in the entire attitude "
    "area.”",
    criterion="Every point of the curve has |θ| <= 0.5 and -π/2 <= φ <= 0.2",
)
CHOICES = Statement(
    id="ch2-choices",
    source="ch. 2, Sec. 6",
    text="Choices of four outputs out of six, and of three",
    thesis="“… there are 15 (C_6^4) combinations in total if we pick four outputs”; “20 (C_6^3) "
    "cases” of three.",
    criterion="Both binomial coefficients are as printed",
)

CLAIMS = (
    AnalysisClaim(ZONE, _zero_inside, refuted=_ONE_ENTRY),
    AnalysisClaim(SURFACE, _eq_43_as_printed),
    AnalysisClaim(
        ON_CURVE,
        _exact_on_published_curve,
        refuted="As above: on the curve the exact determinant is far from zero.",
    ),
    AnalysisClaim(
        LEVEL,
        lambda: float(normalized_determinant(0.0, 0.0, _HOVER, _VEHICLE)),
        published="0.00",
        refuted="As above; the matrix is best conditioned in level hover.",
    ),
    AnalysisClaim(ATTITUDE_ALTITUDE, _attitude_altitude_is_singular, published=False),
    AnalysisClaim(
        POSITION_GAINS,
        lambda: _are_stable(GAIN_SETS["ch02"], 4),
        refuted="s⁴ + 10s³ + 20s² + 50s + 500 has roots at 1.30 ± 3.26j: Routh's condition fails.",
    ),
    AnalysisClaim(
        ALTITUDE_GAINS, lambda: _are_stable(quadrotor_attitude_altitude.GAIN_SETS["ch02"], 2)
    ),
    AnalysisClaim(NO_THRUST, lambda: float(normalized_determinant(0.3, 0.2, 0.0, _VEHICLE)) == 0.0),
    FlightClaim(
        CROSSING,
        (_STABLE,),
        _crossing_is_harmful,
        refuted="With stable gains the same control law crosses it on the way to the circle, "
        "and tracks.",
    ),
    FlightClaim(
        CAUSE,
        (_STABLE,),
        lambda flights: bool(flights[_STABLE]["diverged"]),
        refuted="The cause is the gains: Appendix B's are unstable on their own, and with stable "
        "ones the flight completes from the same start.",
    ),
    AnalysisClaim(AXES, partial(_axis_has_no_influence, 1.0, -1.0), case="pitch reversed"),
    AnalysisClaim(
        AXES,
        partial(_axis_has_no_influence, -1.0, 1.0),
        case="roll reversed",
        refuted="S changes by up to 1.0. A quadrotor is mirror-symmetric, so this alone proves S "
        "wrong; the exact determinant does not change.",
        finding="quadrotor",
    ),
    AnalysisClaim(ELIMINATED, _zone_holds_the_curve),
    AnalysisClaim(CHOICES, lambda: (float(comb(6, 4)), float(comb(6, 3))), published=("15", "20")),
)
