"""Supervised flights: engines, plants, batches, restarts, and the columns that they show."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.laws.assembling import assemble
from tiltsim.simulation.batch import fly
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.analysis.singularity import determinant
from tiltsim_controllers.vehicle.parameters import PRESETS

VEHICLE = PRESETS["ar_drone_2"]
WITH_STATES = ("hold", "return_to_red")
SCENARIO = "beyond/supervisor#supervised"
RED = {"controller.supervisor.strategy": "return_to_red"}
SLOW_LAW = {
    "controller.decoupling": "exact",
    "controller.gains": {"attitude": [[9.0] * 3, [27.0] * 3, [27.0] * 3], "altitude": [9, 27, 27]},
}
SELDOM = {"simulation.control_timestep": 0.05}
FEEDFORWARD = {
    "decoupling": "exact",
    "decoupler": "exact",
    "gait_rate_feedforward": True,
    "gains": "feedforward",
}
EXACT = {"decoupling": "exact", "gains": "exact"}


@pytest.mark.slow
def test_engines_fly_the_same_supervised_flight_and_show_what_passed():
    short = {"simulation.duration": 1.6}
    python, native = (
        tiltsim.simulate(tiltsim.load_scenario(SCENARIO, {**short, "simulation.engine": engine}))
        for engine in ("python", "native")
    )
    np.testing.assert_array_equal(python.samples, native.samples)
    commanded = np.stack([python[f"alpha_ref_{rotor}"] for rotor in (1, 2, 3, 4)], axis=-1)
    reached = determinant(commanded, python["roll"], python["pitch"], VEHICLE)
    assert reached.min() == pytest.approx(2.0, abs=1e-4)
    assert (
        np.abs(commanded - np.stack([python[f"alpha_{i}"] for i in (1, 2, 3, 4)], -1)).max() < 0.01
    )


@pytest.mark.parametrize("strategy", WITH_STATES)
def test_a_flight_with_room_is_the_unsupervised_one_bit_for_bit(strategy):
    tables = tiltrotor(gait={"type": "trot_continuous", "amplitude": 0.3, "period": 1.0})
    plain = tiltsim.simulate(tiltsim.parse_scenario(tables))
    tables["controller"] = {**tables["controller"], "supervisor": {"strategy": strategy}}
    watched = tiltsim.simulate(tiltsim.parse_scenario(tables))
    assert len(watched) == len(plain) == 131
    assert not watched["supervision"].any()
    assert watched.metrics() | {"realtime_factor": 0.0} == plain.metrics() | {
        **{"max_supervision": 0.0, "realtime_factor": 0.0}
    }
    np.testing.assert_array_equal(watched.samples[:, : plain.samples.shape[1]], plain.samples)


def tiltrotor(**tables):
    simulation = {"duration": 1.3, "timestep": 0.002, "engine": "python"}
    return {"simulation": simulation, "controller": {}, **tables}


@pytest.mark.slow
@pytest.mark.parametrize(("law", "strategy"), [({}, "hold"), (FEEDFORWARD, "return_to_red")])
def test_engines_batches_and_restarts_agree(law, strategy):
    supervisor = {"strategy": strategy, "min_margin": 0.8}
    tables = tiltrotor(
        gait={"type": "trot_instant", "amplitude": 0.7, "period": 0.8},
        controller={**law, "supervisor": supervisor},
    )
    desired = tiltsim.parse_scenario(tables)
    python = tiltsim.simulate(desired)
    assert python["supervision"].max() > 0.2
    native = {**tables, "simulation": {**tables["simulation"], "engine": "native"}}
    compiled = tiltsim.parse_scenario(native)
    np.testing.assert_array_equal(tiltsim.simulate(compiled).samples, python.samples)
    (row,) = fly([compiled], keep_samples=True)
    np.testing.assert_array_equal(row.flight.samples, python.samples)

    straight = make_plant(assemble(desired))
    straight.advance(300)
    saved = straight.state
    straight.advance(60)
    restarted = make_plant(assemble(desired))
    restarted.state = saved
    restarted.advance(60)
    np.testing.assert_array_equal(restarted.state, straight.state)


def test_scaling_shows_the_share_of_the_gait_that_it_takes_away():
    angles = np.array([-0.8, 0.1, 0.9, -0.2])
    supervisor = {"strategy": "scale", "min_determinant": 2.4}
    tables = tiltrotor(
        gait={"type": "fixed", "angles": angles.tolist()}, controller={"supervisor": supervisor}
    )
    tables["simulation"]["duration"] = 0.2
    flight = tiltsim.simulate(tiltsim.parse_scenario(tables))
    flown = np.stack([flight[f"alpha_ref_{rotor}"] for rotor in (1, 2, 3, 4)], axis=-1)
    assert 0.05 < flight["supervision"].min() <= flight["supervision"].max() < 0.95
    assert flight.metrics()["max_supervision"] == flight["supervision"].max()
    np.testing.assert_allclose(flown, np.outer(1.0 - flight["supervision"], angles), rtol=1e-12)


@pytest.mark.parametrize("strategy", ["scale", "hold"])
def test_a_gait_that_keeps_its_margin_where_it_is_flown_is_flown(strategy):
    """The vehicle leans with its tilts: untilted, or at tilts of another time, it would not."""
    tables = tiltrotor(
        gait={"type": "trot_continuous", "amplitude": 0.9, "period": 2.0},
        controller={
            **FEEDFORWARD,
            "gains": "exact",
            "supervisor": {"strategy": strategy, "min_margin": 0.9, "min_determinant": 0.0},
        },
        reference={"type": "circle", "radius": 1.0, "angular_frequency": 0.6},
        initial={"position": [1.0, 0.1, 0.0], "velocity": [0.0, 0.6, 0.0]},
    )
    tables["simulation"] |= {"duration": 2.2, "timestep": 0.004}
    flight = tiltsim.simulate(tiltsim.parse_scenario(tables))
    settled = flight["time"] > 0.4
    assert flight["singularity_margin"][settled].min() > 1.3
    assert np.abs(flight["supervision"][settled]).max() < 1e-6
    assert flight.metrics()["max_tilt_rate"] < 5.0


@pytest.mark.parametrize("strategy", ["scale", *WITH_STATES])
def test_both_plants_fly_it_alike(strategy):
    tables = tiltrotor(
        gait={"type": "trot_continuous", "amplitude": 0.6, "period": 1.0},
        controller={"supervisor": {"strategy": strategy, "min_margin": 1.2}},
    )
    flown = {}
    for plant in ("mujoco", "thesis"):
        tables["simulation"]["plant"] = plant
        flown[plant] = tiltsim.simulate(tiltsim.parse_scenario(tables))
        assert flown[plant]["supervision"].max() > 0.05
    for column in ("alpha_ref_1", "supervision", "roll", "x"):
        apart = np.abs(flown["mujoco"][column] - flown["thesis"][column]).max()
        assert apart < 0.01, (column, apart)


@pytest.mark.parametrize("strategy", WITH_STATES)
def test_a_supervised_gait_flies_sampled_and_through_real_actuators(strategy):
    supervisor = {"strategy": strategy, "min_margin": 0.8}
    simulation = {"duration": 1.3, "timestep": 0.002, "control_timestep": 0.004}
    tables = tiltrotor(
        gait={"type": "trot_instant", "amplitude": 0.7, "period": 0.8},
        controller={**EXACT, "supervisor": supervisor},
        vehicle={"rotor_time_constant": 0.02, "tilt_servo": {"max_rate": 30.0}},
    )
    tables["simulation"] |= simulation
    flight = tiltsim.simulate(tiltsim.parse_scenario(tables))
    assert flight.end.kind == "completed"
    assert flight["supervision"].max() > 0.2
    commanded = flight["alpha_ref_1"]
    assert np.isfinite(commanded).all()
    assert "thrust_factor_1" in flight.columns


@pytest.mark.parametrize("address", ["beyond/supervisor#held", "beyond/supervisor#returned_to_red"])
def test_sampled_as_seldom_as_allowed_it_stays_within_bounds(address):
    """Under a law that is slow enough itself; from 0.05 s on the states would swing up."""
    changes = {
        **{"simulation.control_timestep": 0.045, "simulation.duration": 2.4},
        **{"simulation.timestep": 0.0025, **SLOW_LAW},
    }
    flight = tiltsim.simulate(tiltsim.load_scenario(address, changes))
    assert flight.end.kind == "completed"
    assert flight["supervisor_state"].min() >= 0.0
    if address.endswith("held"):
        assert flight["supervisor_rate"].max() < 1.2
    else:
        assert 0.5 < flight["supervisor_state"].max() <= 1.0


def test_the_way_to_red_is_no_faster_than_requested():
    """A planned gait that rests and is not allowed: the tilts set out for red."""
    tables = tiltrotor(
        gait={"type": "fixed", "angles": [-0.8, 0.1, 0.9, -0.2]},
        controller={
            "supervisor": {
                "strategy": "return_to_red",
                "min_determinant": 2.4,
                "max_tilt_rate": 0.2,
            }
        },
    )
    flight = tiltsim.simulate(tiltsim.parse_scenario(tables))
    assert flight.end.kind == "completed"
    assert flight.metrics()["max_tilt_rate"] == pytest.approx(0.2, abs=0.002)
    means = np.array([0.05, -0.05] * 2)
    commanded = np.stack([flight[f"alpha_ref_{rotor}"] for rotor in (1, 2, 3, 4)], axis=-1)
    share = flight["supervision"]
    gap = np.array([-0.8, 0.1, 0.9, -0.2]) - means
    np.testing.assert_allclose(commanded, means + np.outer(1.0 - share, gap), atol=1e-12)
    assert (np.diff(share) >= 0.0).all()
    assert (np.diff(flight["determinant"][1:]) >= 0.0).all()
    assert 2.35 < flight["determinant"][-1] < 2.4  # ever slower, as there is less to gain


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"controller.supervisor.min_margin": 1.6}, "controller.supervisor.min_margin = 1.6"),
        ({"controller.supervisor.horizon": 1.0}, 'strategy = "hold" or "return_to_red"'),
        ({"controller.supervisor.clearance": 0.2}, 'strategy = "return_to_red"'),
        ({**RED, "controller.supervisor.clearance": 0.2}, "must be below 0.1671"),
        ({**RED, "controller.supervisor.clearance": 0.07}, "below min_determinant = 2"),
        ({"controller.supervisor.strategy": "stop"}, "scale, hold or return_to_red"),
        ({**SELDOM, "controller.supervisor.strategy": "hold"}, "control_timestep = 0.05: too long"),
        ({**SELDOM, **RED}, "strategy = return_to_red, which moves with a lag of 0.025 s; below"),
    ],
)
def test_mistakes_are_one_line(changes, message):
    assert message in refusal(tiltsim.load_scenario, SCENARIO, changes)
