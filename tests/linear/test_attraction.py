"""Maps of initial states that come back."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tiltsim.linear import attraction as module
from tiltsim.linear.attraction import attraction

SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
SHORT = {"simulation.plant": "thesis", "simulation.duration": 1.0}


class Result:
    """A flight that comes back from within an ellipse."""

    def __init__(self, scenario):
        roll, pitch, _ = scenario.initial.attitude
        back = (roll / 1.2) ** 2 + (pitch / 0.7) ** 2 < 1.0
        self.end = type("End", (), {"kind": "completed" if back else "diverged", "time": 0.5})
        self.metrics = dict.fromkeys((*module.ANGLES, *module.POSITION), 0.0)


@pytest.fixture
def flown(monkeypatch):
    """Scenarios that were flown, on a plant that is an ellipse."""
    scenarios = []

    def fly(these):
        for scenario in these:
            scenarios.append(scenario)
            yield Result(scenario)

    monkeypatch.setattr(module, "fly", fly)
    return scenarios


def test_the_map_is_fine_at_the_boundary_only(flown):
    """96 cells across find the ellipse's area to a cell's width, with a sixth of the flights."""
    found = attraction(SETPOINT)
    area = float(found.share.mean()) * 9.0
    circumference = np.pi * (3.0 * 1.9 - (4.3 * 3.3) ** 0.5)
    assert area == pytest.approx(np.pi * 1.2 * 0.7, abs=circumference * 3.0 / 96.0 / 2.0)
    assert found.share.shape == (96, 96)
    assert found.flights == len(flown) - 1  # all but the undisturbed one
    assert found.flights < 97 * 97 / 6
    assert len({scenario.initial.attitude for scenario in flown[1:]}) == found.flights


def test_shares_are_of_acceptable_and_other_attitudes(flown):
    found = attraction(SETPOINT, refinements=1)
    report = found.report()
    inside = found.acceptable.astype(bool)
    assert report["acceptable"] == pytest.approx(inside.mean())
    assert report["returned"] == pytest.approx(
        report["acceptable"] * report["acceptable_returned"]
        + (1.0 - report["acceptable"]) * report["unacceptable_returned"]
    )
    assert inside[12, 12]  # level
    assert not inside[0, 12]  # pitched down beyond the curve


def test_other_axes_have_ranges_of_their_own(flown):
    found = attraction(SETPOINT, ("vx", "r"), ranges=((-1.0, 2.0), None), refinements=0)
    assert [edges[[0, -1]].tolist() for edges in found.edges] == [[-1.0, 2.0], [-10.0, 10.0]]
    assert found.acceptable is None
    assert found.report()["acceptable_returned"] is None
    assert flown[1].initial.velocity[0] == -1.0
    assert flown[1].initial.angular_velocity[2] == -10.0


def test_a_flight_comes_back_if_it_ends_as_the_undisturbed_one():
    """Two real corners of a small square: at rest to begin with, and too far to be back in 1 s."""
    scenario = tiltsim.load_scenario(SETPOINT, SHORT)
    grid = module._Grid(
        scenario, ("x", "y"), (np.array([0.0, 1.0]), np.array([0.0, 1.0])), lambda _count: None
    )
    grid.fly({(0, 0), (1, 1)})
    assert grid.returned == {(0, 0): True, (1, 1): False}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((("roll", "roll"),), "axes = roll,roll: choose two of x, y"),
        ((("roll", "pitch"), "ranges"), "range of pitch = -1:2: must be within pi/2"),
        ((("tilt_car", "tilt_car"),), "choose two"),
    ],
)
def test_wrong_arguments(arguments, message):
    ranges = {"ranges": (None, (-1.0, 2.0))} if len(arguments) > 1 else {}
    with pytest.raises(tiltsim.InputError, match=message):
        attraction(SETPOINT, arguments[0], **ranges)


def test_tilt_cars_have_no_attitude():
    with pytest.raises(tiltsim.InputError, match="takes rotorcraft only"):
        attraction("ch11_penguin/straight_line#small")


@pytest.mark.parametrize("refinements", [7, -1, "3", 1.5])
def test_refinements_are_a_small_whole_number(refinements):
    with pytest.raises(tiltsim.InputError, match=r"refinements = .*: must be 0 to 6"):
        attraction(SETPOINT, refinements=refinements)
