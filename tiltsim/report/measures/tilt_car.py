"""The tilt-car: the drift of its state (ch. 10), and the proof of ch. 11, lemma by lemma."""

from collections.abc import Callable
from functools import cache
from math import asin, cos, exp, inf, log, pi, sin, sqrt
from typing import Final

import numpy as np

from tiltsim.report.measures.flown import Flown
from tiltsim_controllers.gaits.motion import FIXED, GaitParameters
from tiltsim_controllers.mathematics.scalar import Pair
from tiltsim_controllers.references.trajectories import LINE, ReferenceParameters
from tiltsim_controllers.tilt_car.cycles import (
    LyapunovBound,
    Swing,
    half_period,
    limit_cycle,
    lyapunov,
    lyapunov_bound,
    lyapunov_growth,
)
from tiltsim_controllers.tilt_car.laws import (
    PLANNED_GAINS,
    PlannedParameters,
    demanded_squared_speeds,
    planned_direction_inputs,
)
from tiltsim_controllers.tilt_car.vehicle import (
    THESIS_CAR,
    acceleration,
    counter_yaw_per_tilt,
    input_matrix,
    rotation,
    squared_speeds,
    thrust_map,
    turn_per_tilt,
)

_RADIUS, _OMEGA = 10.0, 1.0  # m, rad/s


def counter_yaw(bottom_inertia: float = THESIS_CAR.bottom_inertia) -> float:
    """Yaw of the bottom disc, of this own inertia (kg m^2), over the tilt of the top disc."""
    return -counter_yaw_per_tilt(THESIS_CAR._replace(bottom_inertia=bottom_inertia))


def thrusts_can_be_inverted() -> bool:
    """Whether J_theta, times any rotation, is regular (Eqs. 4-6)."""
    theta, thrust = THESIS_CAR.half_angle, THESIS_CAR.thrust_coefficient
    matrix = np.diag([cos(theta), sin(theta)]) @ (thrust * np.array([[1.0, 1.0], [1.0, -1.0]]))
    return bool(abs(np.linalg.det(matrix)) > 1e-9)


def rank_of_inputs(speed_1: float, speed_2: float, *, tilting: bool = False) -> int:
    """The rank of the columns of the rotors at speeds (rad/s), and of the tilt if ``tilting``."""
    columns = input_matrix(np.array([speed_1, speed_2]), THESIS_CAR)
    return int(np.linalg.matrix_rank(columns if tilting else columns[:, :2]))


def full_rank_needs_both(tilting: bool) -> bool:
    """Whether the rank is full where both rotors turn, and only there."""
    speeds = ((200.0, 150.0), (200.0, 0.0), (0.0, 200.0))
    full = [rank_of_inputs(*pair, tilting=tilting) == 2 for pair in speeds]
    return full == [True, False, False]


def thrust_points_to_the_center() -> bool:
    """Eq. (18), alpha = t / (1 - I_T / I_B): the thrusts turn with the circle, 1 rad/s."""
    tilt_rate = 1.0 / turn_per_tilt(THESIS_CAR)
    yaw_rate = -counter_yaw_per_tilt(THESIS_CAR) * tilt_rate
    return abs(tilt_rate + yaw_rate - _OMEGA) < 1e-12


def third_derivative_columns_are_right() -> bool:
    """Eqs. (9)-(11): the columns of the rotors and of the tilt, by difference quotients."""
    speeds, step = (150.0, 120.0), 1e-6
    turn = turn_per_tilt(THESIS_CAR)

    def at(first: float, second: float, tilt: float) -> np.ndarray:
        return np.array(acceleration(turn * tilt, np.array([first**2, second**2]), THESIS_CAR))

    columns = input_matrix(np.array(speeds), THESIS_CAR).T
    for column, shift in zip(columns, step * np.eye(3)):
        ahead, behind = (at(*(np.append(speeds, 0.0) + sign * shift)) for sign in (1.0, -1.0))
        if np.abs((ahead - behind) / (2.0 * step) - column).max() > 1e-6:
            return False
    return True


def fourth_derivative_is_right() -> bool:
    """Eq. (21), its six terms as printed, beside second difference quotients of Eq. (3)."""
    per_tilt, step = counter_yaw_per_tilt(THESIS_CAR), 1e-3
    motion = np.array([[150.0, 3.0, 1.0], [120.0, -2.0, 2.0], [0.7, 0.4, 0.3]])

    def at(time: float) -> np.ndarray:
        first, second, tilt = motion @ (1.0, time, 0.5 * time**2)
        direction = tilt - per_tilt * tilt
        return np.array(acceleration(direction, np.array([first**2, second**2]), THESIS_CAR))

    def turns(angle: float, rate: float, change: float) -> tuple[np.ndarray, ...]:
        """J of Eq. (22) or (23) with its first and second derivatives."""
        matrix, turned = np.array(rotation(angle)), np.array(rotation(angle + 0.5 * pi))
        return matrix, rate * turned, change * turned - rate**2 * matrix

    yaw, yaw_1, yaw_2 = turns(*(-per_tilt * motion[2]))
    tilt, tilt_1, tilt_2 = turns(*motion[2])
    speeds, rates, changes = motion[:2].T
    squares, squares_1 = speeds**2, 2.0 * speeds * rates
    squares_2 = 2.0 * rates**2 + 2.0 * speeds * changes
    forces = thrust_map(THESIS_CAR)
    printed = (
        yaw @ tilt_2 @ forces @ squares
        + 2.0 * yaw @ tilt_1 @ forces @ squares_1
        + yaw @ tilt @ forces @ squares_2
        + 2.0 * yaw_1 @ tilt_1 @ forces @ squares
        + 2.0 * yaw_1 @ tilt @ forces @ squares_1
        + yaw_2 @ tilt @ forces @ squares
    )
    exact = (at(step) - 2.0 * at(0.0) + at(-step)) / step**2
    return bool(np.abs(printed - exact).max() < 1e-5 * np.abs(exact).max())


def lean(split: float, as_share: bool = False) -> float:
    """Angle (rad) from the middle of the thrusts to the center, or over their half angle.

    ``split`` is the difference of the squared rotor speeds, rad^2/s^2.
    """
    _, across = thrust_map(THESIS_CAR) @ (split, 0.0)
    angle = abs(asin(across / (_RADIUS * _OMEGA**2)))
    return angle / THESIS_CAR.half_angle if as_share else angle


def fails_after_a_rotor_stops(flights: Flown, small: float) -> bool:
    """Whether a rotor stops and the error (m) from 20 s on is not small."""
    error = float(flights[0].get("sup_position_error_after_20s", inf))
    return flights[0]["min_rotor_speed"] == 0.0 and error > small


_GAINS: Final = PLANNED_GAINS["ch11"]
SWING: Final = Swing(half_angle=pi / 6, half_period=1.0, gains=_GAINS)
_SQRT_3: Final = sqrt(3.0)


@cache
def _zone() -> tuple[Pair, ...]:
    """States of Eq. (39): beyond the switching line, both components positive."""
    grid = np.linspace(0.0, 3.0, 31).tolist()
    return tuple((e, rate) for e in grid for rate in grid if SWING.both_push((e, rate)))


def in_the_zone(statement: str) -> bool:
    """Whether a function of this module holds for every state of a grid in the zone of Eq. (39)."""
    holds: Callable[[Pair], bool] = globals()[statement]
    return all(holds(state) for state in _zone())


def comes_back_mirrored(state: Pair) -> bool:
    """Lemma 7: half a period leads into the zone of Eq. (45)."""
    error, rate = half_period(SWING, state).end
    return error <= 0.0 and rate <= 0.0 and SWING.both_push((-error, -rate))


def switches_within(state: Pair) -> bool:
    """Lemma 5: 0 < t_1 < 1 s."""
    return 0.0 < half_period(SWING, state).free_time < 1.0


def largest_at_the_ends(state: Pair) -> bool:
    """Proposition 6, along the motion in steps of 10 ms."""
    half = half_period(SWING, state)
    between = SWING.after_both_push(half.free_time, state)
    times = np.linspace(0.0, SWING.half_period, 101)
    path = [
        SWING.after_both_push(t, state)
        if t <= half.free_time
        else SWING.after_one_push(t - half.free_time, between)
        for t in times.tolist()
    ]
    ends = max(lyapunov(SWING, state), lyapunov(SWING, half.end))
    return max(lyapunov(SWING, at) for at in path) <= ends + 1e-12


def eq_42_holds(state: Pair) -> bool:
    """The printed solution with both rotors pushing, after 0.3 s."""
    error, rate = state
    slow, fast = exp(-0.9), exp(-1.8)
    printed = (
        (2.0 * error + rate / 3.0) * slow + (-error - rate / 3.0) * fast,
        (-6.0 * error - rate) * slow + (6.0 * error + 2.0 * rate) * fast,
    )
    solved = SWING.after_both_push(0.3, state)
    return all(abs(a - b) < 1e-9 for a, b in zip(printed, solved, strict=True))


def first_half_period() -> bool:
    """Remark 8: from rest a single rotor pushes for half a period, mirrored, into the zone."""
    error, rate = SWING.after_one_push(SWING.half_period, (0.0, 0.0))
    return SWING.both_push((-error, -rate))


def switch_line() -> float:
    """K_Y1 e_y' + K_Y2 e_y at which a rotor stops (Prop. 4)."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (
            (low, middle) if SWING.both_push((middle / _GAINS.y[1], 0.0)) else (middle, high)
        )
    return high


def grows_by_three_quarters_at_most(state: Pair) -> bool:
    """Remark 10: the candidate over half a period."""
    return lyapunov_growth(SWING, state) <= 0.75 + 1e-12


@cache
def bound() -> LyapunovBound:
    """L_critical of Eq. (76) and the largest growth, Eq. (71)."""
    return lyapunov_bound(SWING, points=33)


def eq_27_holds() -> bool:
    """Eq. (27) is Eq. (12) with the inverse of Eq. (3) written out.

    S_pq is therefore a function of (m, n) alone.
    """
    inverse = np.array([[0.5, 0.5], [0.5, -0.5]]) @ np.diag(
        [1.0 / cos(THESIS_CAR.half_angle), 1.0 / sin(THESIS_CAR.half_angle)]
    )
    scale = THESIS_CAR.mass / THESIS_CAR.thrust_coefficient
    rng = np.random.default_rng(11)
    return all(
        np.allclose(scale * inverse @ (m, n), squared_speeds((m, n), THESIS_CAR), rtol=1e-12)
        for m, n in rng.uniform(-5.0, 5.0, (200, 2)).tolist()
    )


def switch_matrix_is_the_limit() -> bool:
    """Lemma 1: S_pq of Eqs. (22)-(24) times the squares of Eq. (12) is Eq. (13)."""
    rng = np.random.default_rng(12)
    state = (0.0, 0.0, 0.0, 0.0, 0.0)
    for alpha, x, y in rng.uniform(-2.0, 2.0, (200, 3)).tolist():
        line = ReferenceParameters(LINE, (x, y, 0.0))
        law = PlannedParameters(THESIS_CAR, GaitParameters(FIXED), line, _GAINS)
        at = (*state, alpha, 0.0, 0.0)
        squares = np.array(demanded_squared_speeds(0.0, at, law))
        switch = np.diag((squares > 0.0).astype(float))
        if not np.array_equal(switch @ squares, planned_direction_inputs(0.0, at, law)):
            return False
    return True


def eq_43_holds(state: Pair) -> bool:
    """At the time at which a rotor stops."""
    error, rate = state
    mixed, growth = 2.0 * error + rate / 3.0, exp(3.0 * half_period(SWING, state).free_time)
    left = growth * growth / (9.0 * _SQRT_3) + mixed * growth - 4.0 * error - 4.0 / 3.0 * rate
    return abs(left) < 1e-9 * growth * growth


def _printed_time(state: Pair, side: float) -> float:
    """t_1 of Eq. (44), ``side`` 1, or t_3 of Eq. (47), ``side`` -1 and a state of Eq. (45)."""
    error, rate = state
    mixed, edge = 2.0 * error + rate / 3.0, 2.0 / (9.0 * _SQRT_3)
    root = sqrt(mixed * mixed + side * 2.0 * edge * (4.0 * error + 4.0 / 3.0 * rate))
    return log((-side * mixed + root) / edge) / 3.0


def eq_44_holds(state: Pair) -> bool:
    """The printed time equals the one found by bisection."""
    return abs(_printed_time(state, 1.0) - half_period(SWING, state).free_time) < 1e-9


def eq_47_holds(state: Pair) -> bool:
    """The printed time equals the time of the mirrored state."""
    error, rate = state
    mirrored = _printed_time((-error, -rate), -1.0)
    return abs(mirrored - half_period(SWING, state).free_time) < 1e-9


def slope_matches(side: float) -> bool:
    """Eq. (61), ``side`` 1, or (67), ``side`` -1: the candidate's slope with one rotor pushing."""
    step = 1e-5
    for rate in np.linspace(-2.0, 2.0, 41).tolist():
        # From the bound, Eq. (60) or (66), in the frame in which rotor 2 pushes.
        state = (-side * 0.5 * (1.0 / (9.0 * _SQRT_3) + side * rate), rate)
        start = (-side * state[0], -side * state[1])
        for t in (0.1, 0.5, 0.9):
            ahead, behind = (
                lyapunov(SWING, SWING.after_one_push(t + s, start)) for s in (step, -step)
            )
            printed = (
                9.0
                * (t / _SQRT_3 + side * rate)
                * (t * t / _SQRT_3 + side * 2.0 * rate * t - side * rate)
            )
            if abs((ahead - behind) / (2.0 * step) - printed) > 1e-6:
                return False
    return True


def falling_states() -> list[Pair]:
    """The candidate now and half a period later, at the states of the grid where it falls."""
    states = [state for state in _zone() if lyapunov_growth(SWING, state) < 0.0]
    return [
        (lyapunov(SWING, state), lyapunov(SWING, half_period(SWING, state).end)) for state in states
    ]


def inputs_repeat_after_a_period() -> bool:
    """On the limit cycle the state is back after T, with signs changed after T/2."""
    start = limit_cycle(SWING)
    half = half_period(SWING, start).end
    again = half_period(SWING, (-half[0], -half[1])).end
    back = max(abs(-a - b) for a, b in zip(again, start, strict=True))
    return back < 1e-9 and min(half) < 0.0 < min(start)


def candidates_fall_as_printed() -> bool:
    """Eqs. (18), (20): the slopes of both candidates along Eq. (16)."""
    step = 1e-6
    pairs = (_GAINS.x, _GAINS.y)
    for error, rate in np.random.default_rng(13).uniform(-1.0, 1.0, (100, 2)).tolist():
        for damping, stiffness in pairs:
            second = -damping * rate - stiffness * error
            ends = [
                0.5 * (rate + s * second) ** 2 + 0.5 * stiffness * (error + s * rate) ** 2
                for s in (step, -step)
            ]
            if abs((ends[0] - ends[1]) / (2.0 * step) + damping * rate**2) > 1e-6:
                return False
    return True


def only_the_printed_switches_occur() -> bool:
    """Lemma 4: which rotors push where the demand along x is 1 m/s^2, and the result."""
    for turn in (-pi / 3, pi / 3):
        for along_y in np.linspace(-20.0, 20.0, 401).tolist():
            m, n = cos(turn) + sin(turn) * along_y, -sin(turn) + cos(turn) * along_y
            squares = np.array(squared_speeds((m, n), THESIS_CAR))
            pushing = squares > 0.0
            if not pushing[0 if turn < 0.0 else 1]:
                return False
            scale = THESIS_CAR.thrust_coefficient / THESIS_CAR.mass
            first, second = scale * np.maximum(squares, 0.0)
            half = THESIS_CAR.half_angle
            along, across = cos(half) * (first + second), sin(half) * (first - second)
            if abs(cos(turn) * along - sin(turn) * across - 1.0) > 1e-9:
                return False
    return True


def slope_has_the_printed_signs() -> bool:
    """Cases a to c of Prop. 6: the sign of Eq. (61) changes at most once, from below to above."""
    times = np.linspace(0.0, 1.0, 202)[1:-1]
    for rate in [0.0, -1.0 / _SQRT_3, *np.linspace(-3.0, 3.0, 199).tolist()]:
        line = times / _SQRT_3 + rate
        rising = line * (times * times / _SQRT_3 + 2.0 * rate * times - rate) > 0.0
        expected = {0.0: [True], -1.0 / _SQRT_3: [False]}.get(rate)
        if (np.diff(rising.astype(int)) < 0).any() or (
            expected is not None and rising.tolist() != expected * len(times)
        ):
            return False
    return True


def candidate_is_the_ellipse() -> bool:
    """Eqs. (74), (75) at random states."""
    states = np.random.default_rng(14).uniform(-1.0, 1.0, (100, 2)).tolist()
    values = [(state, lyapunov(SWING, state)) for state in states]
    return all(
        abs(error**2 / (sqrt(value) / 3.0) ** 2 + rate**2 / (2.0 * value) - 1.0) < 1e-12
        for (error, rate), value in values
    )
