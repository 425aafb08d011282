"""Labels and units of quantities."""

from __future__ import annotations

from typing import Final, NamedTuple

SUBSCRIPTS: Final = "₀₁₂₃₄₅₆₇₈₉"
"""Digits as subscripts."""


class Quantity(NamedTuple):
    """The label of a quantity in tables and figures, and its unit; empty or 1 if dimensionless."""

    label: str
    unit: str = ""

    @property
    def text(self) -> str:
        """The label with the unit in brackets."""
        unit = self.unit.replace("^2", "²").replace("^3", "³")
        return f"{self.label} ({unit})" if unit not in {"", "1"} else self.label


def subscript(number: int) -> str:
    """A whole number, 0 or more, as a subscript."""
    return "".join(SUBSCRIPTS[int(digit)] for digit in str(number))


def in_words(name: str) -> str:
    """A name of code, such as ``gait.bias_angle``, in words."""
    return name.replace("_", " ").replace(".", " ").strip()
