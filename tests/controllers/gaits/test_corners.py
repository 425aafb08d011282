"""Rounded corners of gaits, for the attitude."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tiltsim_controllers.analysis.two_color_planner import Circle, four_angle_gait
from tiltsim_controllers.gaits.motion import anticipated_tilts, rounded_corner
from tiltsim_controllers.gaits.plans import continuous_trot, fixed, keyframes
from tiltsim_controllers.vehicle.parameters import PRESETS

VEHICLE = PRESETS["ar_drone_2"]
quick = settings(deadline=None, max_examples=60)


def ramp(x, half):
    """The ramp max(x, 0), rounded within half of its corner."""
    return rounded_corner(*np.array([[0.0], [0.0], [half + x], [1.0]]), half)[0]


def differences(function, step=1e-4):
    """Value with first and second derivative at zero, fourth-order accurate."""
    f = {k: np.array(function(k * step)) for k in (-2, -1, 0, 1, 2)}
    first = (f[-2] - 8 * f[-1] + 8 * f[1] - f[2]) / (12 * step)
    second = (-f[-2] + 16 * f[-1] - 30 * f[0] + 16 * f[1] - f[2]) / (12 * step**2)
    return f[0], first, second


@quick
@given(st.floats(-0.199, 0.199))
def test_a_corner_has_its_derivatives(x):
    half = 0.2
    _, first, second = ramp(x, half)
    if min(abs(x - half), abs(x + half)) < 1e-3:
        return
    found = differences(lambda t: [ramp(x + t, half)[0]])
    assert (first, second) == pytest.approx((found[1][0], found[2][0]), abs=1e-5)


def test_the_errors_before_and_after_a_corner_cancel():
    rates = np.array([ramp(x, 0.2)[1] for x in np.linspace(-0.2, 0.2, 201)])
    np.testing.assert_allclose(rates + rates[::-1], 1.0, atol=1e-13)


@quick
@given(st.floats(-2, 2), st.floats(-3, 3), st.floats(-3, 3), st.floats(0.0, 0.4))
def test_a_corner_is_found_from_the_ends_of_its_window(start, before, after, at):
    half = 0.2
    stop = start + before * at + after * (2 * half - at)
    found = rounded_corner(*np.array([[start], [before], [stop], [after]]), half)[0]
    smooth = ramp(half - at, half)
    line = start + before * half
    expected = (line + (after - before) * smooth[0], before + (after - before) * smooth[1])
    assert found[:2] == pytest.approx(expected, abs=1e-8)


WALK = keyframes(
    [(0.0, 0.1, 0.2, 0.0, 0.3), (0.4, 0.5, -0.2, 0.1, 0.3), (1.0, 0.1, 0.2, 0.0, 0.3)], 2.0
)


def anticipated(gait, time, half):
    """Angles, rates and accelerations, shape (3, tilts)."""
    return anticipated_tilts(time, gait.parameters, np.array(gait.knots), 4, half).T


@pytest.mark.parametrize("gait", [continuous_trot(0.6, 1.0), WALK], ids=["trot", "keyframes"])
def test_anticipated_tilts_are_smooth_and_the_gait_itself_away_from_corners(gait):
    half = min(0.1, 0.5 * gait.min_segment_time)
    for time in np.linspace(0.003, 1.99, 97):
        _, rates, accelerations = anticipated(gait, time, half)
        expected = differences(lambda t, time=time: anticipated(gait, time + t, half)[0])
        np.testing.assert_allclose(rates, expected[1], atol=1e-4)
        np.testing.assert_allclose(accelerations, expected[2], atol=0.2)
    straight = 0.4 if gait is WALK else 0.25
    np.testing.assert_allclose(
        anticipated(gait, straight, half)[0], gait.angles(straight), atol=1e-14
    )


@pytest.mark.parametrize("gait", [continuous_trot(0.6, 1.0), WALK], ids=["trot", "keyframes"])
def test_without_anticipation_the_gait_is_itself(gait):
    for time in np.linspace(0.003, 1.99, 31):
        np.testing.assert_allclose(anticipated(gait, time, 0.0).T, gait.jets(time), atol=1e-15)


def test_smooth_gaits_are_left_alone():
    circle = four_angle_gait(Circle("blue", (0.1, -0.2), 0.3), 2.0, VEHICLE).biased(0.9).scaled(1.5)
    for time in (0.0, 0.3, 1.7):
        motion = anticipated(circle, time, 0.1)
        found = differences(lambda t, time=time: circle.angles(time + t), 1e-3)
        for order, tolerance in enumerate((1e-14, 1e-8, 1e-6)):
            np.testing.assert_allclose(motion[order], found[order], atol=tolerance)
    assert fixed([0.1] * 4).min_segment_time == float("inf")
