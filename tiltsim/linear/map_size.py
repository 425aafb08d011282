"""Default size of the map of `tiltsim.linear.attraction`; the command line reads it alone."""

from __future__ import annotations

from typing import Final

COARSE: Final = 12
"""Cells across, before they are divided."""

REFINEMENTS: Final = 3
"""Number of times that cells at the boundary are divided."""
