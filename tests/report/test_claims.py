"""What the claims of the registry measure, checked from another side."""

from __future__ import annotations

import numpy as np
import pytest

from controllers.singularity import residuals
from controllers.vehicle import PRESETS
from tiltsim.library import library_entries
from tiltsim.report.claims import registered_claims
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.measures import determinant_coefficients
from tiltsim.report.model import AnalysisClaim, FlightClaim, Outcome, judge_value, plain

AR_DRONE = PRESETS["ar_drone_2"]
CLAIMS = registered_claims()
ANALYSED = [claim for claim in CLAIMS if isinstance(claim, AnalysisClaim)]


def test_coefficients_multiply_out_to_the_residuals():
    rng = np.random.default_rng(7)
    angles = rng.uniform(-np.pi, np.pi, (50, 4))
    factors = {"s": np.sin(angles), "c": np.cos(angles)}
    for table, value in zip(
        determinant_coefficients(AR_DRONE), residuals(angles, AR_DRONE), strict=True
    ):
        total = sum(
            coefficient * np.prod([factors[f][:, i] for i, f in enumerate(name)], axis=0)
            for name, coefficient in table.items()
        )
        np.testing.assert_allclose(total, value, atol=1e-9)


def test_chapter_3_prints_two_wrong_terms_of_the_determinant():
    """Eq. (17): 2.880 stands at scss and sscs, and belongs to sccs and sscc."""
    computed = determinant_coefficients(AR_DRONE)
    for part, (printed, exact) in enumerate(zip(EQ_17, computed, strict=True)):
        wrong = {n for n in exact if abs(exact[n] - printed.get(n, 0.0)) > 1e-3}
        assert wrong == ({"scss", "sccs", "sscs", "sscc"} if part == 1 else set())
    assert EQ_17.R is EQ_19


def test_one_pair_of_chapter_3_can_switch_without_a_crossing():
    """Ch. 3, Sec. 5.2: from (1, 1) to (-1, -1) with alpha_1 = -alpha_3 = 1.4, and back."""
    way = np.linspace(1.0, -1.0, 2001)
    for alpha_1, crosses in ((1.4, False), (-1.4, False), (0.7, True), (0.0, True)):
        angles = np.stack([0 * way + alpha_1, way, 0 * way - alpha_1, way], axis=-1)
        assert bool((residuals(angles, AR_DRONE).R < 0.0).any()) is crosses


@pytest.mark.parametrize("claim", ANALYSED, ids=lambda claim: f"{claim.chapter}-{claim.key}"[:80])
def test_what_is_computed_is_judged_and_explained(claim):
    outcome = judge_value(claim, plain(claim.measure()))
    if outcome is Outcome.NOT_REPRODUCED:
        assert claim.why
    if claim.wrong:
        assert outcome is Outcome.WRONG, "it agrees after all"


def test_flights_of_claims_are_in_the_library():
    library = {address for address, _, _ in library_entries()}
    for claim in CLAIMS:
        if isinstance(claim, FlightClaim):
            assert set(claim.flights) <= library, claim.statement
