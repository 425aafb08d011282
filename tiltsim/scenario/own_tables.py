"""References and gaits given in Python, as functions of time or tables of other libraries."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import ceil
from os import PathLike
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.scenario.limits import MAX_ROWS
from tiltsim.scenario.simulation_table import SimulationTable
from tiltsim.scenario.time_table import GAIT_COLUMNS, REFERENCE_COLUMNS, rows_of_columns
from tiltsim.system.numbers import is_finite
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Values

SAMPLING_STEP: Final = 0.01
"""Seconds between the rows of a function of time, unless the flight is too long for that."""

KEPT_KEYS: Final = ("roll", "pitch", "yaw", "acceleration_feedforward")
"""Keys of a reference that stay when another motion is given."""


def replace_tables(document: dict[str, Any], *, reference: object, gait: object) -> None:
    """Replace a scenario's reference and gait by tables, unless they are None.

    Args:
        document: Changed in place.
        reference, gait: See `tiltsim.load_scenario`.

    Raises:
        InputError: In one line: the argument, the value and what is allowed.
    """
    simulation = document.get("simulation")
    duration = simulation.get("duration") if isinstance(simulation, Mapping) else None
    if not is_finite(duration) or duration <= 0.0:  # is refused where all is checked
        duration = SimulationTable.model_fields["duration"].default
    if reference is not None:
        old = document.get("reference")
        kept = {key: old[key] for key in KEPT_KEYS if key in old} if isinstance(old, dict) else {}
        table = _table("reference", reference, REFERENCE_COLUMNS, duration)
        document["reference"] = table | kept
    if gait is not None:
        document["gait"] = _table("gait", gait, GAIT_COLUMNS, duration)


def _table(name: str, value: Any, columns: Sequence[str], duration: float) -> dict[str, Any]:
    """The table of a scenario for an argument."""
    if isinstance(value, str | PathLike):
        return {"type": "table", "file": value}
    if callable(value):
        return {"type": "table", "rows": [*_samples(name, value, len(columns) - 1, duration)]}
    if not (isinstance(value, Mapping) or hasattr(value, "columns")):
        raise InputError(
            f"{name} = {short_repr(value)}: must be a function of time, the name of a CSV or "
            f"Parquet file, or a table with the columns {', '.join(columns)}"
        )
    try:
        return {"type": "table", "rows": rows_of_columns(value, columns)}
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _samples(
    name: str, function: Callable[[float], Any], size: int, duration: float
) -> Iterator[Values]:
    """Rows of a function of time in even steps over a flight, or over ten steps if it is longer."""
    span = max(duration, 10 * SAMPLING_STEP)
    steps = min(MAX_ROWS - 1, ceil(span / SAMPLING_STEP))
    for time in np.linspace(0.0, span, steps + 1).tolist():
        try:
            returned = function(time)
        except Exception as error:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            raise InputError(f"{name}({time:g}) raised {what}") from error
        try:
            values = np.asarray(returned, dtype=float)
        except (TypeError, ValueError):
            values = np.array(np.nan)
        if values.shape != (size,) or not np.isfinite(values).all():
            shown = short_repr(returned)
            raise InputError(f"{name}({time:g}) = {shown}: must be {size} finite numbers")
        yield (time, *values.tolist())
