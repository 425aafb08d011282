"""Attainable sets against linear programming and against ch. 9."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from tiltsim_controllers.analysis.attainable import (
    attainable_accelerations,
    attainable_torque_thrust,
    box_slice_vertices,
    input_box,
    published_speed_limits,
)
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix
from tiltsim_controllers.vehicle.parameters import PRESETS

AR_DRONE = PRESETS["ar_drone_2"]
LIMITS = published_speed_limits(AR_DRONE)

tilt = st.floats(-1.2, 1.2)


def angles_of(number: int, *, exact: bool = False) -> np.ndarray:
    published = PUBLISHED_GAITS[f"ch09_gait_{number}"]
    gait = published.exact if exact else published.gait
    assert gait is not None
    return gait.angles(0.0)


def wrench(angles):
    arm = AR_DRONE.arm_length * AR_DRONE.thrust_coefficient
    return torque_matrix(angles, AR_DRONE) * arm, force_matrix(angles) * AR_DRONE.thrust_coefficient


def test_published_speed_limits() -> None:
    assert pytest.approx((305.27, 394.10), abs=5e-3) == LIMITS


@settings(max_examples=25, deadline=None)
@given(
    angles=st.tuples(tilt, tilt, tilt, tilt),
    thrust=st.one_of(st.none(), st.floats(2.5, 4.5)),
    seed=st.integers(0, 2**16),
)
def test_support_function_agrees_with_a_linear_program(angles, thrust, seed) -> None:
    """The farthest vertex along any direction is the optimum of the LP over rotor inputs."""
    torque, force = wrench(angles)
    lower, upper = input_box(LIMITS)
    image = np.stack([torque[0], torque[1], force[2]])
    found = attainable_torque_thrust(angles, AR_DRONE, LIMITS, vertical_thrust=thrust)
    rows, values = [torque[2] * 1e6], [0.0]
    if thrust is not None:
        rows, values = [*rows, force[2] * 1e5], [*values, thrust * 1e5]
    # The solver works in units of 1e5 rad^2/s^2.
    bounds = np.stack([lower, upper], axis=1) / 1e5
    rows, values = np.array(rows) * 1e5, np.array(values)
    for direction in np.random.default_rng(seed).normal(size=(4, 3)):
        direction = direction / [0.1, 0.1, 4.0]
        cost = direction @ image * 1e5
        result = linprog(-cost, A_eq=rows, b_eq=values, bounds=bounds)
        if found.is_empty:
            assert result.status == 2
            continue
        assume(result.status == 0)
        assert (found.vertices @ direction).max() == pytest.approx(-result.fun, abs=1e-6)


@given(
    angles=st.tuples(tilt, tilt, tilt, tilt),
    share=st.lists(st.floats(0, 1), min_size=4, max_size=4),
)
def test_every_admissible_input_lies_within(angles, share) -> None:
    lower, upper = input_box(LIMITS)
    w = lower + np.array(share) * (upper - lower)
    torque, force = wrench(angles)
    found = attainable_torque_thrust(angles, AR_DRONE, LIMITS, yaw_torque=None)
    assume(found.dimension == 3)
    point = np.array([torque[0] @ w, torque[1] @ w, force[2] @ w])
    hull = ConvexHull(found.vertices)
    assert (hull.equations[:, :3] @ point + hull.equations[:, 3]).max() < 1e-9


@given(angles=st.tuples(tilt, tilt, tilt, tilt))
def test_inputs_reach_their_vertices_within_the_limits(angles) -> None:
    found = attainable_torque_thrust(angles, AR_DRONE, LIMITS)
    lower, upper = input_box(LIMITS)
    torque, force = wrench(angles)
    assert (found.inputs >= lower - 1e-3).all()
    assert (found.inputs <= upper + 1e-3).all()
    np.testing.assert_allclose(found.inputs @ torque[2], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.inputs @ force[2], found.vertices[:, 2], atol=1e-9)


def test_slice_of_a_box_without_conditions_is_the_box() -> None:
    lower, upper = -np.ones(4), np.ones(4)
    vertices = box_slice_vertices(lower, upper, np.empty((0, 4)), np.empty(0))
    assert len(vertices) == 16
    one = box_slice_vertices(lower, upper, np.array([[1.0, 0.0, 0.0, 0.0]]), np.array([0.5]))
    assert len(one) == 8
    none = box_slice_vertices(lower, upper, np.array([[1.0, 1.0, 1.0, 1.0]]), np.array([4.5]))
    assert len(none) == 0


@pytest.mark.parametrize("number", [1, 4])
def test_gaits_1_and_4_cannot_free_themselves_of_yaw(number) -> None:
    assert attainable_torque_thrust(angles_of(number), AR_DRONE, LIMITS).is_empty


@pytest.mark.parametrize("number", [2, 3])
def test_gaits_2_and_3(number) -> None:
    """F_Z from 2.63 to 4.39 N; at 4.2 N 0.12 m/s^2 to the sides, where ch. 9 has 2 m/s^2."""
    found = attainable_torque_thrust(angles_of(number), AR_DRONE, LIMITS)
    assert found.dimension == 3
    assert (found.lower[2], found.upper[2]) == pytest.approx((2.63, 4.39), abs=5e-3)
    slice_ = attainable_torque_thrust(angles_of(number), AR_DRONE, LIMITS, vertical_thrust=4.2)
    assert slice_.dimension == 2
    sideways = attainable_accelerations(angles_of(number), AR_DRONE, LIMITS)
    np.testing.assert_allclose(sideways.upper, 0.12, atol=5e-4)
    np.testing.assert_allclose(sideways.lower, -0.12, atol=5e-4)


def test_linear_coupling_of_blue_gaits_is_their_loss_of_rank() -> None:
    """On the exact blue lines a slice of constant thrust is a line; gait 6 cannot carry 4.2 N."""
    for number in (5, 7, 8):
        angles = angles_of(number, exact=True)
        assert attainable_torque_thrust(angles, AR_DRONE, LIMITS).dimension == 2
        at_hover = attainable_torque_thrust(angles, AR_DRONE, LIMITS, vertical_thrust=4.2)
        assert at_hover.dimension == 1
    sixth = attainable_torque_thrust(angles_of(6, exact=True), AR_DRONE, LIMITS)
    assert sixth.upper[2] == pytest.approx(3.873, abs=1e-3)


@pytest.mark.parametrize("limits", [(-1.0, 300.0), (300.0, 300.0), (0.0, float("inf"))])
def test_bad_limits_are_refused(limits) -> None:
    with pytest.raises(ValueError, match="rotor speed limits"):
        attainable_torque_thrust([0.0] * 4, AR_DRONE, limits)


def test_a_set_of_one_point_and_an_empty_one():
    thrust = 4.0 * AR_DRONE.thrust_coefficient * LIMITS[1] ** 2
    full = attainable_torque_thrust((0.0,) * 4, AR_DRONE, LIMITS, vertical_thrust=thrust)
    assert (full.dimension, full.is_empty, len(full.vertices)) == (0, False, 1)
    np.testing.assert_allclose(full.lower, [0.0, 0.0, thrust], atol=1e-12)
    np.testing.assert_array_equal(full.lower, full.upper)
    np.testing.assert_allclose(np.abs(full.inputs), [[LIMITS[1] ** 2] * 4], rtol=1e-12)
    heavy = attainable_torque_thrust((0.0,) * 4, AR_DRONE, LIMITS, vertical_thrust=9.0)
    assert (heavy.dimension, heavy.is_empty, len(heavy.vertices)) == (-1, True, 0)
    assert np.isnan(heavy.lower).all()
    assert np.isnan(heavy.upper).all()


def test_the_published_limits_belong_to_3_and_5_newtons():
    least, greatest = published_speed_limits(AR_DRONE)
    assert 4.0 * AR_DRONE.thrust_coefficient * least**2 == pytest.approx(3.0)
    assert 4.0 * AR_DRONE.thrust_coefficient * greatest**2 == pytest.approx(5.0)
