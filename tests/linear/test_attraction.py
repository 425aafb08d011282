"""Maps of initial states that come back."""

from __future__ import annotations

import dataclasses
from math import inf

import numpy as np
import pytest

import tiltsim
from tests.laws.test_laws import LAWS
from tiltsim.errors import InputError
from tiltsim.flight.metrics import End
from tiltsim.linear import attraction as module
from tiltsim.linear import stability as stability_module
from tiltsim.linear.attraction import Grid, attraction
from tiltsim.linear.stability import SlowestMode, advice_on_duration, slowest_mode
from tiltsim.scenario.loading import merge

SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
SHORT = {"simulation.plant": "thesis", "simulation.duration": 1.0}


@pytest.fixture
def flown(monkeypatch):
    """Scenarios that were flown, on a plant from which an ellipse comes back."""
    scenarios = []

    def ellipse(grid, these):
        for scenario in these:
            scenarios.append(scenario)
            roll, pitch, _ = scenario.initial.attitude
            back = (roll / 1.2) ** 2 + (pitch / 0.7) ** 2 < 1.0
            yield End("completed" if back else "diverged", 0.5), np.zeros(6)

    monkeypatch.setattr(Grid, "ends", ellipse)
    monkeypatch.setattr(module, "slowest_mode", lambda scenario: None)
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


def test_a_finer_first_grid_and_the_flights_to_come(flown):
    """The number to come is an estimate until the last division, when it is the number."""
    heard = []
    found = attraction(
        SETPOINT, coarse=25, progress=lambda done, total: heard.append((done, total))
    )
    assert found.share.shape == (200, 200)
    done, expected = np.array(heard).T
    assert done.tolist() == list(range(1, found.flights + 1))
    assert (done <= expected).all()
    assert expected[-1] == found.flights
    assert expected[0] == pytest.approx(found.flights, rel=0.3)


def test_shares_are_of_acceptable_and_other_attitudes(flown):
    found = attraction(SETPOINT, refinements=1)
    report = found.report()
    inside = found.acceptable
    inner = np.s_[1:-1, 1:-1]
    assert 0.0 < report["acceptable"] < inside[inner].mean()
    assert report["returned"] == pytest.approx(found.share.mean())
    assert report["returned"] == pytest.approx(
        report["acceptable"] * report["acceptable_returned"]
        + (1.0 - report["acceptable"]) * report["unacceptable_returned"]
    )
    assert inside[12, 12]  # level
    assert not inside[0, 12]  # pitched down beyond the curve


def test_a_corner_counts_as_what_it_is_itself():
    """Cells across the curve are no reason for attitudes beyond it to count as returned."""
    edges = np.linspace(-1.0, 1.0, 4)
    side = np.outer(np.ones(4), [True, True, False, False]).astype(bool)
    found = module.Attraction(None, ("roll", "pitch"), (edges, edges), side, 16, None, None, side)
    assert found._areas.sum() == pytest.approx(1.0)
    found = dataclasses.replace(found, scenario=tiltsim.load_scenario(SETPOINT))
    report = found.report()
    assert (report["acceptable_returned"], report["unacceptable_returned"]) == (1.0, 0.0)
    assert report["acceptable"] == report["returned"] == pytest.approx(0.5)


def test_other_axes_have_separate_ranges(flown):
    found = attraction(SETPOINT, ("vx", "r"), ranges=((-1.0, 2.0), None), refinements=0)
    assert [edges[[0, -1]].tolist() for edges in found.edges] == [[-1.0, 2.0], [-10.0, 10.0]]
    assert found.acceptable is None
    assert found.report()["acceptable_returned"] is None
    assert flown[1].initial.velocity[0] == -1.0
    assert flown[1].initial.angular_velocity[2] == -10.0


def test_a_flight_comes_back_if_it_ends_as_the_undisturbed_one():
    """Two real corners of a small square: at rest to begin with, and too far to be back in 1 s."""
    scenario = tiltsim.load_scenario(SETPOINT, SHORT)
    square = np.array([0.0, 1.0])
    grid = Grid(scenario, ("x", "y"), (square, square), lambda _count, _total: None)
    grid.fly({(0, 0), (1, 1)}, 1)
    assert grid.returned == {(0, 0): True, (1, 1): False}


def quadrotor(**simulation):
    simulation = {"plant": "thesis", "duration": 2.0, "timestep": 0.01, **simulation}
    return tiltsim.parse_scenario(
        merge(LAWS["quadrotor_attitude_altitude"], {"simulation": simulation})
    )


@pytest.mark.slow
def test_maps_of_both_engines_are_the_same(monkeypatch):
    monkeypatch.setattr(module, "slowest_mode", lambda scenario: None)  # so that some are not back
    pytest.importorskip("jax")
    maps = [
        attraction(
            quadrotor(engine=engine), ranges=((-0.1, 1.1), (-1.1, 0.1)), coarse=3, refinements=1
        )
        for engine in ("python", "jax")
    ]
    assert [found.engine for found in maps] == ["python", "jax"]
    assert 0.0 < maps[0].share.mean() < 1.0
    np.testing.assert_array_equal(maps[0].share, maps[1].share)


def test_the_slowest_mode_agrees_with_the_linear_analysis():
    """Ch. 4's altitude loop decays most slowly; its law follows x and y as well."""
    scenario = tiltsim.load_scenario(SETPOINT, SHORT)
    slowest = slowest_mode(scenario)
    assert slowest.name == "altitude"
    poles = tiltsim.stability(scenario).poles
    moving = poles.real[np.abs(poles) > 1e-6]
    assert slowest.decay_rate == pytest.approx(-moving.max())


def test_flights_without_an_analysis_have_no_slowest_mode(monkeypatch):
    assert (
        slowest_mode(tiltsim.load_scenario("ch04_tracking/circle#continuous_t2_modified")) is None
    )
    monkeypatch.setattr(stability_module, "MOST_STEPS", 10)
    assert slowest_mode(tiltsim.load_scenario("ch04_tracking/line#continuous_t2_modified")) is None


def test_a_duration_is_short_if_more_is_left_than_counts_as_back():
    slowest = SlowestMode("altitude", 0.2)
    assert advice_on_duration(slowest, 16.0, 0.05, 1.0) == ""  # exp(-3) < 0.05
    assert advice_on_duration(slowest, 15.9, 0.05, 1.0).endswith("take 16 s")
    advice = advice_on_duration(slowest, 8.0, 0.05, 1.0)
    assert "duration = 8 s is short: the slowest mode, altitude, decays as exp(-0.2 t)" in advice
    assert "leaves 25 % of a disturbance" in advice
    assert advice.endswith("take 16 s")


def test_a_duration_that_is_too_short_to_come_back_is_refused(flown, monkeypatch):
    """It was a warning, and the map of a stable vehicle showed that 3 % come back."""
    monkeypatch.setattr(module, "slowest_mode", lambda scenario: SlowestMode("altitude", 0.2))
    scenario = tiltsim.load_scenario(SETPOINT, SHORT)
    with pytest.raises(InputError, match=r"duration = 1 s is short: .* altitude, .* take 16 s$"):
        attraction(scenario, refinements=0)
    assert flown == []
    long_enough = scenario.replace({"simulation.duration": 16.0})
    found = attraction(long_enough, refinements=0)
    assert found.report()["slowest_mode"] == {"name": "altitude", "decay_rate": 0.2}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((("roll", "roll"),), "axes = roll,roll: choose two of x, y"),
        ((("roll", "pitch"), (-1.0, 2.0)), "range of pitch = -1:2: must be within pi/2"),
        ((("tilt_car", "tilt_car"),), "choose two"),
        ((("roll", "vx"), (1.0, 1.0)), "range of vx = 1:1: must be finite and grow"),
        ((("roll", "vx"), (0.0, inf)), "range of vx = 0:inf: must be finite and grow"),
    ],
)
def test_wrong_arguments(arguments, message):
    axes, *second = arguments
    ranges = {"ranges": (None, *second)} if second else {}
    with pytest.raises(tiltsim.InputError, match=message):
        attraction(SETPOINT, axes, **ranges)


def test_tilt_cars_have_no_attitude():
    with pytest.raises(tiltsim.InputError, match="takes rotorcraft only"):
        attraction("ch11_penguin/straight_line#small")


@pytest.mark.parametrize("refinements", [7, -1, "3", 1.5])
def test_refinements_are_a_small_whole_number(refinements):
    with pytest.raises(tiltsim.InputError, match=r"refinements = .*: must be 0 to 6"):
        attraction(SETPOINT, refinements=refinements)


@pytest.mark.parametrize("coarse", [0, 126, "3", 1.5])
def test_a_map_has_at_most_a_thousand_cells_across(coarse):
    with pytest.raises(tiltsim.InputError, match=r"coarse = .*: must be 1 to 125, for 1000 cells"):
        attraction(SETPOINT, coarse=coarse)
