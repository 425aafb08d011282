"""Linear analysis of closed loops: rest points, periodic orbits, margins, regions of attraction."""

from typing import Final

COARSE: Final = 12  # default cells across a map of attraction, before they are divided
REFINEMENTS: Final = 3  # default number of times that cells at its boundary are divided
