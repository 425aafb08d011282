"""A load on a cable in linear analysis: a pendulum, as theory and flights have it."""

from __future__ import annotations

from math import hypot, log, pi, sqrt

import numpy as np
import pytest

import tiltsim
from tiltsim.linear.equilibrium import equilibrium_of
from tiltsim.linear.mujoco_motion import make_motion

MASS, LENGTH = 0.1, 0.8
ALONE = {
    "simulation": {"integrator": "implicitfast", "timestep": 0.001},
    "reference": {"type": "attitude_altitude"},
    "controller": {
        "law": "attitude_altitude",
        "decoupling": "exact",
        "decoupler": "none",
        "gains": {
            "attitude": [[9.0] * 3, [45.0] * 3, [72.0] * 3],
            "altitude": [8.0, 12.0, 8.0],
            "position": [1.0, 1.0],
        },
    },
    "gait": {"type": "fixed", "angles": [0.0, 0.0, 0.0, 0.0]},
}
"""A vehicle whose horizontal position nothing holds."""

LOAD = {"mass": MASS, "length": LENGTH, "attachment": [0.0, 0.0, 0.0]}
FREE = ALONE | {"payload": LOAD}


def swings(found):
    return [mode for mode in found.modes if {"swing_x", "swing_y"} & {*mode.states}]


def test_a_load_below_a_vehicle_that_nothing_holds_swings_about_the_common_center():
    scenario = tiltsim.parse_scenario(FREE)
    vehicle = scenario.vehicle.resolve()
    found = tiltsim.stability(scenario)
    expected = sqrt(vehicle.gravity / LENGTH * (1.0 + MASS / vehicle.mass))
    (swing,) = {(mode.frequency, mode.count) for mode in swings(found)}
    assert swing == (pytest.approx(expected, rel=1e-11), 4)
    assert abs(swings(found)[0].damping) < 1e-9
    rest = equilibrium_of(scenario)
    fields = rest.motion.assembly.loop.sample_fields[1:]
    sample = dict(zip(fields, rest.motion.observed(rest.time, rest.root.state), strict=True))
    assert sample["cable_tension"] == pytest.approx(MASS * vehicle.gravity, rel=1e-9)
    assert sample["payload_z"] == pytest.approx(sample["z"] - LENGTH)


def test_a_load_that_is_put_back_on_its_cable_keeps_its_swing():
    """Which has the rates that a short step gives it."""
    motion = make_motion(tiltsim.parse_scenario(FREE))
    names = motion.coordinates.names
    by = np.random.default_rng(1).uniform(-0.3, 0.3, len(names))
    moved = motion.coordinates.moved(motion.initial, by)
    placed = motion.placed(moved)
    motion.placed(placed)  # sets MuJoCo's data
    first = names.index("payload_x") + 1  # the vehicle's rotation has four entries
    assert np.linalg.norm(placed[first : first + 3]) == pytest.approx(LENGTH, abs=1e-15)
    np.testing.assert_allclose(motion.placed(placed), placed, atol=1e-15)
    x, y, z = moved[first : first + 3]
    swings = motion.swings(moved)
    np.testing.assert_allclose(swings[:2], (np.arctan2(x, -z), np.arctan2(y, -z)), atol=1e-14)
    step = 1e-6 * np.concatenate((motion.rates(0.0, placed)[: names.index("vx")], np.zeros(20)))
    ends = (motion.coordinates.moved(placed, sign * step) for sign in (1.0, -1.0))
    ahead, behind = (motion.swings(end)[:2] for end in ends)
    np.testing.assert_allclose((ahead - behind) / 2e-6, swings[2:], atol=1e-7)


@pytest.mark.slow
def test_a_load_swings_in_flight_as_its_poles_say():
    changes = {"controller": {"law": "geometric"}, "reference": {"type": "setpoint"}, "expect": []}
    changes |= {"payload.swing": 0.05, "simulation.duration": 9.0}
    scenario = tiltsim.load_scenario("interaction/carry#step", changes)
    mode = swings(tiltsim.stability(scenario))[0]
    flight = tiltsim.simulate(scenario)
    swing, time = flight["swing_x"], flight["time"]
    tops = 1 + np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] >= swing[2:]))[-3:]
    cycles = time[tops[-1]] - time[tops[0]]
    frequency, decay = 4.0 * pi / cycles, log(swing[tops[0]] / swing[tops[-1]]) / cycles
    assert frequency == pytest.approx(mode.frequency * sqrt(1.0 - mode.damping**2), rel=2e-3)
    assert decay / hypot(frequency, decay) == pytest.approx(mode.damping, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("sampled", [0.0, 0.002])
def test_damping_of_the_swing_gives_the_poles_its_ratio(sampled):
    changes = {"payload.swing_damping": 0.5, "simulation.control_timestep": sampled}
    changes |= {"controller": {"law": "pid"}}
    slowest = swings(tiltsim.stability(tiltsim.load_scenario("interaction/carry#step", changes)))[0]
    assert slowest.damping == pytest.approx(0.5, rel=0.05)


def test_a_rigid_load_is_analyzed_as_a_part_of_the_vehicle():
    load = {"payload": {**LOAD, "rigid": True}}
    alone, heavier = (
        tiltsim.stability(tiltsim.parse_scenario({**ALONE, **one})) for one in ({}, load)
    )
    assert heavier.states == alone.states
    assert heavier.stable
    assert abs(heavier.poles - alone.poles).max() > 0.1


@pytest.mark.slow
def test_a_load_below_a_sampled_vehicle_returns_as_its_matrix_says():
    """Half a second later, but for a small motion of the cable's stretch, which it leaves out."""
    found = equilibrium_of(tiltsim.load_scenario("interaction/carry#held"))
    assert found.root.residual < 1e-9
    names, motion, state = found.minimal.names, found.motion, found.root.state
    assert {"swing_shift_x", "state_modeled_rate_x"} < {*names}
    offset, samples = np.zeros(len(names)), 50
    for name, value in {"swing_x": 1e-4, "y": 1e-4, "rotor_speed_2": 5e-3}.items():
        offset[names.index(name)] = value
    moved = motion.coordinates.moved(state, found.minimal.columns @ offset)
    after = motion.coordinates.between(state, motion.flown(0, moved, samples * found.steps))
    expected = np.linalg.matrix_power(found.matrix, samples) @ offset
    flown = dict(zip(names, found.minimal.rows @ after, strict=True))
    for name in ("x", "y", "vx", "vy", "swing_x", "swing_y", "swing_rate_x"):
        value = expected[names.index(name)]
        assert flown[name] == pytest.approx(value, rel=1e-3), name
