"""Causes that end a flight, sample by sample: limits, non-finite numbers, singular matrices."""

from __future__ import annotations

from math import inf, nan

import pytest

import tiltsim
from tiltsim.laws.assembling import assemble
from tiltsim.plants.plant import take_sample
from tiltsim.simulation.simulate import TerminationMonitor, make_plant


@pytest.fixture
def end_of_sample():
    """The end that a first sample with some fields changed calls for."""
    assembly = assemble(tiltsim.parse_scenario({"simulation": {"engine": "python"}}))
    plant, fields = make_plant(assembly), assembly.loop.sample_fields
    first = take_sample(plant)

    def end(**changed):
        sample = first.copy()
        for name, value in changed.items():
            sample[fields.index(name)] = value
        return TerminationMonitor(assembly).check(plant, sample)

    return end


@pytest.mark.parametrize(
    ("changed", "cause"),
    [
        ({"x": 6e4, "y": -8e4}, "1e+05 m away from the reference"),
        ({"z": -2e4}, "2e+04 m away from the reference altitude"),
        ({"p": -2e3}, "body rate p = -2e+03 rad/s"),
        ({"q": 3e3}, "body rate q = 3e+03 rad/s"),
        ({"r": 4e3}, "body rate r = 4e+03 rad/s"),
        ({"rotor_speed_1": -2e5}, "rotor 1 at -2e+05 rad/s"),
        ({"rotor_speed_4": 3e5}, "rotor 4 at 3e+05 rad/s"),
    ],
)
def test_a_limit_is_named_with_its_value(end_of_sample, changed, cause):
    end = end_of_sample(**changed)
    assert (end.kind, end.cause, end.time) == ("diverged", cause, 0.0)


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_a_number_that_is_not_finite_is_named(end_of_sample, value):
    end = end_of_sample(vy=value, roll=nan)
    assert end.kind == "diverged"
    assert end.cause.startswith("vy is no longer")


def test_a_sound_sample_ends_nothing(end_of_sample):
    assert end_of_sample() is None
