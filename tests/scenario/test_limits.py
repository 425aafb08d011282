"""Input that is nested too deep, too long or too large is refused in one line, before any work."""

from __future__ import annotations

from typing import Annotated

import pytest
from pydantic import TypeAdapter

import tiltsim
from tiltsim.errors import InputError
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.documents import parse_override, split_key
from tiltsim.scenario.library import MAX_FILE_SIZE, MAX_VALUES, read_toml
from tiltsim.scenario.loading import load_scenario
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.expressions import evaluate

SETPOINT = "ch04_tracking/setpoint#rho_0_modified"


def nested(depth):
    value = 1.0
    for _ in range(depth):
        value = {"a": value}
    return value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"[{'.'.join(['a'] * 2000)}]\nx = 1", "nest more than 64 deep"),
        (f"title = 0x{'F' * 20_000}", "more than 64 bits"),
        (f"title = {'9' * 5_000}", "not valid TOML"),
        (f"gait = {'[' * 5_000}", "not valid TOML"),
        (f"a = [{'0,' * MAX_VALUES}]", "more than 200000 values"),
        ("#" * (MAX_FILE_SIZE + 1), "bytes; at most"),
    ],
)
def test_files_beyond_the_limits(text, words, tmp_path):
    file = tmp_path / "a.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        read_toml(file)


@pytest.mark.parametrize("depth", [65, 900, 5_000])
def test_documents_given_in_python(depth):
    with pytest.raises(InputError, match="nest more than 64 deep"):
        tiltsim.parse_scenario(nested(depth))


@pytest.mark.parametrize("override", [f"title={'[' * 20_000}", f"title={'[' * 70}{']' * 70}"])
def test_values_of_overrides(override):
    with pytest.raises(InputError, match=r"--set title: .* deep"):
        parse_override(override)


def test_keys_of_overrides():
    with pytest.raises(InputError, match="more than 64 names and positions"):
        load_scenario(SETPOINT, {".".join(["a"] * 2000): 1})
    for position in ("9" * 4_400, "٣", "-1"):
        with pytest.raises(InputError, match="entries of lists count from 0"):
            split_key(f"gait.angles[{position}]")


def test_expressions():
    assert evaluate("+".join(["m"] * 150), {"m": 1.0}) == 150.0
    with pytest.raises(ValueError, match="nests more than 200 deep"):
        evaluate("+".join(["m"] * 980), {"m": 1.0})


def test_definitions_of_sweeps():
    with pytest.raises(ValueError, match="keys are missing or unknown"):
        SweepDefinition.from_json('{"a":' * 900 + "1" + "}" * 900)


@pytest.mark.parametrize("law", CONTROLLERS)
def test_defaults_are_values_that_keys_allow(law):
    """Tables take defaults unchecked."""
    for field in CONTROLLERS[law].model_fields.values():
        if not field.is_required():
            kind = Annotated[(field.annotation, *field.metadata)] if field.metadata else None
            TypeAdapter(kind or field.annotation).validate_python(field.default)
