"""The supervisor against the singularity analysis for arrays, and in flight."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tiltsim
from controllers.singularity import determinant, margin_over_gait
from controllers.supervisor import Supervisor, allowed_scale, gait_share
from controllers.vehicle import PRESETS, drag_ratio
from tiltsim.errors import InputError

VEHICLE = PRESETS["ar_drone_2"]
RATIO = drag_ratio(VEHICLE)
WATCH = Supervisor(min_margin=0.3, min_determinant=1.0)
SCENARIO = "beyond/supervisor#supervised"

angles = st.tuples(*[st.floats(-1.5, 1.5)] * 4)
leans = st.floats(-0.5, 0.5)


def regular(scales, tilts, roll, pitch):
    """Whether scaled tilts meet the thresholds, by the array code."""
    scaled = np.multiply.outer(scales, tilts)
    margins = margin_over_gait(scaled, VEHICLE, roll, pitch)
    return (margins >= WATCH.min_margin) & (
        determinant(scaled, roll, pitch, VEHICLE) >= WATCH.min_determinant
    )


@settings(deadline=None, max_examples=150)
@given(angles, leans, leans)
def test_what_passes_is_regular_and_a_little_more_is_not(tilts, roll, pitch):
    scale = allowed_scale(tilts, roll, pitch, WATCH, RATIO)
    assert 0.0 <= scale <= 1.0
    if scale == 0.0 and not regular([0.0], tilts, roll, pitch)[0]:
        return  # the vehicle leans too far for any gait
    assert regular([max(0.0, scale - 1e-9)], tilts, roll, pitch).all()
    assert regular(np.arange(17)[np.arange(17) / 16 <= scale] / 16, tilts, roll, pitch).all()
    if scale < 1.0:
        assert not regular([min(1.0, scale + 1e-6)], tilts, roll, pitch).all()


def test_without_thresholds_everything_passes():
    wild = (3.0, -2.0, 1.0, 2.5, 0.0, 0.0, 0.0, 0.0)
    assert gait_share(wild, 2.0, 1.0, Supervisor(), RATIO) == 1.0


def test_a_vehicle_that_leans_too_far_gets_no_tilt():
    assert allowed_scale((0.2, 0.1, 0.2, 0.1), 1.4, 0.0, WATCH, RATIO) == 0.0


def test_a_gait_across_the_curve_l_stops_before_it():
    """On red the margin is a right angle up to L: the determinant alone sees it come."""
    across = (0.4, -0.2, 0.4, -0.2)
    margin_alone = Supervisor(min_margin=0.3)
    assert determinant(np.array(across), 0.0, 0.0, VEHICLE) < 0.0
    stopped = allowed_scale(across, 0.0, 0.0, margin_alone, RATIO)
    at_l = np.array(across) * stopped
    assert abs(determinant(at_l, 0.0, 0.0, VEHICLE)) < 1e-4
    kept = allowed_scale(across, 0.0, 0.0, WATCH, RATIO)
    assert determinant(np.array(across) * kept, 0.0, 0.0, VEHICLE) == pytest.approx(1.0, abs=1e-4)


def test_engines_fly_the_same_supervised_flight_and_show_what_passed():
    short = {"simulation.duration": 1.6}
    python, native = (
        tiltsim.simulate(tiltsim.load_scenario(SCENARIO, {**short, "simulation.engine": engine}))
        for engine in ("python", "native")
    )
    np.testing.assert_array_equal(python.samples, native.samples)
    told = np.stack([python[f"alpha_ref_{rotor}"] for rotor in (1, 2, 3, 4)], axis=-1)
    reached = determinant(told, python["roll"], python["pitch"], VEHICLE)
    assert reached.min() == pytest.approx(2.0, abs=1e-4)
    assert np.abs(told - np.stack([python[f"alpha_{i}"] for i in (1, 2, 3, 4)], -1)).max() < 0.01


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"controller.supervisor.min_margin": 1.6}, "controller.supervisor.min_margin = 1.6"),
    ],
)
def test_mistakes_are_one_line(changes, message):
    with pytest.raises(InputError) as caught:
        tiltsim.load_scenario(SCENARIO, changes)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
