"""Chapter 11: the penguin swing, its saturation, and the bound on the Lyapunov candidate."""

from __future__ import annotations

from math import pi
from typing import Final

from tiltsim.report import penguin_proof as proof
from tiltsim.report.claim import AnalysisClaim, FlightClaim
from tiltsim.report.statement import read_statements

_LARGE: Final = "ch11_penguin/straight_line#large"


THESIS: Final = read_statements("ch11")

CLAIMS = (
    AnalysisClaim(
        THESIS["ch11-zero-acceleration"],
        lambda: proof.can_push_straight_ahead(pi / 8),
        case="small swing, π/8",
    ),
    AnalysisClaim(
        THESIS["ch11-zero-acceleration"],
        lambda: proof.can_push_straight_ahead(pi / 3),
        case="large swing, π/3",
        published=False,
    ),
    AnalysisClaim(THESIS["ch11-lemma-1"], proof.switch_matrix_is_the_limit),
    AnalysisClaim(THESIS["ch11-lemma-2"], proof.eq_27_holds),
    AnalysisClaim(THESIS["ch11-switch-line"], proof.switch_line, published="0.57735", unit="m/s^2"),
    AnalysisClaim(THESIS["ch11-eq-42"], lambda: proof.for_all(proof.eq_42_holds)),
    AnalysisClaim(THESIS["ch11-eq-43"], lambda: proof.for_all(proof.eq_43_holds)),
    AnalysisClaim(
        THESIS["ch11-printed-times"], lambda: proof.for_all(proof.eq_44_holds), case="Eq. (44)"
    ),
    AnalysisClaim(
        THESIS["ch11-printed-times"], lambda: proof.for_all(proof.eq_47_holds), case="Eq. (47)"
    ),
    AnalysisClaim(THESIS["ch11-stops-within-1-s"], lambda: proof.for_all(proof.switches_within)),
    AnalysisClaim(THESIS["ch11-mirror-zone"], lambda: proof.for_all(proof.comes_back_mirrored)),
    AnalysisClaim(THESIS["ch11-first-half"], proof.first_half_period),
    AnalysisClaim(THESIS["ch11-printed-slopes"], lambda: proof.slope_matches(1.0), case="Eq. (61)"),
    AnalysisClaim(
        THESIS["ch11-printed-slopes"], lambda: proof.slope_matches(-1.0), case="Eq. (67)"
    ),
    AnalysisClaim(
        THESIS["ch11-eq-66"],
        proof.eq_66_holds,
        refuted="A misprint: it must be ė_m, as in its mirror image, Eq. (60).",
    ),
    AnalysisClaim(THESIS["ch11-largest-at-ends"], lambda: proof.for_all(proof.largest_at_the_ends)),
    AnalysisClaim(
        THESIS["ch11-growth"], lambda: proof.bound().largest_gain, published="0.75", unit="m^2/s^2"
    ),
    AnalysisClaim(
        THESIS["ch11-growth-in-zone"], lambda: proof.for_all(proof.grows_by_three_quarters_at_most)
    ),
    AnalysisClaim(
        THESIS["ch11-eq-72"],
        proof.eq_72_holds,
        refuted="The sign is reversed: by Eq. (70) a negative ΔL(i) means that the candidate at "
        "(i+1) T/2 is the smaller one. The proof needs and uses that.",
    ),
    AnalysisClaim(THESIS["ch11-asymptotic"], proof.is_asymptotically_stable, published=False),
    AnalysisClaim(THESIS["ch11-bounded"], proof.limit_cycle_is_stable),
    AnalysisClaim(THESIS["ch11-input-period"], proof.inputs_repeat_after_a_period),
    FlightClaim(
        THESIS["ch11-proposition-7"],
        (_LARGE,),
        lambda flights: float(flights[_LARGE]["max_lyapunov"]) <= proof.bound().published,
    ),
)
