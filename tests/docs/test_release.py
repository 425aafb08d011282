"""Facts that a release repeats in several files agree in all."""

from __future__ import annotations

import re
import tomllib

from tests.docs.pages import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
INSTALLATION = (ROOT / "docs" / "installation.md").read_text()
CITATION = (ROOT / "CITATION.cff").read_text()


def test_the_version_equals_the_projects_everywhere():
    heading = re.search(r"^## ([\d.]+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heading[1] == PROJECT["version"]
    assert f"\nversion: {PROJECT['version']}\n" in CITATION
    assert f"\nlicense: {PROJECT['license']}\n" in CITATION


def test_every_extra_is_described():
    table = INSTALLATION.partition("## Extras")[2].partition("```")[0]
    rows = re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
    assert sorted(re.findall(r"`(\w+)`", " ".join(rows))) == sorted(
        PROJECT["optional-dependencies"]
    )


def test_the_pythons_that_it_names_are_those_that_are_tested():
    table = (ROOT / "docs" / "installation.md").read_text()
    tested = re.findall(
        r"3\.\d+", " ".join(re.findall(r"^\| (3\.[^|]*) \| (?!not )", table, re.MULTILINE))
    )
    named = " ".join(PROJECT["classifiers"])
    assert re.findall(r"Python :: (3\.\d+)", named) == tested
    assert PROJECT["requires-python"] == f">={tested[0]}"
