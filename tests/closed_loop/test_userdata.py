"""Times of control steps: an event between two steps belongs to the later one."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tiltsim.closed_loop.userdata import EVALUATIONS, evaluation_time
from tiltsim.laws.assembling import assemble
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.gaits.plans import continuous_trot, instant_trot, keyframes

THIRDS = [(p / 3.0, k, 0, 0, 0) for k in range(3) for p in (k, k + 1)]
GAITS = {
    "instant": (2, lambda times, period: instant_trot(0.5, period).angles(times)[:, 0]),
    "continuous": (2, lambda times, period: continuous_trot(0.5, period).rates(times)[:, 0]),
    "keyframes": (3, lambda times, period: keyframes(THIRDS, period).angles(times)[:, 0]),
}
TILTROTOR = {
    "controller": {"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
    "gait": {"type": "fixed", "angles": [-0.2, -0.2, 0.2, 0.2]},
    "fault": [{"type": "partial_thrust", "rotor": 1, "time": 1e6, "factor": 0.9}],
}


@pytest.mark.parametrize("name", GAITS)
def test_a_corner_of_a_gait_lies_between_two_steps(name):
    """However time step, period and their multiples are rounded."""
    parts, value = GAITS[name]
    random = np.random.default_rng(5)
    for _ in range(300):
        timestep = float(random.choice([0.0003, 0.0007, 0.001, 0.003, 0.004, 0.01]))
        steps, corner = (int(random.integers(1, top)) for top in (300, 500))
        period = float(f"{parts * steps * timestep:.10g}")
        count = 4.0 * steps * corner
        stages = [evaluation_time(count + stage, 4.0, timestep) for stage in range(-4, 4)]
        values = value(stages, period)
        assert len(set(values[1:4])) == len(set(values[4:])) == 1
        assert values[3] != values[4]
        np.testing.assert_allclose(stages[3], steps * corner * timestep, rtol=1e-14)


def plant_of(**changes):
    simulation = {"duration": 1.0, "timestep": 0.001, "engine": "python"}
    return make_plant(
        assemble(tiltsim.parse_scenario({**TILTROTOR, **changes, "simulation": simulation}))
    )


def continued(plant, *, after):
    """A plant in the state of another."""
    for name in ("qpos", "qvel", "act", "ctrl"):
        getattr(plant.data, name)[:] = getattr(after.data, name)
    plant.data.userdata[EVALUATIONS] = after.data.userdata[EVALUATIONS]
    return plant


@pytest.mark.parametrize("steps", [57, 123])
@pytest.mark.parametrize("event", ["fault", "corner"])
def test_an_event_on_a_step_s_boundary_changes_no_earlier_step_and_all_of_the_next(event, steps):
    time, angles = steps * 0.001, [0.2, 0.2, -0.2, -0.2]
    partial = TILTROTOR["fault"][0]
    with_event, changed = (
        ({"fault": [partial | {"time": time}]}, {"fault": [partial | {"time": 0.0}]})
        if event == "fault"
        else (
            {"gait": {"type": "trot_instant", "amplitude": 0.2, "period": 2.0 * time}},
            {"gait": TILTROTOR["gait"] | {"angles": angles}},
        )
    )
    plant, never = plant_of(**with_event), plant_of()
    for flown in (plant, never):
        flown.advance(steps)
    np.testing.assert_array_equal(plant.data.qpos, never.data.qpos)
    assert plant.time == steps * 0.001
    always = continued(plant_of(**changed), after=never)
    for flown in (plant, never, always):
        flown.advance(1)
    np.testing.assert_array_equal(plant.data.qvel, always.data.qvel)
    assert np.abs(plant.data.qvel - never.data.qvel).max() > 1e-6
