"""Gain sets by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from controllers.attitude_altitude import Gains

if TYPE_CHECKING:
    from collections.abc import Sequence


def gains_from_rows(
    attitude: Sequence[Sequence[float]], altitude: Sequence[float], position: Sequence[float]
) -> Gains:
    """Gains in the thesis' own layout.

    ``attitude`` holds the diagonals of K_P1, K_P2 and K_P3, each (roll, pitch, yaw); ``altitude``
    is (K_PZ1, K_PZ2, K_PZ3) and ``position`` (K_X1, K_X2).
    """
    (roll_1, pitch_1, yaw_1), (roll_2, pitch_2, yaw_2), (roll_3, pitch_3, yaw_3) = attitude
    return Gains(
        *(roll_1, roll_2, roll_3),
        *(pitch_1, pitch_2, pitch_3),
        *(yaw_1, yaw_2, yaw_3),
        *altitude,
        *position,
    )


GAIN_SETS: Final = {
    # ch. 3, Sec. 3.2; the position loop is ch. 4's, ch. 3 has none
    "ch03": gains_from_rows([[1, 1, 1], [1, 1, 1], [1, 1, 1]], [10, 5, 10], [1, 1]),
    # ch. 4, Sec. 3.4, Eqs. (26)-(28)
    "ch04": gains_from_rows([[1, 1, 1], [10, 10, 1], [50, 50, 1]], [10, 5, 10], [1, 1]),
    # for the exact decoupling matrix, under which the two sets above fail Proposition 4: attitude
    # poles at -20 and -10 +- 10j, altitude poles well damped near -1 to -14
    "exact": gains_from_rows([[40] * 3, [600] * 3, [4000] * 3], [10, 15, 10], [1, 1]),
}
"""Named gain sets; `exact` is ours, the others are published."""
