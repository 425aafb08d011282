"""Gain sets by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim_controllers.laws.attitude_altitude import Gains

if TYPE_CHECKING:
    from collections.abc import Sequence


def gains_from_rows(
    attitude: Sequence[Sequence[float]], altitude: Sequence[float], position: Sequence[float]
) -> Gains:
    """Gains in the layout of the thesis.

    ``attitude`` contains the diagonals of K_P1, K_P2 and K_P3, each (roll, pitch, yaw);
    ``altitude`` is (K_PZ1, K_PZ2, K_PZ3) and ``position`` (K_X1, K_X2).
    """
    (roll_1, pitch_1, yaw_1), (roll_2, pitch_2, yaw_2), (roll_3, pitch_3, yaw_3) = attitude
    roll, pitch, yaw = (roll_1, roll_2, roll_3), (pitch_1, pitch_2, pitch_3), (yaw_1, yaw_2, yaw_3)
    return Gains(*roll, *pitch, *yaw, *altitude, *position)


class IntegralGains(NamedTuple):
    """Gains on the integrals of the position error."""

    position: float = 0.0  # 1/s^3, x and y
    altitude: float = 0.0  # 1/s^4


class Poles(NamedTuple):
    """The desired poles of a closed loop."""

    bandwidth: float  # [omega] natural frequency of its pair of poles, rad/s
    damping: float = 1.0  # [zeta] of the pair
    integral: float = 0.0  # [lambda] pole at -lambda for an integral, rad/s; 0 for none


def second_order_gains(poles: Poles) -> tuple[float, float, float]:
    """Gains of ``(s^2 + 2 zeta omega s + omega^2)(s + lambda)``, the integral's last."""
    omega, zeta, integral = poles
    return (
        2.0 * zeta * omega + integral,
        omega * omega + 2.0 * zeta * omega * integral,
        omega * omega * integral,
    )


def third_order_gains(poles: Poles) -> tuple[float, float, float, float]:
    """Gains of ``(s^2 + 2 zeta omega s + omega^2)(s + omega)(s + lambda)``, the integral's last."""
    omega, zeta, integral = poles
    k1, k2, k3 = (1.0 + 2.0 * zeta) * omega, (1.0 + 2.0 * zeta) * omega**2, omega**3
    return k1 + integral, k2 + k1 * integral, k3 + k2 * integral, k3 * integral


def gains_from_poles(
    attitude: Poles, yaw: Poles, altitude: Poles, position: Poles
) -> tuple[Gains, IntegralGains]:
    """Gains by pole placement, for the exact decoupling matrix.

    Args:
        attitude, yaw, altitude: poles of third-order loops, with a real pole at the bandwidth
        position: poles of a second-order loop
    """
    lean, turn = third_order_gains(attitude)[:3], third_order_gains(yaw)[:3]
    *climb, climb_integral = third_order_gains(altitude)
    *move, move_integral = second_order_gains(position)
    gains = Gains(*lean, *lean, *turn, *climb, *move)
    return gains, IntegralGains(move_integral, climb_integral)


GAIN_SETS: Final = {
    # ch. 3, Sec. 3.2; the position loop is ch. 4's, ch. 3 has none
    "ch03": gains_from_rows([[1, 1, 1], [1, 1, 1], [1, 1, 1]], [10, 5, 10], [1, 1]),
    # ch. 4, Sec. 3.4, Eqs. (26)-(28)
    "ch04": gains_from_rows([[1, 1, 1], [10, 10, 1], [50, 50, 1]], [10, 5, 10], [1, 1]),
    # for the exact decoupling matrix, under which the two sets above fail Proposition 4: attitude
    # poles at -20 and -10 +- 10j, altitude poles well damped near -1 to -14
    "exact": gains_from_rows([[40] * 3, [600] * 3, [4000] * 3], [10, 15, 10], [1, 1]),
    # for gait-rate feed-forward: attitude poles at -25, yaw's and the altitude's at -10, -1.5
    "feedforward": gains_from_poles(Poles(25.0), Poles(10.0), Poles(10.0), Poles(1.5))[0],
}
"""Named gain sets; `exact` and `feedforward` are ours, the others published."""
