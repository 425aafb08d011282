"""Scenarios of a sweep that differ in numbers: equal to scenarios that are made in full."""

from __future__ import annotations

import pytest

import tiltsim.sweeps.points
from tiltsim.errors import InputError
from tiltsim.scenario.loading import parse_scenario
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.points import SweepPoints

TROT = {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0}


def axis(key, *values):
    return {"type": "list", "key": key, "values": [*values]}


def sweep(*axes):
    base = {"scenario": {"gait": TROT}, "axis": [*axes]}
    return SweepPoints(load_sweep(base))


def test_each_scenario_matches_its_document_and_one_of_a_kind_is_made_in_full(monkeypatch):
    cases = {"theirs": {}, "ours": {"controller": {"decoupler": "exact"}}}
    points = sweep(
        {"type": "cases", "key": "stack", "cases": cases},
        axis("gait.period", 1.0, 1.5),
        axis("initial.position[1]", 0.0, 2.0),
        axis("vehicle.inertia", [2e-3, 3e-3, 5e-3], [2e-3, 3e-3, 4e-3]),
        axis("simulation.seed", 1, 2),
    )
    documents = []

    def parsed(document, *address):  # the base, of which presets are read, has no address
        documents.extend([document] * len(address))
        return parse_scenario(document, *address)

    monkeypatch.setattr(tiltsim.sweeps.points, "parse_scenario", parsed)
    for values in map(points.point, range(len(points))):
        scenario, full = points.scenario(values), parse_scenario(points.document(values), "sweep")
        assert scenario == full
        assert (scenario.address, scenario.model_fields_set) == ("sweep", full.model_fields_set)
    assert len(documents) == len(cases)


def test_a_zero_keeps_its_sign():
    points = sweep(axis("initial.position[1]", 0.0, -0.0))
    values = [points.scenario(points.point(i)).initial.position[1] for i in (0, 1)]
    assert list(map(str, values)) == ["0.0", "-0.0"]


@pytest.mark.parametrize(
    ("key", "allowed", "value"),
    [
        ("gait.amplitude", 0.5, 4.0),
        ("vehicle.mass", 0.5, -1.0),
        ("simulation.timestep", 0.001, 0.01),  # too long for the servo, which is in another table
    ],
)
def test_a_number_that_is_refused_is_refused_in_the_words_of_the_whole_document(
    key, allowed, value
):
    points = sweep(axis(key, allowed))
    points.scenario({key: allowed})
    with pytest.raises(InputError) as full:
        parse_scenario(points.document({key: value}), "sweep")
    with pytest.raises(InputError) as similar:
        points.scenario({key: value})
    assert str(similar.value) == str(full.value)
    assert key in str(full.value)


def test_a_value_of_another_kind_is_made_in_full():
    points = sweep(axis("gait.type", "trot_continuous", "trot_instant"))
    types = [points.scenario(points.point(index)).gait.type for index in range(2)]
    assert types == ["trot_continuous", "trot_instant"]
