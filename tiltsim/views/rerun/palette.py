"""Colours for Rerun's dark and light themes, after Okabe and Ito's colour-blind safe palette."""

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
"""Colours of the flights of a comparison, in order."""

UNREACHABLE: Final = (92, 50, 42)
"""Colour of the region of unreachable attitudes."""


def dimmed(color: Color, factor: float = 0.62) -> Color:
    """A darker shade of a colour, for the reference of a quantity shown in ``color``."""
    red, green, blue = (round(channel * factor) for channel in color)
    return red, green, blue
