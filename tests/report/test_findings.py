"""Findings: every test that is named exists, and every number is computed."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tiltsim.report.findings import FINDINGS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.key)
def test_the_tests_behind_a_finding_exist(finding):
    assert finding.nodes
    for node in finding.nodes:
        file, _, name = node.partition("::")
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert name in {n.name for n in tree.body if isinstance(n, ast.FunctionDef)}, node
        assert node in finding.command


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.key)
def test_the_numbers_of_a_finding_are_computed_and_all_used(finding):
    template = " ".join(finding.text)
    names = set(re.findall(r"{(\w+)}", template))
    assert set(finding.numbers()) == names
    assert not re.search(r"[{}]", " ".join(finding.paragraphs))


def test_keys_are_unique():
    keys = [finding.key for finding in FINDINGS]
    assert len(set(keys)) == len(keys)
