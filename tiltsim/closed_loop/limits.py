"""Limits beyond which a vehicle has diverged, so wide that none returns from there."""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, Final

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.references.trajectories import ReferenceParameters, position_reference

MAX_POSITION_ERROR: Final = 1e4  # m
MAX_BODY_RATE: Final = 1e3  # rad/s, far above what any rotorcraft survives
MAX_ROTOR_SPEED: Final = 1e5  # rad/s

SINGULAR: Final = 1e-9
"""Numbers whose sign is checked are zero below this; determinants are of order one."""

WITHIN_LIMITS: Final = 0
HORIZONTAL_ERROR: Final = 1
ALTITUDE_ERROR: Final = 2
BODY_RATE: Final = 3  # the code of p; q and r have the next ones
ROTOR_SPEED: Final = 6  # the code of the first rotor; the other rotors have the next ones
VEHICLE: Final = 100
"""The step from the codes of one vehicle to the codes of the next, where there are several."""


def horizontal_error(time: Any, values: Any, reference: ReferenceParameters, knots: Any) -> Any:
    """Horizontal distance (m) to the reference.

    Args:
        time: s.
        values: Fields of a sample after its time; they begin with the position, m.
        reference, knots: The reference trajectory.
    """
    target = position_reference(time, reference, knots)
    return xp.hypot(target[0] - values[0], target[1] - values[1])


def altitude_error(time: Any, values: Any, reference: ReferenceParameters, knots: Any) -> Any:
    """Absolute altitude error (m).

    Args:
        time, values, reference, knots: See `horizontal_error`.
    """
    return abs(position_reference(time, reference, knots)[2] - values[2])


def first_limit(exceeded: Iterable[tuple[Any, int]]) -> Any:
    """The code of the first of pairs that is exceeded, `WITHIN_LIMITS` for none."""
    found: Any = float(WITHIN_LIMITS)
    for is_exceeded, code in reversed([*exceeded]):
        found = xp.where(is_exceeded, float(code), found)
    return found


@cache
def limit_exceeded_of(fields: tuple[str, ...]) -> Callable[..., Any]:
    """Function of a sample with these fields; see `VehicleKind.limit_exceeded`."""
    speeds = [place for place, name in enumerate(fields) if name.startswith("rotor_speed_")]
    rates = [fields.index(name) for name in "pqr"] if "p" in fields else []

    @traceable
    def limit_exceeded(
        time: Any, values: Any, reference: ReferenceParameters, knots: Any, follows_position: Any
    ) -> Any:
        away = follows_position * horizontal_error(time, values, reference, knots)
        found = [(away > MAX_POSITION_ERROR, HORIZONTAL_ERROR)]
        if "z" in fields:
            height = altitude_error(time, values, reference, knots)
            found += [(height > MAX_POSITION_ERROR, ALTITUDE_ERROR)]
        for places, limit, code in (
            (rates, MAX_BODY_RATE, BODY_RATE),
            (speeds, MAX_ROTOR_SPEED, ROTOR_SPEED),
        ):
            found += [(abs(values[at]) > limit, code + i) for i, at in enumerate(places)]
        return first_limit(found)

    return limit_exceeded
