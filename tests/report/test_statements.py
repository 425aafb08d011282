"""Every row of the library: its text, its criterion and its id."""

from __future__ import annotations

import re
import tomllib
from collections import defaultdict
from pathlib import Path

import pytest

import tiltsim.report.claims as claim_modules
from tiltsim.report.claim import ID
from tiltsim.report.claims import registered_claims, scenario_claims
from tiltsim.report.findings import FINDINGS
from tiltsim.report.pictures import PICTURES
from tiltsim.scenario.metric_names import METRICS

NAMES = "|".join([*METRICS, *(name.replace("_", " ") for name in METRICS)])
RAW = re.compile(rf"\b(?:{NAMES})\b", re.I)
PLAIN_WORDS = {"duration", "switches", "diverged"}


@pytest.fixture(scope="module")
def rows(scenarios):
    """All claims of the library by id; the same expectation on another plant is the same row."""
    found = defaultdict(list)
    for claim in registered_claims():
        found[claim.id].append(claim)
    for scenario in scenarios:
        for claim in scenario_claims(scenario):
            found[claim.id].append(claim)
    return found


@pytest.fixture(scope="module")
def statements(rows):
    found = defaultdict(list)
    for claims in rows.values():
        found[claims[0].statement.id].append(claims[0])
    return found


def test_ids_are_unique(rows):
    for name, claims in rows.items():
        plants = [c.expectation.plant for c in claims if c.expectation]
        assert ID.fullmatch(name), name
        assert len(claims) == 1 or sorted(map(str, plants)) == ["mujoco", "thesis"], name


def test_the_rows_of_a_statement_share_its_words_and_criterion(statements):
    for claims in statements.values():
        statement = claims[0].statement
        assert {(c.statement.text, c.statement.criterion) for c in claims} == {
            (statement.text, statement.criterion)
        }, statement.id


def test_labels_are_words(statements):
    for name, claims in statements.items():
        labels = [claim.case for claim in claims]
        assert len(claims) == 1 or (all(labels) and len(set(labels)) == len(labels)), name
        for text in [claims[0].statement.text, *labels]:
            raw = {found.lower() for found in RAW.findall(text)} - PLAIN_WORDS
            assert not raw, f"{name}: {raw}"
            assert "()" not in text, name


def test_the_library_words_its_claims_in_tables(scenarios):
    for scenario in scenarios:
        for claim in scenario_claims(scenario):
            expectation = claim.expectation
            assert expectation.claim in scenario.claim, f"{claim.id}: write a [claim.NAME] table"
            if expectation.equals is None and isinstance(claim.published, bool):
                assert expectation.holds, f"{claim.id}: say where the statement is true: holds"


def test_statements_name_findings_and_pictures_that_exist(rows):
    findings = {finding.key for finding in FINDINGS}
    pictures = {picture.name for picture in PICTURES}
    for name, claims in rows.items():
        assert claims[0].settled_by in {"", *findings}, name
        assert set(claims[0].statement.pictures) <= pictures, name


def test_every_statement_of_the_chapters_has_a_row():
    folder = Path(claim_modules.__file__).parent
    stated = {
        name
        for file in folder.glob("ch*.toml")
        for name in tomllib.loads(file.read_text(encoding="utf-8"))
    }
    used = {claim.statement.id for claim in registered_claims()}
    assert stated - {"shared"} == used
