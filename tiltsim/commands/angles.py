"""Reading tilt angles, attitudes and vehicles from the command line: one line for a mistake."""

from __future__ import annotations

import re
from math import isfinite, pi
from typing import TYPE_CHECKING, Any

from tiltsim.errors import InputError

if TYPE_CHECKING:
    from controllers.vehicle import Vehicle


def allow_negative_lists(parser: Any) -> None:
    """Let ``-0.5,0.5`` be a value and not an option, as argparse has it for plain ``-0.5``."""
    parser._negative_number_matcher = re.compile(r"-\.?\d")


def parse_angle(option: str, text: str) -> float:
    """One angle in rad; `InputError` for what is no angle, or looks like degrees."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{option} {text}: must be a number, in rad") from None
    return _checked(option, text, value)


def parse_angles(option: str, text: str, count: int = 4) -> tuple[float, ...]:
    """Angles in rad, separated by commas; `InputError` as `parse_angle`, or for a wrong count."""
    parts = text.split(",")
    if len(parts) != count:
        raise InputError(
            f"{option} {text}: needs {count} angles separated by commas, has {len(parts)}"
        )
    try:
        values = [float(part) for part in parts]
    except ValueError:
        raise InputError(f"{option} {text}: must be {count} numbers, in rad") from None
    return tuple(_checked(option, text, value) for value in values)


def _checked(option: str, text: str, value: float) -> float:
    if not isfinite(value):
        raise InputError(f"{option} {text}: must be finite")
    if abs(value) > pi:
        raise InputError(
            f"{option} {text}: {value:g} is more than half a turn; angles are in rad"
            f" ({value:g} degrees would be {value * pi / 180:.4f})"
        )
    return value


def parse_vehicle(name: str | None) -> Vehicle:
    """A vehicle by its preset name, the default for None; `InputError` lists the choices."""
    from controllers.vehicle import PRESETS

    if name is None:
        return PRESETS["ar_drone_2"]
    if name not in PRESETS:
        raise InputError(f"--vehicle {name}: unknown; choose {', '.join(PRESETS)}")
    return PRESETS[name]
