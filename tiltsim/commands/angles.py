"""Parsing angles and vehicles from the command line; mistakes become one-line errors."""

from __future__ import annotations

import argparse
import re
from math import isfinite, pi
from typing import TYPE_CHECKING, Final

from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim_controllers.vehicle.parameters import Vehicle

MIN_PARAMETER: Final = 1e-12
MAX_PARAMETER: Final = 1e9
"""Range of a parameter (SI units), far from underflow and overflow."""


def allow_negative_lists(parser: argparse.ArgumentParser) -> None:
    """Accept ``-0.5,0.5`` as a value, not an option, as argparse does for plain ``-0.5``."""
    parser._negative_number_matcher = re.compile(r"-\.?\d")


def parse_angle(option: str, text: str) -> float:
    """One angle in rad. Raises `InputError` unless it is finite and at most half a turn."""
    return parse_angles(option, text, 1)[0]


def parse_angles(option: str, text: str, count: int = 4) -> tuple[float, ...]:
    """Angles in rad, separated by commas. Raises `InputError` like `parse_angle`."""
    parts = text.split(",") if count > 1 else [text]
    if len(parts) != count:
        raise InputError(
            f"{option} {text}: needs {count} angles separated by commas, has {len(parts)}"
        )
    try:
        values = [float(part) for part in parts]
    except ValueError:
        expected = "a number" if count == 1 else f"{count} numbers"
        raise InputError(f"{option} {text}: must be {expected}, in rad") from None
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


def parse_acceleration(text: str) -> tuple[float, float, float]:
    """The acceleration ``AX,AY,AZ`` of ``--balance``, m/s^2. Raises `InputError`."""
    try:
        ax, ay, az = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--balance {text}: must be three numbers, m/s^2") from None
    return ax, ay, az


def parse_vehicle(text: str | None) -> Vehicle:
    """A vehicle: a preset's name, ``KEY=VALUE`` in place of its parameters, or both.

    The parts are separated by commas, the preset first; without one, and for None, it is
    ar_drone_2. Raises `InputError`, which lists the choices.
    """
    from tiltsim_controllers.vehicle.parameters import PRESETS

    parts = [] if text is None else [part.strip() for part in text.split(",")]
    name = parts.pop(0) if parts and "=" not in parts[0] else "ar_drone_2"
    if name not in PRESETS:
        choices = f"{', '.join(PRESETS)}, or KEY=VALUE"
        raise InputError(f"--vehicle {text}: {name!r} is not a vehicle; choose {choices}")
    vehicle = PRESETS[name]
    changes: dict[str, float] = {}
    for part in parts:
        key, equals, value = part.partition("=")
        if not equals:
            raise InputError(f"--vehicle {text}: {part!r}: write KEY=VALUE after the preset")
        if key not in vehicle._fields:
            choices = ", ".join(vehicle._fields)
            raise InputError(f"--vehicle {text}: {key!r} is not a parameter; choose {choices}")
        if key in changes:
            raise InputError(f"--vehicle {text}: {key} is given twice")
        changes[key] = _positive(f"--vehicle {text}: {key}", value)
    return vehicle._replace(**changes)


def vehicle_text(vehicle: str | dict[str, float]) -> str:
    """A report's vehicle as `parse_vehicle` reads it: the closest preset and the differences."""
    from tiltsim_controllers.vehicle.parameters import PRESETS

    if isinstance(vehicle, str):
        return vehicle
    differing = {
        name: [
            f"{key}={value!r}" for key, value in vehicle.items() if getattr(preset, key) != value
        ]
        for name, preset in PRESETS.items()
    }
    name = min(differing, key=lambda name: len(differing[name]))
    none_shared = len(differing[name]) == len(vehicle)
    return ",".join(differing[name] if none_shared else [name, *differing[name]])


def parse_speed_limits(text: str) -> tuple[float, float]:
    """Minimum and maximum rotor speed (rad/s), separated by a comma."""
    parts = text.split(",")
    if len(parts) != 2:
        raise InputError(f"--speed-limits {text}: needs MIN,MAX in rad/s")
    low, high = (_positive(f"--speed-limits {text}: limit", part) for part in parts)
    if low >= high:
        raise InputError(f"--speed-limits {text}: the first must be less than the second")
    return low, high


def _positive(place: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not MIN_PARAMETER <= value <= MAX_PARAMETER:
        allowed = f"must be a number from {MIN_PARAMETER:g} to {MAX_PARAMETER:g}"
        raise InputError(f"{place} = {text}: {allowed}")
    return value
