"""The way through the JSON Schema that messages, units and the page of all keys share."""

from __future__ import annotations

import pytest

import tiltsim
from tiltsim.errors import InputError
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.schema import schema_of, share_keys
from tiltsim.scenario.table import Table
from tiltsim.sweeps.tables import Sweep


@pytest.mark.parametrize(
    ("location", "unit"),
    [
        (("gait", "walk", "amplitude"), "rad"),
        (("gait", "fixed", "angles", 2), ""),  # the list has it
        (("gait", "fixed", "angles"), "rad"),
        (("initial", "rotor_speed"), "rad/s"),  # may be null
        (("disturbance", 1, "force", "value"), "N"),
        (("vehicle", "tiltrotor", "tilt_servo", "max_rate"), "rad/s"),
        (("simulation", "no_such_key"), ""),
    ],
)
def test_a_location_of_pydantic_leads_to_the_key(location, unit):
    assert schema_of(Scenario).at(location).meaning_and_unit[1] == unit


def test_a_kind_is_found_before_a_key_of_its_name():
    """The kind ``cases`` of an axis has a key ``cases``."""
    table = schema_of(Sweep).at(("axis", 0, "cases"))
    assert table.kinds == ["cases"]
    assert {"keys", "cases", "type"} <= {*table.properties}
    assert table.member("cases").value["type"] == "object"


def test_tables_in_lists_and_named_tables_are_found():
    root = schema_of(Scenario)
    assert [table.name for table in root.properties["expect"].all_tables] == ["Expectation"]
    assert [table.name for table in root.properties["claim"].all_tables] == ["ClaimTable"]
    assert root.properties["expect"].tables == []
    keys = root.dotted_keys()
    assert {"expect.metric", "gait.amplitude", "vehicle.tilt_servo.max_rate"} <= {*keys}
    assert len(keys) == len({*keys})


@pytest.mark.parametrize(
    ("kinds", "shared"),
    [
        (("trot_instant", "trot_continuous"), True),
        (("walk", "walk"), True),
        (("walk", "fixed"), False),
        (("pid", "lqr"), False),
        (("walk", None), False),
        (("walk", {"a": [1]}), False),
    ],
)
def test_kinds_of_one_declaration_share_their_keys(kinds, shared):
    assert share_keys(Table, *kinds) is shared


@pytest.mark.parametrize(
    ("document", "line"),
    [
        ({"initial": {"rotor_speed": "3 m"}}, "must be a number in rad/s, without the unit"),
        ({"vehicle": {"tilt_servo": {"mjcf": 1}}}, "unknown key; did you mean vehicle.mjcf?"),
        ({"gait": {"type": "fixed", "amplitude": 1.0}}, "unknown key; only for type trot_instant"),
    ],
)
def test_messages_know_the_keys(document, line):
    with pytest.raises(InputError, match=line):
        tiltsim.parse_scenario(document)
