"""The roll-pitch plane: closed form, regions and distances against the determinant itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tiltsim.views.attitude_plane import (
    HALF_WIDTH,
    attitude_of,
    nearest_singular,
    singular_curves,
    torque_free_directions,
    unreachable_pitch,
)
from tiltsim_controllers.analysis.singularity import (
    determinant,
    residuals,
    singularity_margin,
    unacceptable_attitudes,
    world_up,
)
from tiltsim_controllers.vehicle.parameters import PRESETS

VEHICLE = PRESETS["ar_drone_2"]
TROT = (-0.65, -0.65, 0.65, 0.65)
LEVEL = (0.0, 0.0, 0.0, 0.0)
angle = st.floats(-1.2, 1.2)
tilts = st.tuples(angle, angle, angle, angle)


def normals(*angles):
    columns = {f"alpha_{i}": np.array([row[i - 1] for row in angles]) for i in (1, 2, 3, 4)}
    return torque_free_directions(columns, VEHICLE)


@given(tilts)
def test_the_curve_is_the_closed_form_of_the_unacceptable_attitudes(angles):
    n = normals(angles)
    R, R_phi, R_theta = (float(part) for part in residuals(angles, VEHICLE))
    if abs(R_theta) < 1e-6 or not n.any():
        return
    roll, pitch = singular_curves(n)[0].T
    expected = np.arctan(-(R * np.cos(roll) + R_phi * np.sin(roll)) / R_theta)
    inner = np.abs(pitch) < HALF_WIDTH - 1e-6
    np.testing.assert_allclose(pitch[inner], expected[inner], atol=1e-6)


@given(tilts)
def test_the_determinant_vanishes_on_the_curve(angles):
    n = normals(angles)
    roll, pitch = singular_curves(n)[0].T
    drawn = np.isfinite(roll)
    np.testing.assert_allclose(world_up(roll[drawn], pitch[drawn]) @ n[0], 0.0, atol=1e-9)


def test_curves_of_many_instants_equal_single_instants():
    angles = [TROT, (0.3, -0.2, 0.1, 0.4)]
    for curve, alone in zip(singular_curves(normals(*angles), 183), angles, strict=True):
        expected = unacceptable_attitudes(alone, VEHICLE, 181)
        np.testing.assert_allclose(curve[1:-1, 0], expected.roll, atol=1e-12)
        np.testing.assert_allclose(curve[1:-1, 1], expected.pitch, atol=1e-12)


def test_a_vertical_line_is_followed():
    curve = singular_curves(np.array([[0.0, np.sin(0.4), np.cos(0.4)]]))[0]
    steep = curve[np.abs(curve[:, 1]) < 1.5]
    np.testing.assert_allclose(steep[:, 0], 0.4 - np.pi / 2, atol=1e-12)
    assert np.ptp(steep[:, 1]) > 2.8


@pytest.mark.parametrize("n", [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0)])
def test_there_is_no_curve_if_no_or_every_attitude_is_singular(n):
    assert np.isnan(singular_curves(np.array([n]))).all()


@given(tilts, st.sampled_from([1.0, -1.0]))
def test_attitudes_are_unreachable_where_the_determinant_has_the_other_sign(angles, side):
    n = normals(angles)
    roll = np.linspace(-1.5, 1.5, 13)
    intervals = unreachable_pitch(n, side, roll)[0]
    pitch = np.linspace(-1.55, 1.55, 41)
    sign = world_up(roll[:, np.newaxis], pitch) @ n[0] * side
    low, high = intervals.T[..., np.newaxis]
    inside = (pitch > low) & (pitch < high)
    clear = np.abs(sign) > 1e-9
    np.testing.assert_array_equal(inside[clear], sign[clear] < 0.0)


def test_all_attitudes_are_unreachable_if_tau_is_singular_and_none_if_n_is_vertical():
    roll = np.linspace(-1.0, 1.0, 5)
    everything = unreachable_pitch(np.zeros((1, 3)), 1.0, roll)[0]
    np.testing.assert_array_equal(everything, np.tile([-HALF_WIDTH, HALF_WIDTH], (5, 1)))
    nothing = unreachable_pitch(normals(LEVEL), 1.0, roll)[0]
    np.testing.assert_array_equal(nothing[:, 0], nothing[:, 1])


@given(tilts, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_the_nearest_singular_attitude_is_one_margin_away(angles, roll, pitch):
    n = normals(angles)
    margin = abs(float(singularity_margin(angles, VEHICLE, roll, pitch)))
    if not n.any() or margin > 1.57:
        return
    there = nearest_singular(n, np.array([[roll, pitch]]))[0]
    cosine = float(world_up(roll, pitch) @ world_up(*there))
    assert np.arccos(np.clip(cosine, -1.0, 1.0)) == pytest.approx(margin, abs=1e-6)
    scale = np.linalg.norm(residuals(angles, VEHICLE))
    assert abs(determinant(angles, *there, VEHICLE)) < 1e-6 * scale


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5))
def test_attitude_of_undoes_world_up(roll, pitch):
    np.testing.assert_allclose(attitude_of(world_up(roll, pitch)), (roll, pitch), atol=1e-9)
