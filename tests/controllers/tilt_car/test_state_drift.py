"""The drift of the tilt-car's states: closed forms, the law itself, and its compensation."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from tests.controllers.tilt_car.lean import (
    drift_time,
    holonomy,
    lean_after,
    lean_of,
    lean_of_split,
    restored_lean,
    split_of_lean,
)
from tiltsim_controllers.tilt_car.cycles import Orbit, drift_rate, lean_stiffness, orbit
from tiltsim_controllers.tilt_car.laws import minimum_norm, null_space_input, restoring_inputs
from tiltsim_controllers.tilt_car.vehicle import (
    THESIS_CAR,
    TiltCar,
    input_matrix,
    rotation,
    squared_speeds,
    thrust_map,
    turn_per_tilt,
)

CAR = TiltCar(1.3, 0.0012, 0.0007, 0.45, 0.0008)
PATH = orbit(-10.0, 1.0)
leans = st.floats(-0.4, 0.4)


def follow(jerk, inputs, time, steps, car, rate=0.0):
    """The inputs (omega_1, omega_2, alpha) after following a jerk, world, under the law alone."""

    def slope(at, values):
        w1, w2, alpha = values
        columns = input_matrix(np.array([w1, w2]), car)
        desired = rotation(turn_per_tilt(car) * alpha).T @ jerk(at)
        along, across = thrust_map(car) @ (w1 * w1, w2 * w2)
        restoring = restoring_inputs(atan2(across, along), rate, columns, car)
        return minimum_norm(columns, desired) + restoring

    step, values = time / steps, np.array(inputs)
    for index in range(steps):
        at = index * step
        k1 = slope(at, values)
        k2 = slope(at + 0.5 * step, values + 0.5 * step * k1)
        k3 = slope(at + 0.5 * step, values + 0.5 * step * k2)
        k4 = slope(at + step, values + step * k3)
        values = values + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return values


def inputs_of(lean, acceleration, car):
    """Inputs that make an acceleration along x at a lean."""
    squares = squared_speeds((acceleration * cos(lean), acceleration * sin(lean)), car)
    return np.array([squares[0] ** 0.5, squares[1] ** 0.5, -lean / turn_per_tilt(car)])


def lean_at(values, car):
    return float(lean_of(values[0] ** 2, values[1] ** 2, car))


def circling(path):
    size, omega = path.acceleration * path.angular_frequency, path.angular_frequency
    return lambda t: (-size * sin(omega * t), size * cos(omega * t))


# --- closed forms ------------------------------------------------------------------------------


@given(leans)
def test_the_stiffness_is_the_speed_of_the_rotor_speeds(lean):
    step = 1e-6
    ahead, behind = (inputs_of(lean + side, 10.0, CAR)[:2] for side in (step, -step))
    change = (ahead - behind) / (2.0 * step)
    assert lean_stiffness(lean, 10.0, CAR) == pytest.approx(change @ change, rel=1e-6)


@given(leans, leans)
def test_the_drift_time_is_the_integral(start, end):
    desired, _ = quad(lambda lean: 1.0 / drift_rate(lean, PATH, CAR), start, end)
    assert drift_time(start, end, PATH, CAR) == pytest.approx(desired, rel=1e-9, abs=1e-9)


@given(leans, st.floats(0.0, 500.0))
def test_lean_after_inverts_drift_time(start, time):
    end = lean_after(time, start, PATH, CAR)
    assert drift_time(start, end, PATH, CAR) == pytest.approx(time, rel=1e-9, abs=1e-8)


def test_the_drift_never_arrives_where_a_rotor_stops():
    leans_later = [lean_after(time, 0.0, PATH, THESIS_CAR) for time in (1e3, 1e4, 2e4)]
    assert leans_later == sorted(leans_later)
    assert leans_later[-1] < THESIS_CAR.half_angle
    with pytest.raises(ValueError, match="within the half angle"):
        drift_time(0.0, THESIS_CAR.half_angle, PATH, THESIS_CAR)


@given(leans)
def test_lean_and_split_are_one(lean):
    split = split_of_lean(lean, 10.0, CAR)
    assert lean_of_split(split, 10.0, CAR) == pytest.approx(lean, abs=1e-12)


# --- the law itself ----------------------------------------------------------------------------


@pytest.mark.parametrize(("omega", "lean"), [(1.0, 0.3), (-1.0, 0.0), (0.5, 0.3)])
def test_a_lap_advances_the_lean_by_the_holonomy(omega, lean):
    path = Orbit(10.0, omega)
    lap = 2.0 * pi / abs(omega)
    end = follow(circling(path), inputs_of(lean, 10.0, THESIS_CAR), lap, 500, THESIS_CAR)
    advanced = lean_at(end, THESIS_CAR) - lean
    assert advanced == pytest.approx(holonomy(lean, path, THESIS_CAR), rel=1e-6)
    assert np.sign(advanced) == np.sign(omega)
    # The acceleration is back, the inputs are not.
    pushed = thrust_map(THESIS_CAR) @ end[:2] ** 2
    made = rotation(turn_per_tilt(THESIS_CAR) * end[2]) @ pushed
    np.testing.assert_allclose(made, (10.0, 0.0), atol=1e-6)


def test_there_and_back_along_one_path_undoes_the_drift():
    forth = follow(circling(PATH), inputs_of(0.1, 10.0, CAR), 1.0, 500, CAR)

    def back(t):
        x, y = circling(PATH)(1.0 - t)
        return -x, -y

    again = follow(back, forth, 1.0, 500, CAR)
    assert abs(lean_at(forth, CAR) - 0.1) > 1e-4
    np.testing.assert_allclose(again, inputs_of(0.1, 10.0, CAR), rtol=1e-9, atol=1e-9)


def null_direction(speeds, car):
    n = null_space_input(input_matrix(speeds, car))
    return n / np.linalg.norm(n)


def twist(speeds, car):
    """``n . curl n`` of the null direction, which no tilt changes, by central differences.

    Only if it were zero would the law's planes be tangent to surfaces (Frobenius).
    """
    steps = np.diag(1e-5 * speeds)
    ends = [(null_direction(speeds + h, car), null_direction(speeds - h, car)) for h in steps]
    by_1, by_2 = [(up - down) / (2.0 * h.sum()) for (up, down), h in zip(ends, steps, strict=True)]
    return null_direction(speeds, car) @ (by_2[2], -by_1[2], by_1[1] - by_2[0])


@pytest.mark.parametrize("lean", [-0.3, 0.0, 0.2])
def test_small_loops_miss_by_the_twist_times_their_area(lean):
    start, size = inputs_of(lean, 10.0, THESIS_CAR), 0.02
    end = start
    for side in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)):
        end = follow(lambda _t, jerk=side: jerk, end, size, 40, THESIS_CAR)
    n = null_space_input(input_matrix(start[:2], THESIS_CAR))
    # The null direction's length is the area of accelerations that a unit of inputs spans.
    missed = (end - start) @ n / np.linalg.norm(n)
    desired = -twist(start[:2], THESIS_CAR) * size * size / np.linalg.norm(n)
    assert desired != 0.0
    assert missed == pytest.approx(desired, rel=0.05)


def test_restoring_holds_the_lean_where_drift_and_rate_balance():
    inputs = inputs_of(0.2, 10.0, THESIS_CAR)
    end = follow(circling(PATH), inputs, 15.0, 1500, THESIS_CAR, rate=1.0)
    desired = restored_lean(PATH, THESIS_CAR, 1.0)
    assert lean_at(end, THESIS_CAR) == pytest.approx(desired, rel=1e-3)
    assert desired == pytest.approx(drift_rate(0.0, PATH, THESIS_CAR), rel=1e-5)
    along, across = thrust_map(THESIS_CAR) @ end[:2] ** 2
    assert hypot(along, across) == pytest.approx(10.0, rel=1e-7)


@pytest.mark.parametrize("rate", [1e-6, 3e-4, 0.1, 5.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_restoring_rate_however_slow_holds_the_lean_somewhere(rate, sign):
    path = orbit(10.0, sign)
    lean = restored_lean(path, THESIS_CAR, rate)
    assert 0.0 < sign * lean < THESIS_CAR.half_angle
    assert drift_rate(lean, path, THESIS_CAR) == pytest.approx(rate * lean, rel=1e-6)


def test_no_rate_restores_nothing():
    with pytest.raises(ValueError, match=r"rate = 0\.0: must be above 0"):
        restored_lean(PATH, THESIS_CAR, 0.0)
