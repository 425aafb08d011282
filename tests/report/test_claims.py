"""The measures of the registry's claims, checked independently."""

from __future__ import annotations

import random

import numpy as np
import pytest

from tiltsim.report.claim import ClaimVerdict, verdict_on
from tiltsim.report.claims import registered_claims, scenario_claims, words
from tiltsim.report.measures.determinant import determinant_coefficients, terms_off
from tiltsim.scenario.library import library_entries
from tiltsim.scenario.loading import load_scenario
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.gaits.cat import SWINGS
from tiltsim_controllers.vehicle.parameters import PRESETS

AR_DRONE = PRESETS["ar_drone_2"]
CLAIMS = registered_claims()
SHARED = words("shared")
ANALYSED = [claim for claim in CLAIMS if claim.measure and not claim.flights]
FLOWN = [claim for claim in CLAIMS if claim.flights]


def test_coefficients_multiply_out_to_the_residuals():
    rng = np.random.default_rng(7)
    angles = rng.uniform(-np.pi, np.pi, (50, 4))
    factors = {"s": np.sin(angles), "c": np.cos(angles)}
    for table, value in zip(determinant_coefficients(), residuals(angles, AR_DRONE), strict=True):
        total = sum(
            coefficient * np.prod([factors[f][:, i] for i, f in enumerate(name)], axis=0)
            for name, coefficient in table.items()
        )
        np.testing.assert_allclose(total, value, atol=1e-9)


def test_chapter_3_prints_two_wrong_terms_of_the_determinant():
    """Eq. (17): 2.880 is printed at scss and sscs, but belongs to sccs and sscc."""
    parts = {"R": "level", "R_phi": "eq_17_roll", "R_theta": "eq_17_pitch"}
    for part, name in parts.items():
        off = terms_off(part, SHARED[name])
        wrong = {product for product, value in off.items() if abs(value) > 1e-3}
        assert wrong == ({"scss", "sccs", "sscs", "sscc"} if part == "R_phi" else set())


def test_one_pair_of_chapter_3_can_switch_without_a_crossing():
    """Ch. 3, Sec. 5.2: from (1, 1) to (-1, -1) with alpha_1 = -alpha_3 = 1.4, and back."""
    way = np.linspace(1.0, -1.0, 2001)
    for alpha_1, crosses in ((1.4, False), (-1.4, False), (0.7, True), (0.0, True)):
        angles = np.stack([0 * way + alpha_1, way, 0 * way - alpha_1, way], axis=-1)
        assert bool((residuals(angles, AR_DRONE).R < 0.0).any()) is crosses


@pytest.mark.parametrize("claim", ANALYSED, ids=lambda claim: claim.id)
def test_computed_claims_have_verdicts_and_reasons(claim):
    verdict = verdict_on(claim, claim.measured())
    if verdict is ClaimVerdict.NOT_REPRODUCED:
        assert claim.why
    if claim.fault:
        assert verdict.name == claim.fault.upper(), "it agrees after all"


def test_flights_of_claims_are_in_the_library():
    library = {address for address, _, _ in library_entries()}
    for claim in CLAIMS:
        assert set(claim.flights) <= library, claim.id


@pytest.mark.slow
def test_chapter_5_is_flown_with_the_swings_that_its_claims_use(scenarios):
    flown = [scenario for scenario in scenarios if "ch05" in scenario.address]
    assert {scenario.gait.type for scenario in flown} == set(SWINGS)
    for scenario in flown:
        gait = scenario.gait
        assert (gait.lean, gait.amplitude) == SWINGS[gait.type], scenario.address


def test_nothing_that_rests_on_our_keyframes_counts_as_reproduced():
    """Ch. 5's keyframes were chosen so that its statements hold."""
    fitted = {claim.id for claim in CLAIMS if claim.chapter == 5 and claim.is_fit}
    flown = {claim.id for claim in FLOWN if claim.chapter == 5}
    assert flown <= fitted
    walk = load_scenario("ch05_gaits/line#walk_third_t1_modified")
    assert "keyframes" in walk.ours
    [claim] = scenario_claims(walk)
    for measured in (0.185, 0.195, 0.24):
        assert verdict_on(claim, measured) is ClaimVerdict.FITTED
    assert verdict_on(claim, 0.3) is ClaimVerdict.NOT_TESTABLE


def test_every_chapter_has_claims(scenarios):
    chapters = {claim.chapter for scenario in scenarios for claim in scenario_claims(scenario)}
    assert chapters | {claim.chapter for claim in CLAIMS} >= {*range(1, 13)}


@pytest.mark.parametrize("claim", FLOWN, ids=lambda claim: claim.id)
def test_a_comparison_of_flights_can_come_out_either_way(claim):
    verdicts = set()
    for seed in range(1000):
        bad = (0.0, 0.2, 1.0)[seed % 3]
        flights = [RandomMetrics(f"{seed} {address}", bad) for address in claim.flights]
        verdicts.add(claim.measured(flights))
        if len(verdicts) > 1:
            return
    pytest.fail(f"always {verdicts}")


@pytest.mark.parametrize(("planned", "holds"), [(0.0, True), (0.1, True), (6.0, False)])
def test_a_gait_at_rest_is_infinitely_slower(planned, holds):
    [claim] = (claim for claim in FLOWN if claim.id == "ch1-planned-gaits")
    assert claim.measured([{"max_tilt_rate": 60.0}, {"max_tilt_rate": planned}]) is holds
    assert claim.measured([{"max_tilt_rate": 0.0}, {"max_tilt_rate": 0.0}]) is False


class RandomMetrics(dict):
    """A flight with random metrics of all sizes; a fraction ``bad`` diverges or stops a rotor."""

    def __init__(self, seed, bad):
        self.random, self.bad = random.Random(seed), bad
        super().__init__(diverged=self._is_bad())

    def _is_bad(self):
        return self.random.random() < self.bad

    def __missing__(self, name):
        # A rotor may rest and nothing saturate; other metrics are never exactly zero.
        can_be_zero = name in {"min_rotor_speed", "saturated_fraction"}
        zero = can_be_zero and self._is_bad()
        largest = 4.0 if name == "final_input_split" else 1.0  # a difference of squares
        value = 0.0 if zero else 10.0 ** self.random.uniform(-3.0, largest)
        below = name == "min_published_determinant" or (name.startswith("min") and self._is_bad())
        self[name] = -value if below else value
        return self[name]

    def get(self, name, default=None):
        return self[name]
