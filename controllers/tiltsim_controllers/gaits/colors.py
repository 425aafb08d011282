"""The colors of the Two Color Map (ch. 6 to 8, 12): tilt angles that two of them determine."""

from __future__ import annotations

from math import atan
from typing import Final

COLORS: Final = ("red", "blue")
"""The colors of the Two Color Map (ch. 6)."""


def colored_angles(
    alpha_1: float, alpha_2: float, color: str, drag_ratio: float
) -> tuple[float, float]:
    """``(alpha_3, alpha_4)`` (rad) of a color (ch. 8, Eqs. 11-12, with the exact offset).

    With ``delta = atan(r)`` both colors are exact lines for any vehicle: red ``alpha_3 = alpha_1,
    alpha_4 = alpha_2``, blue ``alpha_3 = 2 delta - alpha_1, alpha_4 = -2 delta - alpha_2``.

    Args:
        alpha_1, alpha_2: rad
        color: ``red`` or ``blue``
        drag_ratio: ``r = K_m / (L K_f)``

    Raises:
        ValueError: If there is no such color.
    """
    require_color(color)
    if color == "red":
        return alpha_1, alpha_2
    offset = 2.0 * atan(drag_ratio)
    return offset - alpha_1, -offset - alpha_2


def require_color(color: str) -> None:
    """Raise ValueError unless there is a color of this name."""
    if color not in COLORS:
        raise ValueError(f"{color!r} is not a color; choose {', '.join(COLORS)}")
