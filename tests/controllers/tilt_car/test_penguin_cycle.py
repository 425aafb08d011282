"""The large penguin swing's limit cycle: map, fixed point, stability, Proposition 7."""

from __future__ import annotations

from functools import cache
from math import nan, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from tiltsim_controllers.tilt_car.cycles import (
    Swing,
    half_period,
    jacobian,
    limit_cycle,
    lyapunov,
    lyapunov_bound,
    lyapunov_growth,
    mirrored_map,
    multipliers,
)
from tiltsim_controllers.tilt_car.laws import PLANNED_GAINS, PlannedGains

CH11 = Swing(pi / 6, 1.0, PLANNED_GAINS["ch11"])
lyapunov_bound = cache(lyapunov_bound)


def integrated(swing, start, time):
    """The error along y with the thrusts at plus Lambda, by an ODE solver.

    It stops at the saturation's corner, where the second derivative is continuous but the third is
    not, and goes on with one rotor. Every step is good to 1e-12.
    """
    side = sqrt(1.0 / 3.0)
    gains = swing.gains

    def demanded(_t, state):
        return gains.y[0] * state[1] + gains.y[1] * state[0]

    def room(t, state):
        return demanded(t, state) - side

    room.terminal, room.direction = True, -1
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    state, begin = np.array(start), 0.0
    if room(0.0, state) > 0.0:
        both = solve_ivp(
            lambda t, s: (s[1], -demanded(t, s)), (0.0, time), state, events=room, **options
        )
        state, begin = both.y[:, -1], both.t[-1]
    one = solve_ivp(lambda _t, s: (s[1], -side), (begin, time), state, **options)
    assert room(time, one.y[:, -1]) <= 1e-12 or begin == time
    return one.y[:, -1]


def test_the_thrusts_point_where_one_has_no_part_in_x():
    assert CH11.direction == pytest.approx(pi / 3)
    assert CH11.push == pytest.approx(-sqrt(1.0 / 3.0))  # Eq. (32)


@settings(deadline=None, max_examples=50)
@given(st.floats(0.0, 0.6), st.floats(0.0, 1.5))  # Lemma 5 begins in quadrant I
def test_the_map_is_the_integrated_error(error, rate):
    # Some 50 steps, each good to 1e-12 of states below 2; the motion damps what they add up to.
    expected = integrated(CH11, (error, rate), 1.0)
    np.testing.assert_allclose(half_period(CH11, (error, rate)).end, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("gains", [(9.0, 18.0), (4.0, 4.0), (2.0, 8.0)])
def test_free_motion_is_right_for_any_damping(gains):
    swing = Swing(pi / 6, 1.0, PlannedGains((12.0, 6.0), gains))
    step = 1e-5
    state = (0.3, -0.2)
    here, ahead, behind = (swing.after_both_push(0.4 + side, state) for side in (0.0, step, -step))
    assert (ahead[0] - behind[0]) / (2 * step) == pytest.approx(here[1], rel=1e-6)
    curvature = (ahead[1] - behind[1]) / (2 * step)
    assert curvature == pytest.approx(-gains[0] * here[1] - gains[1] * here[0], rel=1e-6)
    assert swing.after_both_push(0.0, state) == pytest.approx(state)


def test_the_limit_cycle_is_where_it_was_seen():
    error, rate = state = limit_cycle(CH11)
    assert (error, rate) == pytest.approx((0.195, 0.748), rel=0.01)
    assert lyapunov(CH11, state) == pytest.approx(0.622, rel=0.01)
    assert 1.0 - half_period(CH11, state).free_time == pytest.approx(0.72, rel=0.02)
    np.testing.assert_allclose(mirrored_map(CH11, state), state, atol=1e-12)
    with pytest.raises(ValueError, match="no limit cycle"):
        limit_cycle(CH11, (nan, 0.0))


def test_disturbed_cycles_come_back_as_the_multipliers_say():
    state = np.array(limit_cycle(CH11))
    values = multipliers(CH11, tuple(state))
    assert np.abs(values).max() < 1.0
    shrink = np.abs(np.linalg.det(jacobian(CH11, tuple(state)))) ** 0.5
    assert np.abs(values) == pytest.approx([shrink, shrink])
    start = np.array([1e-4, 0.0])
    disturbed = state + start
    for _ in range(4):
        disturbed = np.array(mirrored_map(CH11, tuple(disturbed)))
    desired = np.linalg.matrix_power(jacobian(CH11, tuple(state)), 4) @ start
    np.testing.assert_allclose(disturbed - state, desired, atol=2e-8)


def test_from_rest_every_half_period_is_nearer():
    fixed = np.array(limit_cycle(CH11))
    state, distances = (0.0, 0.0), []
    for _ in range(12):
        state = mirrored_map(CH11, state)
        distances.append(np.linalg.norm(np.array(state) - fixed))
    assert distances[-1] < 1e-5
    assert max(distances[4:]) < min(distances[:1])


@given(st.floats(0.0, 2.0), st.floats(0.0, 4.0))
def test_no_half_period_gains_more_than_three_quarters(error, rate):
    if 9.0 * rate + 18.0 * error >= 3**-0.5:  # the zone of Eq. (39)
        assert lyapunov_growth(CH11, (error, rate)) <= 0.75 + 1e-9


def test_proposition_7_holds_with_room():
    bound = lyapunov_bound(CH11, 41)
    assert bound.largest_gain == pytest.approx(0.75, abs=1e-6)  # Eq. (71) is sharp
    assert lyapunov_growth(CH11, bound.at) == pytest.approx(0.0, abs=1e-9)
    assert bound.published == bound.critical + 0.75
    state, candidates = (0.0, 0.0), []
    for _ in range(40):
        state = mirrored_map(CH11, state)
        candidates.append(lyapunov(CH11, state))
    assert max(candidates) == pytest.approx(11 / 12)
    assert max(candidates) < bound.critical < bound.published


@pytest.mark.parametrize("scale", [1.01, 1.3, 2.0, 5.0])
def test_beyond_l_critical_nothing_gains(scale):
    bound = lyapunov_bound(CH11, 41)
    for angle in np.linspace(0.0, pi / 2, 50):
        size = sqrt(bound.critical * scale)
        state = (size / 3.0 * np.cos(angle), size * sqrt(2.0) * np.sin(angle))  # Eq. (75)
        assert lyapunov_growth(CH11, state) < 0.0


def test_in_a_short_half_both_rotors_push_all_the_time():
    short = Swing(pi / 6, 0.05, PLANNED_GAINS["ch11"])
    start = (0.3, 0.9)
    half = half_period(short, start)
    assert half.free_time == 0.05
    matrix = np.array([[0.0, 1.0], [-short.gains.y[1], -short.gains.y[0]]])
    np.testing.assert_allclose(half.end, expm(0.05 * matrix) @ start, rtol=1e-13)
