"""Rotations: the axioms of their group, and agreement between their three descriptions."""

from __future__ import annotations

from math import cos, isfinite, pi, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tiltsim_controllers.mathematics.attitude import (
    euler_angles,
    euler_of_rotation,
    quaternion_of_euler,
    quaternion_of_rotation,
    rotation_matrix,
    rotation_of_quaternion,
)

eulers = st.tuples(st.floats(-pi, pi), st.floats(-pi / 2, pi / 2), st.floats(-pi, pi))
regular_eulers = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)
quick = settings(deadline=None, max_examples=60)


def matrix_of_quaternion(q):
    """The textbook rotation ``v -> q v q*``."""
    w, v = q[0], np.array(q[1:])
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross


def product(p, q):
    """The Hamilton product."""
    p_vector, q_vector = np.array(p[1:]), np.array(q[1:])
    vector = p[0] * q_vector + q[0] * p_vector + np.cross(p_vector, q_vector)
    return np.array([p[0] * q[0] - p_vector @ q_vector, *vector])


def is_vertical(q):
    """Whether the pitch is near enough to +-90 degrees that the angles lose digits."""
    w, x, y, z = q
    return abs(2 * (w * y - z * x)) > 0.999


def test_zero_angles_are_the_identity():
    np.testing.assert_array_equal(rotation_matrix(np.zeros(3)), np.eye(3))
    np.testing.assert_array_equal(quaternion_of_euler(np.zeros(3)), [1, 0, 0, 0])
    np.testing.assert_array_equal(euler_angles([1.0, 0.0, 0.0, 0.0]), np.zeros(3))


@quick
@given(eulers)
def test_rotation_is_roll_then_pitch_then_yaw_about_fixed_axes(euler):
    roll, pitch, yaw = euler
    about_x = [[1, 0, 0], [0, cos(roll), -sin(roll)], [0, sin(roll), cos(roll)]]
    about_y = [[cos(pitch), 0, sin(pitch)], [0, 1, 0], [-sin(pitch), 0, cos(pitch)]]
    about_z = [[cos(yaw), -sin(yaw), 0], [sin(yaw), cos(yaw), 0], [0, 0, 1]]
    expected = np.array(about_z) @ about_y @ about_x
    np.testing.assert_allclose(rotation_matrix(euler), expected, rtol=0, atol=1e-15)


@quick
@given(eulers)
def test_rotation_is_orthogonal_and_keeps_hands(euler):
    turn = rotation_matrix(euler)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), rtol=0, atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0, abs=1e-15)


@quick
@given(eulers)
def test_quaternion_turns_as_the_matrix_does(euler):
    q = quaternion_of_euler(euler)
    np.testing.assert_allclose(matrix_of_quaternion(q), rotation_matrix(euler), rtol=0, atol=1e-15)


@quick
@given(regular_eulers)
def test_angles_survive_the_way_through_a_quaternion(euler):
    assert euler_angles(quaternion_of_euler(euler)) == pytest.approx(euler, abs=1e-13)


@quick
@given(quaternions)
def test_opposite_quaternions_are_the_same_attitude(q):
    assert euler_angles(-q) == pytest.approx(euler_angles(q), abs=1e-15)


@quick
@given(quaternions, quaternions)
def test_products_of_quaternions_are_products_of_rotations(p, q):
    composed = product(p, q)
    assume(not is_vertical(composed))
    expected = matrix_of_quaternion(p) @ matrix_of_quaternion(q)
    turned = rotation_matrix(euler_angles(composed))
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-12)


@quick
@given(quaternions)
def test_the_conjugate_is_the_inverse(q):
    w, x, y, z = q
    assume(not is_vertical((w, x, y, z)) and not is_vertical((w, -x, -y, -z)))
    there = rotation_matrix(euler_angles((w, x, y, z)))
    back = rotation_matrix(euler_angles((w, -x, -y, -z)))
    np.testing.assert_allclose(there @ back, np.eye(3), rtol=0, atol=1e-12)


@quick
@given(quaternions)
def test_a_rotation_gives_its_quaternion_back(q):
    found = quaternion_of_rotation(matrix_of_quaternion(q))
    np.testing.assert_allclose(found * np.sign(found @ q), q, atol=1e-12)
    longer = quaternion_of_rotation(1.001 * matrix_of_quaternion(q))
    assert np.linalg.norm(longer) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rounding_at_vertical_pitch_does_not_leave_the_domain(sign):
    half = 0.5**0.5 * (1 + 1e-12)
    roll, pitch, yaw = euler_angles((half, 0.0, sign * half, 0.0))
    assert pitch == sign * pi / 2
    assert isfinite(roll)
    assert isfinite(yaw)


@quick
@given(quaternions)
def test_the_matrix_of_a_quaternion_turns_vectors_as_it_does(q):
    expected = matrix_of_quaternion(q)
    np.testing.assert_allclose(rotation_of_quaternion(q), expected, rtol=0, atol=1e-15)
    assume(abs(expected[2, 0]) < 1.0 - 1e-12)  # else rounding makes roll and yaw
    angles = rotation_matrix(euler_of_rotation(expected))
    np.testing.assert_allclose(angles, expected, rtol=0, atol=1e-7)
