"""How a flight ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tiltsim.vehicles.rotorcraft import COLUMN_UNITS as COLUMN_UNITS

EndKind = Literal["completed", "diverged", "singular", "interrupted", "failed"]
"""A flight fails where a user's own controller does."""


@dataclass(frozen=True)
class End:
    """How a flight ended: ``kind``, when (s), and in words why."""

    kind: EndKind
    time: float
    cause: str = ""

    @property
    def message(self) -> str:
        """One line on a flight that was not completed."""
        return f"flight terminated early at t = {self.time:.3f} s ({self.kind}): {self.cause}"
