"""The numbers of ours in criteria: each has a reason, is used, and can change a verdict."""

from __future__ import annotations

import pytest

from tiltsim.report.claim import ClaimVerdict
from tiltsim.report.claim_rows import criteria, row_of
from tiltsim.report.claims import registered_claims, words


def rows_using(name):
    claims = [claim for claim in registered_claims() if name in claim.thresholds]
    return [row_of(one, {}, one.measured()) for one in claims if not one.flights]


@pytest.mark.parametrize("name", words("thresholds"))
def test_a_threshold_has_a_reason_and_is_used(name):
    assert words("thresholds")[name]["reason"].endswith(".")
    assert any(name in claim.thresholds for claim in registered_claims())


def test_a_verdict_that_hangs_on_a_number_is_counted():
    """Ch. 8's biased Gait 2 has a margin above 1 rad; 2 rad are beyond any margin."""
    [row] = rows_using("abundant")
    assert row.verdict is ClaimVerdict.REPRODUCED
    found = {one.name: one for one in criteria([row], {})}
    assert (found["abundant"].rows, found["abundant"].changed) == (1, (0, 1))
    assert (found["moved"].rows, found["moved"].changed) == (0, (0, 0))


def test_a_scaled_threshold_leaves_the_others_alone():
    before = {claim.id: claim for claim in registered_claims()}
    for claim in registered_claims("moved", 1e6):
        if not claim.flights and claim.thresholds == ("moved",):
            assert claim.measured() is False
            assert before[claim.id].measured() is True
