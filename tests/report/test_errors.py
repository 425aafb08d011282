"""The list of errors: every entry has a proof that fails if the printed formula were right."""

from __future__ import annotations

import re
import tomllib
from collections import defaultdict

import pytest

from tests.docs.pages import ROOT
from tiltsim.report.claims import registered_claims, scenario_claims
from tiltsim.report.findings import ERRORS
from tiltsim.report.measures.slips import RIGHT, deviation

NAMED = defaultdict(list)
for claim in registered_claims():
    NAMED[claim.error].append(claim)
del NAMED[""]


@pytest.mark.parametrize("key", ERRORS)
def test_the_printed_formula_is_wrong_and_the_mended_one_right(key):
    assert deviation(key, mended=False) > 1e4 * RIGHT
    assert deviation(key, mended=True) < RIGHT


def test_every_row_that_is_refuted_or_a_misprint_has_an_entry_and_every_entry_a_row(scenarios):
    assert NAMED.keys() == ERRORS.keys()
    assert not any(claim.fault for one in scenarios for claim in scenario_claims(one))


def test_the_most_consequential_error_comes_first():
    assert next(iter(ERRORS)) == "speed-factor"
    assert "Eq. (12)" in ERRORS["speed-factor"].place


def test_a_rounding_artifact_has_a_row_that_tests_it_as_published():
    rows = defaultdict(list)
    for claim in registered_claims():
        rows[claim.statement.id].append(claim)
    for claims in rows.values():
        faults = [claim.case for claim in claims if claim.fault == "rounding"]
        printed = [claim.case for claim in claims if re.search("published|printed", claim.case)]
        assert len(printed) >= len(faults), claims[0].statement.id


def test_withdrawn_ids_have_a_reason_and_no_row(scenarios):
    file = ROOT / "tiltsim" / "report" / "withdrawn.toml"
    withdrawn = tomllib.loads(file.read_text(encoding="utf-8"))
    claims = [*registered_claims(), *(c for one in scenarios for c in scenario_claims(one))]
    present = {name for claim in claims for name in (claim.id, claim.statement.id)}
    assert withdrawn
    assert not present & withdrawn.keys()
    assert all(reason.endswith(".") for reason in withdrawn.values())


def test_the_page_of_errors_has_every_entry():
    page = (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")
    titles = [f"## {number}. {one.title}" for number, one in enumerate(ERRORS.values(), start=1)]
    assert re.findall(r"^## \d+\. .*$", page, re.MULTILINE) == titles
    assert f", {len(ERRORS)} in all, each named" in page
    for claims in NAMED.values():
        assert all(f"`{claim.id}`" in page for claim in claims)
