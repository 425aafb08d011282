"""The layer of air around a vehicle, in flight."""

from __future__ import annotations

from math import atan2

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.laws.restarting import assert_restarts
from tiltsim.engines.control import control_callback
from tiltsim.errors import InputError
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.vehicle.air import dryden_velocity, ground_effect

DRAG = {"linear": [0.2, 0.2, 0.1], "area": [0.01, 0.01, 0.02]}
STORM = {
    "drag": DRAG,
    "wind": [4.0, 1.0, 0.0],
    "turbulence": {"wind_at_6m": 4.0},
    "gust": {"velocity": [3.0, 0.0, 1.0], "start": 0.2, "rise": 0.2},
    "ground_effect": {"height": -0.15},
}
LATE = {"control_timestep": 0.004, "control_latency": 0.008}
QUADROTOR = {"vehicle": {"model": "quadrotor"}, "controller": {"law": "yaw_position"}}
TILTROTOR = {
    "initial": {"rotor_speed": 361.0},
    "controller": {"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
    "gait": {"type": "fixed", "angles": [-0.2, -0.2, 0.2, 0.2]},
}


def scenario(air, simulation=None, tables=TILTROTOR):
    simulation = {"duration": 0.6, "timestep": 0.004, "engine": "python", **(simulation or {})}
    return tiltsim.parse_scenario({**tables, "air": air, "simulation": simulation})


def fly(*arguments, **more):
    return tiltsim.simulate(scenario(*arguments, **more))


def test_still_air_is_no_layer():
    assert loop_of(scenario({})) is LOOPS["attitude_altitude"]


@pytest.mark.parametrize("tables", [TILTROTOR, QUADROTOR], ids=["tiltrotor", "quadrotor"])
@pytest.mark.parametrize("control_timestep", [0.0, 0.004])
def test_air_that_does_nothing_changes_nothing(tables, control_timestep):
    nothing = {"drag": {"linear": [0.0, 0.0, 0.0]}, "density": 1.0}
    timing = {"control_timestep": control_timestep}
    still, layered = (fly(air, timing, tables) for air in ({}, nothing))
    same = still.samples.shape[1]
    np.testing.assert_array_equal(still.samples, layered.samples[:, :same])


@pytest.mark.parametrize("timing", [{}, LATE], ids=["continuous", "late"])
def test_a_saved_state_restarts_bit_identically(timing):
    assert_restarts(scenario(STORM, timing), 51, 40)


# --- physics -----------------------------------------------------------------------------------


def test_a_steady_wind_is_leant_against_and_held_by_position_error():
    """Drag balances the lean; the position loop, gain one, demands it at an error."""
    wind, linear = 3.0, 0.2
    # The law's poles are at 1 rad/s and slower ones of the altitude; 12 s leave 4e-5 of the lean.
    air = {"drag": {"linear": [linear] * 3}, "wind": [wind, 0.0, 0.0]}
    flight = fly(air, {"duration": 12.0}, QUADROTOR)
    pitch = flight.metrics()["final_pitch"]
    mass, gravity = 0.429, 9.8
    assert pitch == pytest.approx(-atan2(linear * wind, mass * gravity), rel=2e-3)


def test_a_falling_body_feels_drag_alone():
    """Early in a flight along x: m v' = -(c + rho A v / 2) v."""
    air = {"drag": {"linear": [0.3, 0.3, 0.3], "area": [0.05, 0.05, 0.05]}}
    plant = make_plant(assemble(scenario(air)))
    plant.data.qvel[:3] = [4.0, 0.0, 0.0]
    plant.data.ctrl[:] = 0.0
    plant.advance(1)
    without = make_plant(assemble(scenario({})))
    without.data.qvel[:3] = [4.0, 0.0, 0.0]
    without.advance(1)
    change = (plant.data.qvel[0] - without.data.qvel[0]) / 0.004
    desired = -(0.3 + 0.5 * 1.225 * 0.05 * 4.0) * 4.0 / 0.429
    assert change == pytest.approx(desired, rel=1e-2)


def test_turbulence_is_logged_as_it_blows():
    flight = fly(STORM)
    states = np.stack([flight[f"dryden_{i}"] for i in range(1, 6)], axis=-1)
    turbulence = flight.assembly.setup.parameters.layer.air
    x, y, z = dryden_velocity(tuple(states[0]), turbulence.turbulence)
    start = [flight[name][0] for name in ("air_vx", "air_vy", "air_vz")]
    np.testing.assert_allclose(start, [4.0 + x, 1.0 + y, z])
    assert flight["air_vx"][-1] - flight["air_vx"][0] > 1.0  # the gust


def accelerations(air, height, roll):
    """Linear and angular (world, body) of a tiltrotor in hover at a height, from its model."""
    plant = make_plant(assemble(scenario(air, tables={**TILTROTOR, "gait": {"type": "fixed"}})))
    hover = 361.3829880001334
    plant.data.qpos[:7] = [0.0, 0.0, height, np.cos(roll / 2.0), np.sin(roll / 2.0), 0.0, 0.0]
    plant.data.act[:4] = [-hover, hover, -hover, hover]
    plant.data.qvel[:] = 0.0
    with control_callback(plant.callback):
        mujoco.mj_forward(plant.model, plant.data)
    return plant.data.qacc[:6].copy()


def test_near_the_ground_the_same_speed_lifts_more():
    lifted = accelerations({"ground_effect": {"height": -0.15}}, 0.0, 0.0)
    desired = 9.8 * (ground_effect(0.15, 0.1) - 1.0)
    np.testing.assert_allclose(lifted, [0.0, 0.0, desired, 0.0, 0.0, 0.0], atol=1e-9)


def test_near_the_ground_the_lower_side_is_lifted_more():
    roll, arm = 0.2, 0.1785  # rolling to the right lifts rotor 2, on the left
    found = accelerations({"ground_effect": {"height": -0.15}}, 0.0, roll)
    high, low = (ground_effect(0.15 + side * arm * np.sin(roll), 0.1) for side in (1.0, -1.0))
    thrust = 0.429 * 9.8 / 4.0
    assert found[3] == pytest.approx(arm * thrust * (high - low) / 2.24e-3, rel=1e-6)
    assert found[3] < 0.0


MISTAKES = {
    "wind without drag": ({"wind": [3.0, 0.0, 0.0]}, r"air.wind.*set air.drag"),
    "gust without drag": (
        {"gust": {"velocity": [1.0, 0.0, 0.0], "rise": 1.0}},
        r"air.gust.*set air.drag",
    ),
    "short gust": (
        {"drag": DRAG, "gust": {"velocity": [1, 0, 0], "rise": 1.0, "duration": 1.5}},
        "duration",
    ),
    "misspelt": ({"drag": DRAG, "winds": [1.0, 0.0, 0.0]}, "wind"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_refused_in_words(name):
    air, words = MISTAKES[name]
    with pytest.raises(InputError, match=words):
        scenario(air)
