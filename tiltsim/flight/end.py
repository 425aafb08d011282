"""Ends of flights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

EndKind = Literal["completed", "diverged", "singular", "interrupted", "failed"]
"""``singular``: at a singular decoupling matrix; ``failed``: a user's own controller failed."""


@dataclass(frozen=True)
class End:
    """Kind, time and cause of a flight's end."""

    kind: EndKind
    time: float  # s
    cause: str = ""

    @property
    def message(self) -> str:
        """One line on a flight that was not completed."""
        return f"flight terminated early at t = {self.time:.3f} s ({self.kind}): {self.cause}"
