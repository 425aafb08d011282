"""Findings: every test that is named exists, and every number is computed."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tiltsim.report.findings import FINDINGS
from tiltsim.report.pictures import PICTURES
from tiltsim.resources import shipped_folder
from tiltsim.scenario.library import library_entries

ROOT = Path(__file__).parents[2]
SCENARIOS = shipped_folder("scenarios")


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.key)
def test_the_tests_behind_a_finding_exist(finding):
    assert finding.nodes
    for node in finding.nodes:
        file, _, name = node.partition("::")
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert name in {n.name for n in tree.body if isinstance(n, ast.FunctionDef)}, node
        assert node in finding.command


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.key)
def test_the_numbers_of_a_finding_are_computed(finding):
    assert not re.search(r"[{}]", " ".join(finding.paragraphs))


def test_flights_and_pictures_of_findings_exist():
    library = {address for address, _, _ in library_entries()}
    pictures = {picture.name for picture in PICTURES}
    for finding in FINDINGS:
        assert finding.proof, finding.key
        assert set(finding.flights) <= library, finding.key
        assert set(finding.pictures) <= pictures, finding.key
        assert not finding.sweep or (SCENARIOS / f"{finding.sweep}.toml").is_file(), finding.key
        if "by flights" in finding.proof:
            assert finding.flights, finding.key


def test_keys_are_unique():
    keys = [finding.key for finding in FINDINGS]
    assert len(set(keys)) == len(keys)
