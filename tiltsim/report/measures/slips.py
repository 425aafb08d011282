"""The errors of the thesis: how far each printed formula, and the mended one, is from the truth.

Every function takes ``mended`` and returns a deviation that is zero, up to rounding, of a formula
that is right. The truth is computed without the formula: by difference quotients, determinants,
eigenvalues or linear programs. `tiltsim.report.findings` lists them with their texts.
"""

from collections.abc import Callable
from math import asin, atan2, cos, exp, pi, sin, sqrt
from typing import Final

import numpy as np

from tiltsim.report.measures.control import accelerations, eq_43, torques
from tiltsim.report.measures.determinant import residuals_of_switch, terms_off
from tiltsim.report.measures.tilt_car import counter_yaw
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES
from tiltsim_controllers.analysis.singularity import force_matrix, residuals, torque_matrix
from tiltsim_controllers.analysis.two_color_map import curve_l, grid_roots
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.laws.quadrotor import POSITION_GAINS
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.tilt_car import vehicle
from tiltsim_controllers.vehicle.parameters import PRESETS

RIGHT: Final = 1e-6  # deviation below which a formula counts as right
_VEHICLE: Final = PRESETS["ar_drone_2"]
_TILTS: Final = (-0.1, 0.1, -0.2, 0.1)  # gait 1 of ch. 3, rad
_SPEEDS: Final = np.array([-310.0, 350.0, -330.0, 370.0])  # rad/s


def formula_holds(key: str, mended: bool = False) -> bool:
    """Whether a printed formula, or the mended one, is right."""
    return deviation(key, mended) < RIGHT


def deviation(key: str, mended: bool) -> float:
    """How far the formula of an entry of the list of errors is from the truth."""
    found: Callable[[bool], float] = globals()[f"_{key.replace('-', '_')}"]
    return found(mended)


def _second_derivatives(speeds: Floats) -> Floats:
    """Ch. 3, Eq. (10), level: angular accelerations and the vertical one, from Eqs. (1), (4)."""
    squares = speeds * np.abs(speeds)
    arm = _VEHICLE.arm_length * _VEHICLE.thrust_coefficient
    inertia = (_VEHICLE.inertia_xx, _VEHICLE.inertia_yy, _VEHICLE.inertia_zz)
    torque = arm * np.asarray(torque_matrix(_TILTS, _VEHICLE)) @ squares
    lift = _VEHICLE.thrust_coefficient / _VEHICLE.mass * np.asarray(force_matrix(_TILTS))[2]
    return np.append(torque / inertia, lift @ squares)


def _decoupling_matrix(rows: int) -> tuple[Floats, Floats]:
    """By rows: the derivative of Eq. (10) by difference quotients, and w without 2|w|."""
    steps = 1e-3 * np.eye(4)
    exact = [
        (_second_derivatives(_SPEEDS + step) - _second_derivatives(_SPEEDS - step)) / 2e-3
        for step in steps
    ]
    columns = np.array(exact).T[:rows]
    return columns, columns / (2.0 * np.abs(_SPEEDS))


def _relative(value: Floats, truth: Floats) -> float:
    return float(np.abs(value - truth).max()) / float(np.abs(truth).max())


def _speed_factor(mended: bool) -> float:
    """Ch. 3, Eq. (12): the first three rows, without and with the factor 2|w|."""
    exact, printed = _decoupling_matrix(3)
    return _relative(printed * 2.0 * np.abs(_SPEEDS) if mended else printed, exact)


def _thrust_twice(mended: bool) -> float:
    """Ch. 3, Eq. (12): the fourth row with K_f before the matrix and in F."""
    exact = _decoupling_matrix(4)[0][3]
    force = _VEHICLE.thrust_coefficient * np.asarray(force_matrix(_TILTS))[2]
    before = 1.0 if mended else _VEHICLE.thrust_coefficient
    return _relative(before / _VEHICLE.mass * force * 2.0 * np.abs(_SPEEDS), exact)


def _roll_terms_off(more: str) -> float:
    """How far the terms `_ROLL` and some more are from R_phi, above 0.001."""
    return max(0.0, *(abs(off) - 1e-3 for off in terms_off("R_phi", _ROLL + more).values()))


_ROLL: Final = "1.000 ccsc - 1.000 sccc - 1.000 csss + 2.880 ccss + 2.880 cssc - 2.880 scss "
"""The terms with the sine of roll that ch. 3, 5 and 6 print alike."""


_MOVED: Final = "+ 1.000 sscs - 2.880 sscc + 2.880 scss - 2.880 sccs"
"""The right last terms, with -2.880 moved from the product scss to sccs."""


def _ch3_terms(mended: bool) -> float:
    return _roll_terms_off(_MOVED if mended else "+ 1.000 sscs - 2.880 sscs")


def _ch5_terms(mended: bool) -> float:
    return _roll_terms_off(_MOVED if mended else "+ 1.000 sssc - 2.880 sscc")


def _ch6_term(mended: bool) -> float:
    return _roll_terms_off(_MOVED if mended else "+ 1.000 sscs - 2.880 sscc")


def _crossing(mended: bool) -> float:
    """Pairs with alpha_1 = -alpha_3 that need not cross; mended: of those below 1.4."""
    pairs = [p for p in DETERMINANT_CASES["negative"].pairs if not mended or abs(p[0]) < 1.4]
    return float(sum(residuals_of_switch(pair).min() > 0.0 for pair in pairs))


def _ch2_matrices(roll: float, pitch: float, yaw: float) -> tuple[Floats, Floats, Floats]:
    """P and Q as printed, and the exact Delta of ch. 2, for m, d, I and zeta of 1."""
    (sf, st, sp), (cf, ct, cp) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    tf, tt = sf / cf, st / ct
    derivatives = np.array(
        [
            [cp * sf - sp * st * cf, sp * cf - cp * st * sf, cp * ct * cf],
            [sp * sf + cp * st * cf, -cp * cf - sp * st * sf, sp * ct * cf],
            [0.0, -ct * sf, -st * cf],
        ]
    )
    rates = np.array([[0.0, sf / ct, cf / ct], [1.0, sf * tt, cf * tt], [0.0, cf, -sf]])
    thrust = [cf * cp * st + sf * sp, cf * sp * st - sf * cp, ct * cf]
    delta = np.zeros((4, 4))
    delta[:3, 0] = -np.array(thrust)
    delta[:3, 1:] = -derivatives @ rates
    delta[3, 1:] = rates[0]
    first, second = np.diag([1.0, 1.0, -ct, 1.0]), np.eye(4)
    second[:3, 3] = sf * sp * ct, sf * sp * ct, -sf * st
    third = np.diag([1.0, 1.0, 1.0, -ct])
    third[:3, 3] = ct
    q_2, q_3 = np.eye(4), np.diag([1.0, 1.0, 1.0 / ct, 1.0 / cf])
    q_2[3, 2] = -tf
    q_3[1, 0], q_3[2, 1] = 1.0, tt * sf
    return first @ second @ third, -np.eye(4) @ q_2 @ q_3, delta


def _ch2_entry(mended: bool) -> float:
    """S of Eq. (44), or -1, beside the determinant of the printed P, the exact Delta, Q."""
    worst = 0.0
    for roll, pitch, yaw in np.random.default_rng(2).uniform(-1.2, 1.2, (50, 3)).tolist():
        p, q, delta = _ch2_matrices(roll, pitch, yaw)
        printed = cos(pitch) ** 2 * (cos(roll) ** 2 - cos(roll) * sin(roll)) - 1.0
        truth = float(np.linalg.det(p @ delta @ q))
        worst = max(worst, abs((-1.0 if mended else printed) - truth))
    return worst


def yaw_position_matrix_holds() -> bool:
    """Eq. (42) with M_1 and M_2 mended, beside difference quotients by turns about body axes."""
    worst, step = 0.0, 1e-6
    for angles in np.random.default_rng(4).uniform(-1.2, 1.2, (50, 3)):
        exact, attitude = np.zeros((4, 3)), rotation_matrix(angles)
        for axis, turn in enumerate(step * np.eye(3)):
            ahead, behind = (attitude @ rotation_matrix(sign * turn) for sign in (1.0, -1.0))
            yaw, back = (atan2(matrix[1, 0], matrix[0, 0]) for matrix in (ahead, behind))
            exact[:, axis] = np.append(behind[:, 2] - ahead[:, 2], yaw - back) / (2 * step)
        printed = _ch2_matrices(*angles.tolist())[2]
        worst = max(worst, float(np.abs(printed[:, 1:] - exact).max()))
        worst = max(worst, float(np.abs(printed[:3, 0] + attitude[:, 2]).max()))
    return worst < RIGHT


def eq_43_is_the_product() -> bool:
    """Whether P Delta Q, with printed P and Q and the exact Delta, is the matrix of Eq. (43)."""
    angles, printed = (0.3, 0.4, 0.5), np.eye(4)
    p, q, delta = _ch2_matrices(*angles)
    printed[:3, :3] = eq_43(*angles)
    return _relative(p @ delta @ q, printed) < RIGHT


def _ch2_reference(mended: bool) -> float:
    """Whether experiment 2, published as unstable, completes with the reference, or the goal."""
    from tiltsim.scenario.loading import load_scenario
    from tiltsim.simulation.simulate import simulate_to_end

    name = "goal" if mended else "reference"
    keys = {"simulation.plant": "thesis", "simulation.engine": "native"}
    address = f"ch02_singular_zone/experiments#experiment_2_{name}"
    return float(not simulate_to_end(load_scenario(address, keys)).metrics()["diverged"])


def _derivative_by_yaw(mended: bool) -> float:
    """Ch. 2, Eqs. (31), (36): M_1 and M_2, the derivatives of A_1 and A_2 with respect to yaw."""

    def thrust(roll: float, pitch: float, yaw: float) -> Floats:
        first = cos(roll) * cos(yaw) * sin(pitch) + sin(roll) * sin(yaw)
        return np.array([first, cos(roll) * sin(yaw) * sin(pitch) - sin(roll) * cos(yaw)])

    worst, step = 0.0, 1e-6
    for roll, pitch, yaw in np.random.default_rng(3).uniform(-1.2, 1.2, (50, 3)).tolist():
        exact = (thrust(roll, pitch, yaw + step) - thrust(roll, pitch, yaw - step)) / (2.0 * step)
        last = cos(roll) if mended else sin(roll)
        m_1 = cos(yaw) * sin(roll) - sin(yaw) * sin(pitch) * last
        m_2 = sin(yaw) * sin(roll) + cos(yaw) * sin(pitch) * last
        worst = max(worst, float(np.abs(exact - (m_1, m_2)).max()))
    return worst


def _ch2_gains(mended: bool) -> float:
    """Largest real part above zero of the position loop's roots with Appendix B's gains."""
    gains = POSITION_GAINS["stable" if mended else "ch02"]
    return max(0.0, float(np.roots((1.0, *gains.position)).real.max()))


def _routh(mended: bool) -> float:
    """Largest real part above zero of ch. 4's roll loop, or with the loop gain 2 w of hover."""
    gains, factor = GAIN_SETS["ch04"], 2.0 * _VEHICLE.hover_rotor_speed if mended else 1.0
    loop = (1.0, *(factor * gain for gain in gains.loops["roll"]))
    return max(0.0, float(np.roots(loop).real.max()))


def _labels(mended: bool) -> float:
    """Distance, m, of A_1 of Fig. 4 from statics with the decoupler that Sec. 7.1 calls A.

    At rest the torque-free force n is vertical, which gives roll and pitch; Eqs. (7), (8) or (29),
    (30) make the errors of them.
    """
    R, R_phi, R_theta = (float(part) for part in residuals((-0.65, -0.65, 0.65, 0.65), _VEHICLE))
    side = (0.0, 0.0) if mended else (-R_theta / R, R_phi / R)  # F_X/(m g), F_Y/(m g)
    pitch, roll = asin(R_theta / sqrt(R**2 + R_phi**2 + R_theta**2)), atan2(R_phi, R)
    error = (pitch + side[0], side[1] - roll)
    far = np.abs(_VEHICLE.gravity * np.array(error) - (3.35, -3.56)).max()
    return max(0.0, float(far) - 0.005)


def _triangle(mended: bool) -> float:
    """Grid points at which ch. 6's triangle, or the side of L, is wrong about R > 0."""
    wrong = 0
    cells = [cell for row in grid_roots(_VEHICLE)[1:-1] for cell in row[1:-1]]
    for cell in cells:
        first, second = cell[0].alpha_1, cell[0].alpha_2
        printed = second - first > 1.5 * pi / 16.0
        above = second > float(curve_l(first, _VEHICLE)) + 1e-9
        positive = any(root.R > 1e-9 for root in cell)
        wrong += (above if mended else printed) is not positive
    return float(wrong)


def _gait_6(mended: bool) -> float:
    """By how much, N, the vertical thrust of ch. 9's gait 6 misses 4.2 N, or 3.87 N."""
    return max(0.0, (3.87 if mended else 4.2) - float(torques(6).upper[2]))


def _accelerations(mended: bool) -> float:
    """How far the printed 2 m/s^2, or 0.12 m/s^2, are from gait 2's, above half a digit."""
    printed, digit = (0.12, 0.005) if mended else (2.0, 0.5)
    return max(0.0, abs(max(accelerations(2)) - printed) - digit)


def _counter_yaw(mended: bool) -> float:
    """Angular momentum left by Eq. (2), as a share of the top disc's; I_B of the bottom disc."""
    top, bottom = 0.001, 0.002
    yaw = counter_yaw(bottom) if mended else -top / bottom
    return abs(top * (yaw + 1.0) + bottom * yaw) / top


def _iff(mended: bool) -> float:
    """States in which the rank of [D1 | D2] is not 2 exactly if both, or either, rotor turns."""
    wrong = 0
    for speeds in ((200.0, 150.0), (200.0, 0.0), (0.0, 200.0), (0.0, 0.0)):
        columns = vehicle.input_matrix(np.array(speeds), vehicle.THESIS_CAR)
        stated = any(speeds) if mended else all(speeds)
        wrong += (np.linalg.matrix_rank(columns) == 2) != stated
    return float(wrong)


def _tilt_column(mended: bool) -> float:
    """Ch. 10: relative deviation of Eq. (27), or of it times 1 - I_T/I_B, from the tilt's column.

    The column of the tilt's second derivative in the fourth derivative of the position equals the
    column of the tilt in the acceleration, yaw following by Eq. (2): no other term contains it.
    """
    tilt, step, squares = 0.7, 1e-6, np.array([150.0**2, 120.0**2])
    turn = vehicle.turn_per_tilt(vehicle.THESIS_CAR)

    def at(alpha: float) -> Floats:
        return np.array(vehicle.acceleration(turn * alpha, squares, vehicle.THESIS_CAR))

    ahead, behind, (x, y) = at(tilt + step), at(tilt - step), at(tilt)
    exact = np.subtract(ahead, behind) / (2.0 * step)
    printed = np.array((-y, x)) * (turn if mended else 1.0)
    return max(0.0, float(np.abs(exact - printed).max() / np.hypot(x, y)) - 1e-6)


def _eq_66(mended: bool) -> float:
    """Sum of Eq. (66) on the bound of Eq. (40), with the second or the first derivative of e_m."""
    rates = np.linspace(0.0, 2.0, 21)
    errors = 0.5 * (1.0 / (9.0 * sqrt(3.0)) - rates)
    second = -9.0 * rates - 18.0 * errors
    return float(np.abs((rates if mended else second) + 2.0 * errors - 1 / (9 * sqrt(3.0))).max())


def _eq_72(mended: bool) -> float:
    """States with a falling candidate at which Eq. (72), or its opposite, is violated."""
    from tiltsim.report.measures.tilt_car import falling_states

    pairs = falling_states()
    wrong = [(now < later) == mended for now, later in pairs]
    return float(sum(wrong))


def _eq_52_54(mended: bool) -> float:
    """Slope of the candidate by Eq. (54), or (52), beside Eq. (61), on the bound of Eq. (46)."""
    side, worst, step = (1.0 if mended else -1.0), 0.0, 1e-6
    for rate in np.linspace(-1.0, -0.1, 10).tolist():
        error = 0.5 * (-1.0 / (9.0 * sqrt(3.0)) - rate)

        def value(t: float, error: float = error, rate: float = rate) -> float:
            push = side / sqrt(3.0)
            return 0.5 * (push * t + rate) ** 2 + 9.0 * (0.5 * push * t * t + rate * t + error) ** 2

        for t in (0.1, 0.5, 0.9):
            slope = (value(t + step) - value(t - step)) / (2.0 * step)
            line, parabola = t / sqrt(3.0) + rate, t * t / sqrt(3.0) + 2.0 * rate * t - rate
            worst = max(worst, abs(slope - 9.0 * line * parabola))
    return max(0.0, worst - 1e-5)


def _bibo(mended: bool) -> float:
    """Growth in 5 s of a mode that input and output of a BIBO stable system do not reach.

    The system is x' = diag(-1, 1) x + (1, 0) u, y = x_1; mended, without that mode: minimal.
    """
    modes = (-1.0,) if mended else (-1.0, 1.0)
    return max(0.0, max(exp(5.0 * mode) for mode in modes) - 1.0)
