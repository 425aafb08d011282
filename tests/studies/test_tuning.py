"""Fair tuning: the varied keys, the search, and its tasks."""

from __future__ import annotations

from json import dumps
from math import log

import numpy as np
import pytest

import tiltsim
from tiltsim.errors import InputError
from tiltsim.studies import tuning
from tiltsim.studies.arena import vehicles
from tiltsim.studies.comparison import Compared, controller_tables

TABLES = {
    "tiltrotor": controller_tables(["given", "attitude_altitude", "full_pose", "pid", "lqr"]),
    "quadrotor": controller_tables(["yaw_position", "pid"]),
}


def controller(vehicle, name):
    entries = tuning.tuning_entries(vehicles("unlimited")[vehicle], name, TABLES[vehicle][name])
    return entries[0].scenario().controller


@pytest.mark.parametrize(
    ("vehicle", "name", "loops"),
    [
        ("tiltrotor", "given", 4),
        ("tiltrotor", "attitude_altitude", 4),
        ("tiltrotor", "full_pose", 2),
        ("quadrotor", "yaw_position", 2),
    ],
)
def test_a_factor_on_a_loop_makes_its_poles_faster(vehicle, name, loops):
    before = controller(vehicle, name)
    knobs = list(tuning.knobs(before))
    assert len(knobs) == loops
    table = tuning.scaled(before, dict.fromkeys(knobs, 1.5))
    after = tiltsim.load_scenario(
        "arena/" + vehicle + "#step", {"controller": {**table, "allow_unstable": True}}
    ).controller
    s = np.linspace(-40.0, 40.0, 9)
    for (name, one), (again, other) in zip(before.in_full().gains, after.gains, strict=True):
        assert name == again
        columns = (np.reshape(gains, (len(one), -1)).T for gains in (one, other))
        for row, faster in zip(*columns, strict=True):
            expected = 1.5 ** len(one) * np.polyval([1.0, *row], s)
            scale = 1.5 ** len(one) * np.polyval([1.0, *row], 40.0)
            np.testing.assert_allclose(
                np.polyval([1.0, *faster], 1.5 * s), expected, atol=1e-5 * scale
            )
    kept = before.model_dump(exclude={"gains", "allow_unstable"})
    assert after.model_dump(exclude={"gains", "allow_unstable"}) == kept


def test_yaw_is_a_separate_loop():
    before = controller("tiltrotor", "given")
    factors = dict.fromkeys(tuning.knobs(before), 1.0) | {"gains.attitude, yaw": 2.0}
    attitude = np.array(tuning.scaled(before, factors)["gains"]["attitude"])
    full = np.array(before.in_full().gains.attitude)
    np.testing.assert_allclose(attitude / full, [[1, 1, 2], [1, 1, 4], [1, 1, 8]])


def test_a_scalar_law_is_searched_in_its_own_keys_but_limits_and_actuators():
    before = controller("tiltrotor", "pid")
    knobs = tuning.knobs(before)
    assert "rate_gains[2]" in knobs
    assert not {"rotor_bandwidth", "max_acceleration", "max_speed"} & set(knobs)
    table = tuning.scaled(before, dict.fromkeys(knobs, 1.0) | {"velocity_gains[1]": 2.0})
    assert table["velocity_gains"] == [3.0, 1.8]
    assert table["law"] == "pid"


def test_a_search_begins_at_the_default_gains_and_keeps_its_budget_and_bounds():
    best = np.array([0.4, -0.7])
    flown = tuning.maximize(lambda x: -float(((x - best) ** 2).sum()), 2, 60, seed=3)
    points = np.array([point for point, _ in flown])
    assert len(flown) == 60
    np.testing.assert_array_equal(points[0], 0.0)
    assert points.min() >= log(tuning.FACTORS[0])
    assert points.max() <= log(tuning.FACTORS[1])
    found = max(flown, key=lambda one: one[1])[0]
    np.testing.assert_allclose(found, best, atol=0.01)
    again = tuning.maximize(lambda x: -float(((x - best) ** 2).sum()), 2, 60, seed=3)
    np.testing.assert_array_equal(points, [point for point, _ in again])
    other = tuning.maximize(lambda x: 0.0, 2, 60, seed=4)
    assert not np.array_equal(points[1], other[1][0])


@pytest.mark.parametrize("budget", [1, 2, 9, 14, 17, 18])
def test_a_search_of_many_factors_flies_its_whole_budget(budget):
    # Nine points make a simplex of eight factors: a second half of 9 evaluations holds it.
    flown = tuning.maximize(lambda x: -float((x**2).sum()), 8, budget, seed=1)
    assert len(flown) == budget
    np.testing.assert_array_equal(flown[0][0], 0.0)


@pytest.fixture
def flights(monkeypatch):
    """Flights whose error is the distance of the position gain from 2.0, refused above 3."""
    flown = []

    def compare_one(entry, **_):
        flown.append(entry)
        gain = entry.table["position_gain"]
        row = {
            "scenario": entry.address,
            "end": "refused" if gain > 3.0 else "completed",
            "rms_position_error": abs(gain - 2.0),
            "final_position_error": 0.0,
            "rms_yaw_error": 0.0,
            "idle_position_error": 0.0,
            "idle_yaw_error": 0.0,
        }
        return Compared(row, np.zeros(0), np.zeros(0))

    monkeypatch.setattr(tuning, "compare_one", compare_one)
    return flown


def test_a_search_finds_the_gains_that_score_best(flights):
    found = tuning.tune(tuning.Search("quadrotor", "pid"), vehicles("unlimited"), TABLES, 200, 1)
    assert found.flights == len(flights) <= 200
    assert abs(found.table["position_gain"] - 2.0) < 0.1
    assert found.tuned_score > found.default_score > 0.0
    assert found.factors["position_gain"] == pytest.approx(found.table["position_gain"], rel=1e-3)
    assert found.of == {"law": "pid"}
    again = tuning.tune(tuning.Search("quadrotor", "pid"), vehicles("unlimited"), TABLES, 200, 1)
    assert again == found


def test_a_budget_below_one_flight_on_each_task_is_refused(flights):
    with pytest.raises(InputError, match="--tune 4: must be at least 5, one flight on each"):
        tuning.tune(tuning.Search("quadrotor", "pid"), vehicles("unlimited"), TABLES, 4, 1)
    assert not flights


def test_scenarios_without_a_task_have_no_tuned_gains(monkeypatch):
    def refused(entry, **_):
        return Compared({"scenario": entry.address, "end": "refused"}, np.zeros(0), np.zeros(0))

    monkeypatch.setattr(tuning, "compare_one", refused)
    assert (
        tuning.tune(tuning.Search("tiltrotor", "lqr"), vehicles("unlimited"), TABLES, 20, 1) is None
    )


def test_no_tuning_task_is_one_of_the_arena():
    for name in ("quadrotor", "tiltrotor", "hexarotor"):
        vehicle = vehicles("unlimited")[name]
        entries = tuning.tuning_entries(vehicle, "given", {})
        assert len(entries) == (5 if name == "quadrotor" else 6 + ("tilt" in name))
        for entry in entries:
            flown = entry.scenario()
            task = tiltsim.load_scenario(entry.address, vehicle.overrides)
            changed = [
                getattr(flown, key) != getattr(task, key)
                for key in ("reference", "initial", "air", "fault")
            ]
            assert any(changed), entry.address
            assert flown.simulation.duration == tuning.DURATION


def test_kept_gains_are_read_and_others_refused(tmp_path):
    found = {
        tuning.Search("tiltrotor", "pid"): tuning.Tuned({}, {"law": "pid"}, {}, 1.0, 2.0, 3),
        tuning.Search("tiltrotor", "lqr"): None,
    }
    made = {"date": "2026-11-22", "commit": ""}
    kept = tuning.tuning_document(found, 3, 1, made)
    assert list(kept["gains"]["tiltrotor"]) == ["pid"]
    file = tmp_path / "gains.json"
    partly = dict(kept, gains={"tiltrotor": {"pid": {"table": {"law": "pid"}}}})
    for text in ("[]", "{}", "nothing", dumps(partly), dumps({**kept, "made": {"date": ""}})):
        file.write_text(text)
        with pytest.raises(
            InputError, match=r"not a file of tuned gains \(\w+: .*--tune writes one"
        ):
            tuning.read_tuning(file)
    with pytest.raises(InputError, match="no such file"):
        tuning.read_tuning(tmp_path / "missing.json")
