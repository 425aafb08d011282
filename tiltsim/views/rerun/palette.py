"""Colours on Rerun's dark and light grounds, after Okabe and Ito's colour-blind safe set."""

from __future__ import annotations

from typing import Final

Color = tuple[int, int, int]

AMBER: Final = (230, 159, 0)
SKY: Final = (86, 180, 233)
GREEN: Final = (0, 178, 132)
YELLOW: Final = (240, 228, 66)
BLUE: Final = (58, 136, 226)
RED: Final = (226, 94, 20)
PINK: Final = (215, 134, 182)
GREY: Final = (140, 148, 158)
FAINT: Final = (88, 94, 102)
WHITE: Final = (235, 238, 242)

FLIGHTS: Final = (SKY, AMBER, PINK, GREEN, YELLOW, RED, BLUE, GREY)
"""Colours of flights that are compared, in order."""

FORBIDDEN: Final = (92, 50, 42)
"""The ground of attitudes that cannot be reached."""


def dimmed(color: Color, share: float = 0.62) -> Color:
    """A darker shade: the reference of what is shown in ``color``."""
    red, green, blue = (round(channel * share) for channel in color)
    return red, green, blue
