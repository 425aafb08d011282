"""The nearest red gait against the Two Color Map, brute force and differences."""

from __future__ import annotations

from math import atan, cos, pi, sin, tan

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tiltsim_controllers.analysis.singularity import determinant, margin_over_gait, residuals
from tiltsim_controllers.analysis.two_color_map import curve_l, red_residual
from tiltsim_controllers.gaits.colors import nearest_red_angles
from tiltsim_controllers.vehicle.cross import cross_torque, torque_free_inputs
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

VEHICLE = PRESETS["ar_drone_2"]
RATIO = drag_ratio(VEHICLE)
DELTA = atan(RATIO)
CLEARANCE = 0.1

angle = st.floats(-1.5, 1.5)
tilts = st.tuples(angle, angle, angle, angle)


def red(angles):
    """The nearest red gait of resting tilts, as four angles."""
    (a, _, _), (b, _, _) = nearest_red_angles(
        tuple((x, 0.0, 0.0) for x in angles), RATIO, CLEARANCE
    )
    return np.array([a, b, a, b])


@given(angle, angle)
def test_the_determinant_on_red_has_the_form_of_u_and_v(alpha_1, alpha_2):
    u, v = alpha_1 - DELTA, alpha_2 + DELTA
    beside_l = cos(DELTA) * sin(v - u) - 2.0 * sin(DELTA) * sin(u) * sin(v)
    expected = 4.0 * cos(u) * cos(v) * beside_l / (cos(DELTA) * sin(2.0 * DELTA))
    assert red_residual(alpha_1, alpha_2, VEHICLE) == pytest.approx(expected, abs=1e-12)


@given(st.floats(-1.4, 1.4))
def test_the_determinant_vanishes_on_the_curve_l(alpha_1):
    assert red_residual(alpha_1, float(curve_l(alpha_1, VEHICLE)), VEHICLE) == pytest.approx(
        0.0, abs=1e-12
    )
    u, v = alpha_1 - DELTA, float(curve_l(alpha_1, VEHICLE)) + DELTA
    assume(abs(u) > 1e-3 and abs(v) > 1e-3)
    assert 1.0 / tan(u) - 1.0 / tan(v) == pytest.approx(2.0 * RATIO, abs=1e-6)


@given(st.floats(0.05, pi / 2 - 0.05), st.floats(0.05, pi / 2 - 0.05))
def test_the_rotors_of_red_gaits_stop_on_the_sides_of_the_quadrant(low, high):
    """Hover on red needs squares of speeds as sin 2v to -sin 2u."""
    alpha_1, alpha_2 = DELTA - low, high - DELTA
    tilts = np.array([alpha_1, alpha_2, alpha_1, alpha_2])
    w1, w2, w3, w4 = torque_free_inputs(cross_torque(tilts, RATIO))
    assert (w3, w4) == (pytest.approx(w1, rel=1e-9), pytest.approx(w2, rel=1e-9))
    lengths = (cos(low) / sin(2.0 * low), cos(high) / sin(2.0 * high))
    assert -w1 * lengths[1] == pytest.approx(w2 * lengths[0], rel=1e-9)


@given(tilts)
def test_the_nearest_red_gait_is_clear_of_l(angles):
    found = red(angles)
    assert -(pi / 2 - CLEARANCE) <= found[0] - DELTA <= -CLEARANCE + 1e-12
    assert CLEARANCE - 1e-12 <= found[1] + DELTA <= pi / 2 - CLEARANCE + 1e-12
    assert red_residual(found[0], found[1], VEHICLE) > 0.0


@given(tilts, angle, angle)
def test_no_other_allowed_red_gait_is_nearer(angles, alpha_1, alpha_2):
    other = red((alpha_1, alpha_2, alpha_1, alpha_2))  # any allowed one
    nearest = red(angles)
    assert np.linalg.norm(nearest - angles) <= np.linalg.norm(other - angles) + 1e-12


@given(tilts)
def test_an_allowed_red_gait_is_its_own_nearest(angles):
    found = red(angles)
    np.testing.assert_allclose(red(found), found, atol=1e-15)


@given(tilts, st.floats(0.0, 0.9))
def test_on_the_way_the_margin_of_a_level_vehicle_grows(angles, share):
    means = 0.5 * (np.array(angles[:2]) + np.array(angles[2:]))
    gaps = np.abs(np.array(angles[:2]) - np.array(angles[2:]))
    assume((gaps < pi / 2).all() and means[0] < DELTA - CLEARANCE and means[1] > CLEARANCE - DELTA)
    assume((np.abs(means) < pi / 2 - DELTA - CLEARANCE).all())
    way = red(angles) - angles
    R, R_phi, R_theta = residuals(
        np.array([angles + s * way for s in (share, share + 0.1)]), VEHICLE
    )
    assert np.diff(R)[0] >= -1e-12
    assert np.diff(np.abs(R_phi))[0] <= 1e-12
    assert np.diff(np.abs(R_theta))[0] <= 1e-12


def test_pods_more_than_a_right_angle_apart_may_lean_further_before_they_lean_less():
    """The module's claim on the way from there: the margin of a level vehicle, in between."""
    start = np.array([-1.03, -1.21, -1.03, 1.91])
    way = red(start) - start
    leaning = [start + share * way for share in (0.0, 0.15, 1.0)]
    before, between, after = margin_over_gait(np.array(leaning), VEHICLE, 0.0, 0.0)
    assert between < before - 0.9
    assert after == pytest.approx(pi / 2)
    assert (determinant(np.array(leaning), 0.0, 0.0, VEHICLE) > 0.0).all()


def test_rates_are_derivatives_of_the_moving_angles():
    def moving(time):
        return tuple(
            (a + r * time + 0.5 * c * time**2, r + c * time, c)
            for a, r, c in ((-0.3, 0.2, 1.0), (0.5, -0.3, 0.4), (0.2, 0.5, 0.1), (0.1, 0.7, -0.6))
        )

    step = 1e-4
    before, now, after = (
        nearest_red_angles(moving(t), RATIO, CLEARANCE) for t in (-step, 0.0, step)
    )
    for low, middle, high in zip(before, now, after, strict=True):
        assert middle[1] == pytest.approx((high[0] - low[0]) / (2.0 * step), abs=1e-7)
        assert middle[2] == pytest.approx((high[1] - low[1]) / (2.0 * step), abs=1e-7)
