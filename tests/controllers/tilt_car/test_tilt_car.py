"""The tilt-car's laws against ch. 10's and 11's printed formulas."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from tiltsim_controllers.gaits.motion import FIXED, GaitParameters
from tiltsim_controllers.laws.keys import choice
from tiltsim_controllers.references.trajectories import (
    CIRCLE,
    LINE,
    ReferenceParameters,
    reference_motion,
)
from tiltsim_controllers.tilt_car import laws
from tiltsim_controllers.tilt_car.vehicle import (
    THESIS_CAR,
    TiltCar,
    acceleration,
    counter_yaw_per_tilt,
    input_matrix,
    squared_speeds,
    thrust_map,
    turn_per_tilt,
)

CAR = TiltCar(1.3, 0.0012, 0.0007, 0.45, 0.0008)
CIRCLE_10 = ReferenceParameters(CIRCLE, (10.0, 0.0, 0.0), radius=-10.0, angular_frequency=1.0)

angles = st.floats(-4.0, 4.0)
speeds = st.floats(5.0, 300.0)
rates = st.floats(-50.0, 50.0)


def rotation(angle):
    return np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])


def matrix_at(speed_1, speed_2):
    return input_matrix(np.array([speed_1, speed_2]), CAR)


def printed_j_theta(car):
    k = car.thrust_coefficient
    scale = np.diag([cos(car.half_angle), sin(car.half_angle)])
    return scale @ np.array([[k, k], [k, -k]])


# --- the vehicle -------------------------------------------------------------------------------


def test_the_published_share_needs_the_whole_cars_inertia():
    assert counter_yaw_per_tilt(THESIS_CAR) == 0.5  # I_T / I_B = 0.001 / 0.002, Eq. (2)
    assert turn_per_tilt(THESIS_CAR) == 0.5
    assert counter_yaw_per_tilt(THESIS_CAR._replace(bottom_inertia=0.002)) == pytest.approx(1 / 3)


@given(angles, speeds, speeds)
def test_acceleration_is_eq_3(direction, speed_1, speed_2):
    squares = np.array([speed_1**2, speed_2**2])
    desired = rotation(direction) @ printed_j_theta(CAR) @ squares / CAR.mass
    np.testing.assert_allclose(
        acceleration(direction, squares, CAR), desired, rtol=1e-12, atol=1e-10
    )


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
def test_squares_invert_the_acceleration(square_1, square_2):
    pushed = thrust_map(CAR) @ (square_1, square_2)
    np.testing.assert_allclose(
        squared_speeds(pushed, CAR), (square_1, square_2), rtol=1e-10, atol=1e-8
    )


# --- third and fourth derivative ---------------------------------------------------------------


def symbolic():
    """Eq. (3) as functions of time, with Eq. (2) for the yaw."""
    t = sp.symbols("t")
    w1, w2, alpha = (sp.Function(name)(t) for name in ("w1", "w2", "alpha"))
    share = sp.Rational(7, 19)  # 1 - I_T / I_B of CAR
    k, m, theta = sp.Float(CAR.thrust_coefficient), sp.Float(CAR.mass), sp.Float(CAR.half_angle)
    j_theta = sp.diag(sp.cos(theta), sp.sin(theta)) * sp.Matrix([[k, k], [k, -k]])
    eta = share * alpha
    j = sp.Matrix([[sp.cos(eta), -sp.sin(eta)], [sp.sin(eta), sp.cos(eta)]])
    return t, (w1, w2, alpha), j * j_theta * sp.Matrix([w1**2, w2**2]) / m


def derivative_values(order, values):
    """The derivative of Eq. (3) of an order, evaluated at the inputs' derivatives."""
    t, inputs, force = symbolic()
    expression = sp.diff(force, t, order)
    plain = {}
    for function, derivatives in zip(inputs, values, strict=True):
        for degree in range(len(derivatives) - 1, 0, -1):
            expression = expression.subs(sp.Derivative(function, (t, degree)), derivatives[degree])
        plain[function] = derivatives[0]
    return np.array(expression.subs(plain).evalf().tolist(), dtype=float).ravel()


INPUTS = ((90.0, 4.0, -3.0), (60.0, -7.0, 5.0), (0.8, 1.5, -2.0))


def test_the_columns_are_the_third_derivative_of_the_position():
    desired = derivative_values(1, [values[:2] for values in INPUTS])
    (w1, d1, _), (w2, d2, _), (alpha, d3, _) = INPUTS
    body = matrix_at(w1, w2) @ (d1, d2, d3)
    np.testing.assert_allclose(rotation(turn_per_tilt(CAR) * alpha) @ body, desired, rtol=1e-12)


def test_the_columns_are_eqs_10_and_11():
    w1, w2 = 90.0, 60.0
    j_theta = printed_j_theta(CAR)
    delta_1 = j_theta @ np.diag([2 * w1, 2 * w2]) / CAR.mass
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    delta_2 = turn_per_tilt(CAR) * quarter @ j_theta @ np.array([w1**2, w2**2]) / CAR.mass
    np.testing.assert_allclose(matrix_at(w1, w2), np.column_stack([delta_1, delta_2]), rtol=1e-12)


def test_drift_and_columns_make_the_fourth_derivative():
    desired = derivative_values(2, INPUTS)
    (w1, d1, s1), (w2, d2, s2), (alpha, d3, s3) = INPUTS
    yaw = -counter_yaw_per_tilt(CAR) * alpha
    state = np.array([0.0, 0.0, 0.0, 0.0, yaw, alpha, w1, w2, d3, d1, d2])
    drift = laws.body_derivatives(state, CAR)[2]
    body = drift + matrix_at(w1, w2) @ (s1, s2, s3)
    np.testing.assert_allclose(rotation(yaw + alpha) @ body, desired, rtol=1e-12)


@given(speeds, speeds, rates, rates)
def test_the_inverse_is_numpys(speed_1, speed_2, x, y):
    matrix, outputs = matrix_at(speed_1, speed_2), np.array([x, y])
    desired = np.linalg.pinv(matrix) @ outputs
    scale = np.abs(desired).max() + 1e-9
    np.testing.assert_allclose(laws.minimum_norm(matrix, outputs), desired, atol=1e-9 * scale)


def test_one_rotor_at_rest_leaves_full_rank_two_do_not():
    one, outputs = matrix_at(80.0, 0.0), np.array([1.0, 2.0])
    assert np.linalg.matrix_rank(one) == 2
    inputs = laws.minimum_norm(one, outputs)
    assert inputs[1] == 0.0
    np.testing.assert_allclose(one @ inputs, outputs)
    assert np.isnan(laws.minimum_norm(matrix_at(0.0, 0.0), outputs)).all()


@given(speeds, speeds)
def test_silent_inputs_are_not_felt(speed_1, speed_2):
    matrix = matrix_at(speed_1, speed_2)
    n = laws.null_space_input(matrix)
    scale = np.linalg.norm(matrix) * np.linalg.norm(n)
    np.testing.assert_allclose(matrix @ n, 0.0, atol=1e-12 * scale)


@given(speeds, speeds, st.floats(0.1, 5.0))
def test_restoring_turns_the_middle_and_nothing_else(speed_1, speed_2, rate):
    matrix = matrix_at(speed_1, speed_2)
    along, across = thrust_map(CAR) @ (speed_1**2, speed_2**2)
    lean = np.arctan2(across, along)
    inputs = laws.restoring_inputs(lean, rate, matrix, CAR)
    scale = np.linalg.norm(matrix) * np.linalg.norm(inputs) + 1e-12
    np.testing.assert_allclose(matrix @ inputs, 0.0, atol=1e-10 * scale)
    # The acceleration stands still in the world, so the lean changes as the middle turns.
    np.testing.assert_allclose(-turn_per_tilt(CAR) * inputs[2], -rate * lean, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("restoring_rate", [0.0, 2.0])
def test_the_third_derivative_law_makes_the_jerk_it_wants(restoring_rate):
    state = np.array([1.0, -2.0, 3.0, -4.0, -0.3, 0.9, 90.0, 70.0])
    parameters = laws.ThirdParameters(CAR, CIRCLE_10, laws.THIRD_GAINS["ch10"], restoring_rate)
    inputs = laws.third_derivative_inputs(0.7, state, parameters)
    made = rotation(0.6) @ matrix_at(90.0, 70.0) @ inputs
    reference = reference_motion(0.7, CIRCLE_10)[:, :2]
    pushed = acceleration(0.6, np.array([90.0**2, 70.0**2]), CAR)
    desired = (
        reference[3]
        + 6.0 * (reference[2] - pushed)
        + 12.0 * (reference[1] - state[2:4])
        + 8.0 * (reference[0] - state[:2])
    )
    np.testing.assert_allclose(made, desired, rtol=1e-10)


def test_nothing_restores_the_lean_where_a_rotor_rests():
    assert not laws.restoring_inputs(0.3, 2.0, matrix_at(80.0, 0.0), CAR).any()


def fourth_parameters(decoupling):
    code = choice(laws.FourthDerivative, "decoupling", decoupling)
    return laws.FourthParameters(CAR, CIRCLE_10, code, 0.0, laws.FOURTH_GAINS["ch10"])


def test_the_fourth_derivative_law_makes_the_snap_it_demands():
    (w1, d1, _), (w2, d2, _), (alpha, d3, _) = INPUTS
    yaw = -0.3
    state = np.array([1.0, -2.0, 3.0, -4.0, yaw, alpha, w1, w2, d3, d1, d2])
    law = fourth_parameters("exact")
    second = laws.fourth_derivative_inputs(0.7, state, law)
    motion = [(*values[:2], last) for values, last in zip(INPUTS, second)]
    frame = rotation(yaw + alpha - turn_per_tilt(CAR) * alpha)
    ax, jx, made = (
        frame @ derivative_values(order, [values[: order + 1] for values in motion])
        for order in (0, 1, 2)
    )
    reference = reference_motion(0.7, CIRCLE_10)[:, :2]
    demanded = (
        reference[4]
        + 12.0 * (reference[3] - jx)
        + 54.0 * (reference[2] - ax)
        + 108.0 * (reference[1] - state[2:4])
        + 81.0 * (reference[0] - state[0:2])
    )
    np.testing.assert_allclose(made, demanded, rtol=1e-10)


def test_the_printed_tilt_column_lacks_the_yaws_answer():
    state = np.array([0.1, 0.2, 0.3, 0.4, -0.2, 0.5, 90.0, 70.0, 1.0, 2.0, -3.0])
    inputs = {
        name: laws.fourth_derivative_inputs(0.3, state, fourth_parameters(name))
        for name in ("published", "exact")
    }
    made = {}
    for name, values in inputs.items():
        factor = 1.0 / turn_per_tilt(CAR) if name == "published" else 1.0
        made[name] = matrix_at(90.0, 70.0) @ (values * [1.0, 1.0, factor])
    # Each is consistent with its own columns: only the exact one's are the car's.
    np.testing.assert_allclose(made["published"], made["exact"], rtol=1e-9)
    assert abs(inputs["published"][2] - inputs["exact"][2]) > 1e-3


# --- planned direction -------------------------------------------------------------------------

LINE_1 = ReferenceParameters(LINE, acceleration=(1.0, 0.0, 0.0))
LAW = laws.PlannedParameters(THESIS_CAR, GaitParameters(FIXED), LINE_1, laws.PLANNED_GAINS["ch11"])


@given(angles, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
def test_the_planned_law_is_eqs_12_and_13(direction, x, y, vy):
    state = np.array([x, y, 0.3, vy, direction, 0.0])
    time = 1.7
    x_ref, vx_ref = 0.5 * time**2, time
    desired = np.array(
        [1.0 + 12.0 * (vx_ref - 0.3) + 6.0 * (x_ref - x), 9.0 * (0.0 - vy) + 18.0 * (0.0 - y)]
    )
    printed = np.linalg.solve(rotation(direction) @ printed_j_theta(THESIS_CAR), desired)
    squares = laws.demanded_squared_speeds(time, state, LAW)
    np.testing.assert_allclose(squares, printed, rtol=1e-9, atol=1e-6)
    inputs = laws.planned_direction_inputs(time, state, LAW)
    np.testing.assert_array_equal(inputs, np.maximum(squares, 0.0))


def test_the_thrusts_direction_is_yaw_and_tilt_together():
    direct, shared = (np.array([0.1, 0.2, 0.3, 0.4, *angles]) for angles in ((0.5, 0), (0.8, -0.3)))
    expected = laws.demanded_squared_speeds(1.7, direct, LAW)
    found = laws.demanded_squared_speeds(1.7, shared, LAW)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@given(st.floats(-0.5, 0.5), st.floats(-1.5, 1.5), st.sampled_from([-pi / 3, pi / 3]))
def test_proposition_4_states_which_rotors_push(error, error_rate, direction):
    state = np.array([0.5, -error, 1.0, -error_rate, direction, 0.0])  # e_x = e_x' = 0 at 1 s
    square_1, square_2 = laws.demanded_squared_speeds(1.0, state, LAW)
    push = 9.0 * error_rate + 18.0 * error
    if abs(abs(push) - 3**-0.5) < 1e-6:
        return
    if direction < 0.0:  # Eq. (34): S_10 or S_11
        assert square_1 > 0.0
        assert (square_2 > 0.0) == (push < -(3**-0.5))
    else:  # Eq. (35): S_01 or S_11
        assert square_2 > 0.0
        assert (square_1 > 0.0) == (push > 3**-0.5)


def test_the_lyapunov_candidate_is_eq_74():
    candidate = laws.lyapunov_candidate(0.2, 0.7, laws.PLANNED_GAINS["ch11"])
    assert candidate == pytest.approx(0.5 * 0.7**2 + 9.0 * 0.2**2)
