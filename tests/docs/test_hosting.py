"""Workflow, issue forms and pre-commit hooks agree with the project."""

from __future__ import annotations

import re
import tomllib

import pytest

from tests.docs.pages import ROOT
from tests.docs.test_code_blocks import CHECKS
from tiltsim.cli import build_parser

yaml = pytest.importorskip("yaml")

JOBS = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())["jobs"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("[!c]*.yml"))


def scripts():
    return [step["run"] for job in JOBS.values() for step in job["steps"] if "run" in step]


def test_every_supported_python_is_tested_and_the_next_one_tried():
    named = re.findall(r"Python :: (3\.\d+)", " ".join(PROJECT["classifiers"]))
    *tested, next_one = JOBS["test"]["strategy"]["matrix"]["python"]
    assert tested == named
    assert f"'{next_one}'" in JOBS["test"]["continue-on-error"]
    assert int(next_one[2:]) == int(named[-1][2:]) + 1


def test_the_steps_install_extras_that_exist():
    for script in scripts():
        for line in re.findall(r"pip install (.*)", script):
            CHECKS["pip"](["install", line.replace("'", "")])


def test_the_steps_call_commands_that_exist():
    lines = [line for s in scripts() for line in re.findall(r"bin/tiltsim (.+)", s)]
    assert len(lines) == 2
    for line in lines:
        build_parser().parse_args(line.split())


def test_pre_commit_lints_with_the_pinned_version():
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    pinned = re.search(r"^ruff==(.+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE)[1]
    (ruff,) = [repo for repo in hooks if "ruff" in repo["repo"]]
    assert ruff["rev"] == f"v{pinned}"


def test_issue_forms_require_an_answer():
    assert len(FORMS) == 2
    for form in FORMS:
        body = yaml.safe_load(form.read_text())["body"]
        assert any(field.get("validations", {}).get("required") for field in body), form.name
        assert all(field["attributes"]["label"] for field in body), form.name
