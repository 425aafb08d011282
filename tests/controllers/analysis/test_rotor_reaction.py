"""The loop that a measured angular acceleration closes through the rotors' reaction."""

from __future__ import annotations

from math import exp, inf

import numpy as np
import pytest

from tiltsim_controllers.analysis.stability import (
    attitude_feedback,
    largest_held_gain,
    reaction_gains,
)
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.vehicle.cross import cross_table
from tiltsim_controllers.vehicle.parameters import PRESETS


@pytest.mark.parametrize("latency", [0, 1, 2, 7])
@pytest.mark.parametrize("step", [1e-4, 0.01, 0.1])
def test_the_largest_held_gain_is_the_margin_of_the_sampled_loop(step, latency):
    decay = exp(-step / 0.02)
    largest = largest_held_gain(step, 0.02, latency)
    for gain, stable in ((0.999 * largest, True), (1.001 * largest, False)):
        loop = np.r_[1.0, -decay, np.zeros(latency)]
        loop[-1] += gain * (1.0 - decay)
        assert (np.abs(np.roots(loop)).max() < 1.0) == stable


def test_steps_of_nothing_allow_any_gain():
    assert largest_held_gain(1e-20, 0.02, 0) == inf


def test_hovers_with_a_rotor_at_rest_are_left_out():
    vehicle, gains = PRESETS["ar_drone_2"], GAIN_SETS["exact"]
    table = cross_table(vehicle, tilting=True)
    fed_back = attitude_feedback(gains, np.diag(vehicle.moments))
    hovers = [([0.0] * 4, [300.0] * 4), ([0.0] * 4, [0.0, 300.0, 300.0, 300.0])]
    settings = {"rotor_inertia": 1e-5, "decoupling": EXACT_DECOUPLING}
    found = reaction_gains(table, hovers, fed_back=fed_back, **settings)
    assert found.shape == (1, 3)
    assert reaction_gains(table, hovers[1:], fed_back=fed_back, **settings).shape == (0, 3)
