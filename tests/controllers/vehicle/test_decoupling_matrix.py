"""The factored decoupling matrix against ch. 3's matrices, written out in NumPy."""

from __future__ import annotations

from itertools import product
from math import atan, pi

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.mathematics.linear import solved
from tiltsim_controllers.vehicle.cross import (
    cross_force,
    cross_torque,
    torque_free_force,
    torque_free_inputs,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, Vehicle, drag_ratio

PIGEON = Vehicle(
    mass=0.05,
    inertia_xx=2e-5,
    inertia_yy=3e-5,
    inertia_zz=4e-5,
    arm_length=0.07,
    thrust_coefficient=3e-7,
    drag_coefficient=1.5e-8,  # drag ratio 0.71, far from the thesis's 0.17
    gravity=3.7,
)
VEHICLES = [*PRESETS.values(), PIGEON]

vehicles = st.sampled_from(VEHICLES)
angles = st.tuples(*[st.floats(-pi, pi)] * 4)
attitudes = st.tuples(st.floats(-pi, pi), st.floats(-pi / 2, pi / 2))

quick = settings(deadline=None, max_examples=40)


def world_up(roll, pitch):
    """Third row of ch. 3, Eq. (2)."""
    return np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])


def decoupling_matrix(vehicle, alpha, up):
    """Ch. 3, Eq. (16), rows in units of L K_f and K_f."""
    kf, lkf = vehicle.thrust_coefficient, vehicle.arm_length * vehicle.thrust_coefficient
    return np.vstack([torque_matrix(vehicle, alpha) / lkf, up @ force_matrix(vehicle, alpha) / kf])


def torques(vehicle, alpha):
    return cross_torque(np.array(alpha), drag_ratio(vehicle))


def force_direction(vehicle, alpha):
    return torque_free_force(np.array(alpha), drag_ratio(vehicle))


@quick
@given(vehicles, angles)
def test_the_matrices_are_eqs_3_and_5(vehicle, alpha):
    kf, lkf = vehicle.thrust_coefficient, vehicle.arm_length * vehicle.thrust_coefficient
    force, torque = force_matrix(vehicle, alpha) / kf, torque_matrix(vehicle, alpha) / lkf
    np.testing.assert_allclose(torques(vehicle, alpha), torque, rtol=0, atol=1e-14)
    np.testing.assert_allclose(cross_force(np.array(alpha)), force, rtol=0, atol=1e-14)


@quick
@given(vehicles, angles, attitudes)
def test_determinant_has_the_closed_form(vehicle, alpha, attitude):
    up = world_up(*attitude)
    tau, force = torque_matrix(vehicle, alpha), force_matrix(vehicle, alpha)
    kf, km, arm = vehicle.thrust_coefficient, vehicle.drag_coefficient, vehicle.arm_length
    scale = 2 * arm**2 * kf**3 * km
    determinant = np.linalg.det(np.vstack([tau, up @ force]))
    closed_form = force_direction(vehicle, alpha) @ up
    assert determinant / scale == pytest.approx(closed_form, abs=1e-12 / drag_ratio(vehicle))


def coefficients(r):
    """R, R_phi, R_theta for any drag ratio, as the factor of each product.

    A key such as ``ccsc`` stands for cos(alpha_1) cos(alpha_2) sin(alpha_3) cos(alpha_4).
    """
    a, b, half = 1 / r - 2 * r, 1 - r * r, (1 / r - r) / 2
    upright = {"cccc": 4.0}
    upright |= {"cccs": a, "ccsc": -a, "cscc": a, "sccc": -a}
    upright |= {"ccss": b, "cssc": b, "sccs": b, "sscc": b, "cscs": -2.0, "scsc": -2.0}
    upright |= {"csss": -r, "scss": r, "sscs": -r, "sssc": r}
    by_roll = {"ccsc": 1.0, "sccc": -1.0, "csss": -1.0, "sscs": 1.0}
    by_roll |= {"ccss": half, "cssc": half, "sccs": -half, "sscc": -half}
    by_pitch = {"cccs": 1.0, "cscc": -1.0, "scss": -1.0, "sssc": 1.0}
    by_pitch |= {"ccss": -half, "cssc": half, "sccs": -half, "sscc": half}
    return upright, by_roll, by_pitch


# Ch. 3, Eq. (17), with two factors put right: the two products -2.880 (...) s(phi) printed with
# s1 c2 s3 s4 and s1 s2 c3 s4 are s1 c2 c3 s4 and s1 s2 c3 c4.
PUBLISHED_UPRIGHT = {
    **{"cccc": 4.000, "cccs": 5.592, "ccsc": -5.592, "cscc": 5.592, "sccc": -5.592},
    **{"ccss": 0.9716, "cscs": -2.000, "cssc": 0.9716, "sccs": 0.9716, "scsc": -2.000},
    **{"sscc": 0.9716, "csss": -0.1687, "scss": 0.1687, "sscs": -0.1687, "sssc": 0.1687},
}
PUBLISHED_BY_ROLL = {
    **{"ccsc": 1.000, "sccc": -1.000, "csss": -1.000, "sscs": 1.000},
    **{"ccss": 2.880, "cssc": 2.880, "sccs": -2.880, "sscc": -2.880},
}
PUBLISHED_BY_PITCH = {
    **{"cccs": 1.000, "cscc": -1.000, "scss": -1.000, "sssc": 1.000},
    **{"ccss": -2.880, "cssc": 2.880, "sccs": -2.880, "sscc": 2.880},
}


def evaluate(polynomial, alpha):
    value = {"c": np.cos(alpha), "s": np.sin(alpha)}
    return sum(
        factor * np.prod([value[letter][rotor] for rotor, letter in enumerate(key)])
        for key, factor in polynomial.items()
    )


@quick
@given(vehicles, angles)
def test_torque_free_force_is_made_of_the_general_polynomials(vehicle, alpha):
    upright, by_roll, by_pitch = coefficients(drag_ratio(vehicle))
    expected = [-evaluate(by_pitch, alpha), evaluate(by_roll, alpha), evaluate(upright, alpha)]
    np.testing.assert_allclose(force_direction(vehicle, alpha), expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("axis", "sign", "published"),
    [(2, 1, PUBLISHED_UPRIGHT), (1, 1, PUBLISHED_BY_ROLL), (0, -1, PUBLISHED_BY_PITCH)],
    ids=["R", "R_phi", "R_theta"],
)
def test_published_coefficients_come_out_to_four_digits(axis, sign, published):
    # Each product is 1 at one corner of {0, pi/2}^4 and 0 at all others.
    for letters in product("cs", repeat=4):
        corner = [0.0 if letter == "c" else pi / 2 for letter in letters]
        value = sign * force_direction(PRESETS["ar_drone_2"], corner)[axis]
        printed = published.get("".join(letters), 0.0)
        digits = 4 if abs(printed) < 1 else 3
        assert round(value, digits) == printed, "".join(letters)


@quick
@given(vehicles, angles)
def test_torque_free_inputs_make_no_torque(vehicle, alpha):
    w = torque_free_inputs(torques(vehicle, alpha))
    tau = torque_matrix(vehicle, alpha)
    residual = np.abs(tau @ w).max()
    assert residual <= 1e-13 * np.linalg.norm(tau) * max(1.0, np.linalg.norm(w))


@quick
@given(vehicles, angles)
def test_torque_free_inputs_span_the_kernel_where_the_rank_is_three(vehicle, alpha):
    _, values, rows = np.linalg.svd(torque_matrix(vehicle, alpha))
    assume(values[2] > 1e-2 * values[0])
    w = torque_free_inputs(torques(vehicle, alpha))
    assert np.linalg.norm(w) > 1e-4
    cosine = rows[3] @ w / np.linalg.norm(w)
    assert abs(cosine) == pytest.approx(1.0, abs=1e-12)


@quick
@given(vehicles, st.floats(-pi, pi), st.floats(-pi, pi))
def test_red_gaits_push_straight_up_or_down(vehicle, alpha_1, alpha_2):
    nx, ny, _ = force_direction(vehicle, (alpha_1, alpha_2, alpha_1, alpha_2))
    assert abs(nx) < 1e-14
    assert abs(ny) < 1e-14


@quick
@given(vehicles, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_blue_gaits_have_no_torque_free_force(vehicle, alpha_1, alpha_2):
    twice_delta = 2 * atan(drag_ratio(vehicle))
    alpha = (alpha_1, alpha_2, twice_delta - alpha_1, -twice_delta - alpha_2)
    assert np.abs(force_direction(vehicle, alpha)).max() < 1e-14
    assert np.linalg.matrix_rank(torque_matrix(vehicle, alpha), tol=1e-15) <= 2


@quick
@given(vehicles, angles, attitudes, st.tuples(*[st.floats(-100.0, 100.0)] * 4))
def test_cramers_rule_solves_the_four_by_four_system(vehicle, alpha, attitude, right):
    up = world_up(*attitude)
    matrix = decoupling_matrix(vehicle, alpha, up)
    condition = np.linalg.cond(matrix)
    assume(condition < 1e3)
    expected = np.linalg.solve(matrix, right)
    bound = 1e-14 * condition * max(1.0, np.linalg.norm(expected))
    np.testing.assert_allclose(solved(matrix, np.array(right)), expected, rtol=0, atol=bound)
