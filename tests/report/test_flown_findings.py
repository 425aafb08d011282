"""Findings that only flights show."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import tiltsim
from tiltsim.laws.assembling import assemble
from tiltsim.report.pictures import attraction_map
from tiltsim_controllers.analysis.singularity import determinant

pytestmark = pytest.mark.slow  # more laws to compile than to fly


@cache
def fly(address, plant="thesis", duration=32.0, inertia=0.0):
    """A flight of the library, without its end; 12 s after the transient are whole periods."""
    changes = {
        "vehicle.rotor_inertia": inertia,
        "simulation.plant": plant,
        "simulation.engine": "native",
        "simulation.duration": duration,
    }
    return tiltsim.simulate(tiltsim.load_scenario(address, changes))


def error(address, *conditions):
    return fly(address, *conditions).metrics()["sup_position_error_after_20s"]


@pytest.mark.parametrize("form", ["instant", "continuous"])
def test_the_modified_decoupler_is_worse_at_short_periods_only(form):
    for period, worse in ((1, True), (3, False)):
        conventional, modified = (
            error(f"ch04_tracking/line#{form}_t{period}_{name}")
            for name in ("conventional", "modified")
        )
        assert (modified > 1.1 * conventional) == worse
        assert (modified < 0.9 * conventional) != worse


@pytest.mark.parametrize("decoupler", ["modified", "conventional"])
def test_gallops_beat_the_walk_with_the_modified_decoupler(decoupler):
    walk, *gallops = (
        error(f"ch05_gaits/line#{gait}_third_t1_{decoupler}")
        for gait in ("walk", "transverse_gallop", "rotary_gallop")
    )
    if decoupler == "modified":
        assert max(gallops) < 0.8 * walk
    else:
        assert min(gallops) > 1.2 * walk


def test_the_measured_acceleration_saves_the_flight_that_the_modeled_one_loses():
    completed = {
        address: fly(f"ch04_tracking/{address}_t3_conventional", "mujoco").end.kind == "completed"
        for address in ("line#instant", "measured_acceleration#line")
    }
    assert completed == {"line#instant": False, "measured_acceleration#line": True}


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_rotor_inertia_changes_trots_but_no_fixed_gait(plant):
    fixed, trot = (f"ch04_tracking/circle#{name}_modified" for name in ("fixed", "continuous_t2"))
    without, heavy = (error(fixed, plant, 32.0, inertia) for inertia in (0.0, 1e-5))
    assert heavy == pytest.approx(without, rel=0.01)
    without, heavy = (error(trot, plant, 32.0, inertia) for inertia in (0.0, 1e-5))
    assert heavy < 0.75 * without
    assert (fly(trot, plant, 32.0, 3e-5).end.kind == "completed") == (plant == "thesis")


def test_a_rounded_blue_gait_hovers_undisturbed_and_is_lost_on_a_circle():
    hover = fly("ch08_generalized_map/stabilization#gait_3_rounded", duration=3.0)
    assert hover.end.kind == "completed"
    assert hover.metrics()["min_decoupling_condition"] < 1e-5
    circle = fly("ch07_robust_gaits/circle#gait_1_blue_rounded", duration=3.0)
    assert circle.end.kind != "completed"
    assert circle.end.time < 0.01


@cache
def coarse_map(name):
    """From 49 attitudes."""
    return attraction_map(name, coarse=6, refinements=0)


def test_attitudes_that_come_back_were_acceptable_at_the_start():
    fixed, trot = coarse_map("ch. 4, fixed at 0.65"), coarse_map("ch. 4, trot to 0.65, T = 2 s")
    for found in (fixed, trot):
        across, up = np.meshgrid(*found.edges)
        angles = assemble(found.scenario).gait.angles(0.0)
        beyond = determinant(angles, across, up, found.scenario.vehicle.resolve()) < 0.0
        assert beyond.any()
        assert not found.returned[beyond].any()
    assert 0.85 < fixed.report()["acceptable_returned"] < 0.98
    assert 0.35 < trot.report()["unacceptable_returned"] < 0.65


def test_acceptable_attitudes_are_lost_by_the_time_step():
    red = coarse_map("ch. 6, gait 3, red")
    assert red.acceptable.all()
    assert 0.7 < red.report()["acceptable_returned"] < 0.9
    lost = [(red.edges[0][i], red.edges[1][j], 0.0) for j, i in np.argwhere(~red.returned)]
    share = {}
    for timestep in (1e-3, 2.5e-5):
        keys = {"simulation.timestep": timestep, "simulation.duration": 0.1}
        short = red.scenario.replace(keys)
        flown = tiltsim.fly([short.replace({"initial.attitude": attitude}) for attitude in lost])
        share[timestep] = np.mean([flight.end.kind == "completed" for flight in flown])
    assert share[1e-3] < 0.1
    assert share[2.5e-5] > 0.9
