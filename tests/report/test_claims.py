"""The registered claims: their flights exist, their analyses run, and failures give reasons."""

from __future__ import annotations

import math
import random

import pytest

from tiltsim.library import library_entries
from tiltsim.loading import load_scenario
from tiltsim.report.claims import registered_claims
from tiltsim.report.model import (
    AnalysisClaim,
    FlightClaim,
    Outcome,
    judge_value,
    scenario_claims,
)

LIBRARY = {address for address, _, _ in library_entries()}
CLAIMS = registered_claims()
ANALYSES = [claim for claim in CLAIMS if isinstance(claim, AnalysisClaim)]
FLIGHTS = [claim for claim in CLAIMS if isinstance(claim, FlightClaim)]


def named(claim):
    return f"{claim.source}: {claim.statement} {claim.case}"


def test_every_chapter_that_has_results_has_claims():
    flown = {c.chapter for address in LIBRARY for c in scenario_claims(load_scenario(address))}
    assert {claim.chapter for claim in CLAIMS} | flown >= set(range(1, 10)) | {12}


def test_no_claim_stands_twice():
    seen = [(claim.source, claim.statement, claim.case) for claim in CLAIMS]
    assert len(set(seen)) == len(seen)


def test_flights_of_claims_are_in_the_library():
    missing = {address for claim in FLIGHTS for address in claim.flights} - LIBRARY
    assert not missing


@pytest.mark.parametrize("claim", ANALYSES, ids=named)
def test_an_analysis_measures_and_gives_its_reason_where_it_disagrees(claim):
    measured = claim.measure()
    values = measured if isinstance(measured, tuple) else (measured,)
    assert {type(value) for value in values} <= {bool, float}
    assert all(math.isfinite(value) for value in values)
    outcome = judge_value(claim, measured)
    assert outcome is Outcome.REPRODUCED or claim.why
    # A claim that is called wrong and comes out all the same is one of ours that is wrong.
    assert not (claim.wrong and outcome is Outcome.REPRODUCED)


@pytest.mark.parametrize("claim", FLIGHTS, ids=named)
def test_a_comparison_of_flights_can_come_out_either_way(claim):
    outcomes = set()
    for seed in range(1000):
        bad = (0.0, 0.2, 1.0)[seed % 3]
        flights = {address: RandomMetrics(f"{seed} {address}", bad) for address in claim.flights}
        outcomes.add(claim.measure(flights))
        if len(outcomes) > 1:
            return
    pytest.fail(f"always {outcomes}")


class RandomMetrics(dict):
    """A flight with random metrics of all sizes; a share ``bad`` is lost or reverses a rotor."""

    def __init__(self, seed, bad):
        self.random, self.bad = random.Random(seed), bad
        super().__init__(diverged=self._is_bad())

    def _is_bad(self):
        return self.random.random() < self.bad

    def __missing__(self, name):
        value = 10.0 ** self.random.uniform(-3.0, 1.0)
        below = name == "min_published_determinant" or (name.startswith("min") and self._is_bad())
        self[name] = -value if below else value
        return self[name]

    def get(self, name, default=None):
        return self[name]
