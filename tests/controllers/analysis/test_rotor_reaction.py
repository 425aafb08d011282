"""The loop that a measured angular acceleration closes through the rotors' reaction."""

from __future__ import annotations

from math import exp, inf

import numpy as np
import pytest

from tiltsim_controllers.analysis.rotor_reaction import largest_held_gain, reaction_gains
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING
from tiltsim_controllers.laws.gains import GAIN_SETS
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


def test_tilts_without_a_hover_are_left_out():
    tilts = np.array([[0.0] * 4, [np.pi / 2] * 4])
    gains = GAIN_SETS["exact"]
    found = reaction_gains(tilts, gains, PRESETS["ar_drone_2"], 1e-5, EXACT_DECOUPLING)
    assert found.shape == (1, 3)
    assert reaction_gains(tilts[1:], gains, PRESETS["ar_drone_2"], 1e-5, 0.0).shape == (0, 3)
