"""The tilt-car, and the state drift of its over-actuated control (ch. 10)."""

from math import asin, cos, inf, pi, sin

import numpy as np

from tiltsim.report.measures.flown import Flown
from tiltsim_controllers.tilt_car.vehicle import (
    THESIS_CAR,
    acceleration,
    counter_yaw_per_tilt,
    input_matrix,
    rotation,
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
