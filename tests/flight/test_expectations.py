"""Expectations that hold, expectations that fail, and the texts of bounds."""

from __future__ import annotations

from math import inf, nan, nextafter

import pytest

from tiltsim.commands.run import expectation_lines
from tiltsim.flight.metrics import Verdict, check_expectations
from tiltsim.scenario.expectation import Expectation
from tiltsim.scenario.scenario import Scenario


def expects(**bounds):
    metric = "diverged" if "equals" in bounds else "final_roll"
    return Expectation(metric=metric, **bounds)


@pytest.mark.parametrize(
    ("bounds", "measured", "holds"),
    [
        ({"min": 1.0, "max": 2.0}, 1.5, True),
        ({"min": 1.0, "max": 2.0}, 1.0, True),
        ({"min": 1.0, "max": 2.0}, 2.0, True),
        ({"min": 1.0, "max": 2.0}, nextafter(1.0, 0.0), False),
        ({"min": 1.0, "max": 2.0}, nextafter(2.0, 3.0), False),
        ({"min": 1.0}, 1e300, True),
        ({"min": 1.0}, 0.9, False),
        ({"max": 1.0}, -1e300, True),
        ({"max": 1.0}, 1.1, False),
        ({"min": 1.0, "max": 1.0}, 1.0, True),
        ({"max": 1.0}, inf, False),
        ({"max": 0.0}, 0.0, True),
        ({"min": 0.0}, -1e-300, False),
    ],
)
def test_bounds_are_inclusive(bounds, measured, holds):
    assert Verdict(expects(**bounds), measured).holds is holds


@pytest.mark.parametrize("bounds", [{"min": 0.0}, {"max": 0.0}, {"equals": False}])
@pytest.mark.parametrize("measured", [nan, None], ids=["NaN", "no such metric"])
def test_an_unmeasured_metric_never_holds(bounds, measured):
    assert not Verdict(expects(**bounds), measured).holds


@pytest.mark.parametrize("expected", [True, False])
def test_equals_expects_a_truth_value(expected):
    expectation = Expectation(metric="diverged", equals=expected)
    assert Verdict(expectation, expected).holds
    assert not Verdict(expectation, not expected).holds
    assert not Verdict(expectation, float(expected)).holds


def test_the_published_figure_is_shown_but_not_judged():
    assert Verdict(expects(published=0.3, max=1.0), 0.9).holds


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ({"min": -0.4, "max": -0.36}, "-0.4 .. -0.36"),
        ({"min": 1e-9}, ">= 1e-09"),
        ({"min": 0.0}, ">= 0"),
        ({"max": 0.0}, "<= 0"),
        ({"equals": True}, "true"),
        ({"equals": False}, "false"),
    ],
)
def test_bounds_in_words(bounds, words):
    assert Verdict(expects(**bounds), None).bounds == words


def test_every_expectation_is_judged_in_order():
    scenario = Scenario(
        expect=[
            {"metric": "final_yaw", "min": 0.0},
            {"metric": "diverged", "equals": False},
            {"metric": "final_roll", "max": 1.0},
            {"metric": "final_yaw", "max": 1.0},
        ]
    )
    verdicts = check_expectations(
        scenario, {"final_roll": 2.0, "final_yaw": 0.5, "diverged": False}
    )
    assert [verdict.expectation for verdict in verdicts] == list(scenario.expect)
    assert [verdict.measured for verdict in verdicts] == [0.5, False, 2.0, 0.5]
    assert [verdict.holds for verdict in verdicts] == [True, True, False, True]


def test_a_metric_that_the_flight_does_not_have_fails_its_expectation():
    scenario = Scenario(expect=[{"metric": "sup_position_error_after_20s", "max": 1.0}])
    (verdict,) = check_expectations(scenario, {"final_roll": 0.0})
    assert verdict.measured is None
    assert not verdict.holds


@pytest.mark.parametrize(("plant", "bounds"), [("mujoco", [0.1, 0.2]), ("thesis", [0.1, 0.3])])
def test_an_expectation_may_apply_to_one_plant_only(plant, bounds):
    scenario = Scenario(
        simulation={"plant": plant},
        expect=[
            {"metric": "final_roll", "max": 0.1},
            {"metric": "final_roll", "max": 0.2, "plant": "mujoco"},
            {"metric": "final_roll", "max": 0.3, "plant": "thesis"},
        ],
    )
    verdicts = check_expectations(scenario, {"final_roll": 0.0})
    assert [verdict.expectation.max for verdict in verdicts] == bounds


@pytest.mark.parametrize(
    ("bounds", "measured", "shown"),
    [
        ({"max": 2.0, "published": -0.38}, 1.5, "-0.38"),
        ({"max": 2.0, "published": True}, 1.5, "in bounds"),
        ({"max": 2.0, "published": False}, 1.5, "out of bounds"),
        ({"equals": True, "published": True}, True, "true"),
        ({"equals": True, "published": False}, True, "false"),
        ({"max": 2.0}, 1.5, "<= 2"),
    ],
)
def test_the_table_shows_the_published_value(bounds, measured, shown):
    header, line = expectation_lines([Verdict(expects(**bounds), measured)], judged=True)
    assert line[header.index("published") :].strip().startswith(shown)
