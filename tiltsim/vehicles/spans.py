"""Spans of samples that metrics cover, and the metrics that vehicles share.

Columns have shape (..., N): one flight, or several in rows, with equal times (N,).
Spans are counted in physics steps instead of sums of their lengths.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tiltsim.scenario.metric_names import METRICS
from tiltsim.scenario.rotorcraft import AnyVehicleTable
from tiltsim_controllers.mathematics.scalar import Floats

SETTLED: Final = 20.0  # time (s) from which on the supremum of the position error is taken
_ROUNDING: Final = 1e-9  # relative: of a time over a time step, of a speed at its limit


def in_last_second(time: Floats, timestep: float) -> npt.NDArray[np.bool_]:
    """The samples of the last second, both ends included; ``time`` and ``timestep`` in s."""
    steps = np.rint(time / timestep)
    return steps[-1] - steps <= (1.0 + _ROUNDING) / timestep


def when_settled(time: Floats, timestep: float) -> npt.NDArray[np.bool_]:
    """The samples from `SETTLED` on; ``time`` and ``timestep`` in s."""
    return np.rint(time / timestep) >= (1.0 - _ROUNDING) * SETTLED / timestep


def mean_of(column: Floats, span: npt.NDArray[np.bool_]) -> Any:
    """The mean over some samples, in one order of summation for one flight and for rows."""
    return np.mean(np.compress(span, column, axis=-1), axis=-1)


def position_error(*errors: Floats) -> dict[str, Any]:
    """Metrics of the distance from the reference, from its components (m), shape (..., N) each."""
    square = sum(error * error for error in errors)
    return {
        "rms_position_error": np.sqrt(np.mean(square, axis=-1)),
        "max_position_error": np.sqrt(square).max(axis=-1),
    }


NUMBERS: Final[Mapping[str, Callable[[Floats], Any]]] = {
    "max": lambda column: column.max(axis=-1),
    "min": lambda column: column.min(axis=-1),
    "max_abs": lambda column: np.abs(column).max(axis=-1),
    "last": lambda column: column[..., -1],
}
"""Numbers of a column that a metric may be."""


def with_columns_metrics(own: dict[str, Any], columns: Mapping[str, Floats]) -> dict[str, Any]:
    """Metrics of a kind of vehicle and the numbers of columns among the metrics, in order."""
    found = {
        name: NUMBERS[metric.number](columns[metric.column])
        for name, metric in METRICS.items()
        if metric.column in columns
    }
    whole = own | found
    return {name: whole[name] for name in METRICS if name in whole}


def largest(values: Iterable[Any]) -> Any:
    """The largest of arrays (...), one by one; a NaN that comes first stays, as in ``max``."""
    first, *others = values
    for other in others:
        first = np.where(other > first, other, first)
    return first


def first_and_last(where: npt.NDArray[np.bool_]) -> tuple[Any, Any]:
    """The first and the last sample, shape (...), at which something is the case, -1 if none."""
    count = where.shape[-1]
    if not count:
        return np.full(where.shape[:-1], -1), np.full(where.shape[:-1], -1)
    found = where.any(axis=-1)
    first, last = where.argmax(axis=-1), count - 1 - where[..., ::-1].argmax(axis=-1)
    return np.where(found, first, -1), np.where(found, last, -1)


def time_of(time: Floats, sample: Any) -> Any:
    """The times (s) of samples (...), NaN for -1."""
    return np.where(sample < 0, np.nan, time[sample])


def at_upper_limit(speeds: Floats, limit: Any) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their upper limit; nowhere without one."""
    return speeds >= (np.inf if limit is None else limit * (1.0 - _ROUNDING))


def at_lower_limit(speeds: Floats, limit: Any) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their lower limit; nowhere without one."""
    return speeds <= (-np.inf if limit is None else limit * (1.0 + _ROUNDING))


def speeds_along_spin(columns: Mapping[str, Floats], vehicle: AnyVehicleTable) -> Floats:
    """Rotor speeds along their spins, rad/s, shape (rotors, ..., N)."""
    signs = enumerate(vehicle.spins, start=1)
    return np.array([sign * columns[f"rotor_speed_{i}"] for i, sign in signs])


def rotor_metrics(columns: Mapping[str, Floats], vehicle: AnyVehicleTable) -> dict[str, Any]:
    """Ranges of rotor speeds and tilt rates; share of samples with a rotor at its limit, and when.

    The first and last of these samples are NaN where there is none.
    """
    speeds = speeds_along_spin(columns, vehicle)
    low, high = vehicle.rotor_range
    reached = at_upper_limit(speeds, high) | at_lower_limit(speeds, low)
    limited: npt.NDArray[np.bool_] = np.any(reached, axis=0)
    first, last = first_and_last(limited)
    names = [name for name in columns if name.startswith("alpha_rate")]
    rates = [np.abs(columns[name]).max(axis=-1) for name in names]
    return {
        "min_rotor_speed": speeds.min(axis=(0, -1)),
        "max_rotor_speed": speeds.max(axis=(0, -1)),
        "max_tilt_rate": largest(rates) if rates else np.zeros(speeds.shape[1:-1]),
        "saturated_fraction": limited.mean(axis=-1),
        "first_saturation_time": time_of(columns["time"], first),
        "last_saturation_time": time_of(columns["time"], last),
    }


def horizontal_error_metrics(columns: Mapping[str, Floats], timestep: float) -> dict[str, Any]:
    """The largest and the smallest horizontal position error (m) from `SETTLED` on, if it lasts."""
    settled = when_settled(columns["time"], timestep)
    if not settled.any():
        return {}
    x, y = (columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y"))
    error = np.hypot(x, y)[..., settled]
    return {
        "sup_position_error_after_20s": error.max(axis=-1),
        "least_position_error_after_20s": error.min(axis=-1),
    }
