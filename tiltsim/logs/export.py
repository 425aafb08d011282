"""Flights in the formats of other tools: MCAP, ULog and CSV."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.logs.log import Log
from tiltsim.logs.mcap import write_mcap
from tiltsim.logs.ulog import write_ulog
from tiltsim.models.cross import as_multirotor
from tiltsim.system.files import prepare_file, replacing
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

FORMATS: Final = {"mcap": ".mcap", "ulog": ".ulg", "csv": ".csv"}
"""Formats and the suffix of their files."""


def export(
    flight: Flight,
    path: str | PathLike[str],
    format: str | None = None,  # noqa: A002
) -> None:
    """Write all columns of a flight, every bit of them, into a file of another format.

    Args:
        flight: The flight.
        path: The file.
        format: mcap, ulog or csv; None takes the one of the file's suffix.

    Raises:
        InputError: If the format is unknown, its package is missing or the file cannot be written.
    """
    if not isinstance(flight, Flight):
        raise InputError(f"flight = {short_repr(flight)}: must be a tiltsim.Flight")
    if not isinstance(path, str | PathLike):
        raise InputError(f"path = {short_repr(path)}: must be the name of a file")
    file, by_suffix = Path(path), {suffix: name for name, suffix in FORMATS.items()}
    chosen = by_suffix.get(file.suffix.lower()) if format is None else format
    if chosen not in FORMATS:
        given = f"format = {short_repr(format)}" if format is not None else f"{file}"
        raise InputError(f"{given}: choose {', '.join(FORMATS)}")
    prepare_file("path", file)
    log = Log.of_flight(flight)
    if chosen != "csv" and flight.scenario.vehicle.model == "tilt_car":
        raise InputError(f"{file}: a tilt-car moves in a plane; choose csv")
    with replacing(file) as temporary:
        if chosen == "csv":
            _write_csv(log, temporary)
        elif chosen == "ulog":
            write_ulog(log, temporary)
        else:
            write_mcap(log, temporary, _rotor_places(flight))


def _write_csv(log: Log, file: Path) -> None:
    rows = np.stack([log[name] for name in log.units], axis=1).tolist()
    lines = [",".join(log.units), *(",".join(map(repr, row)) for row in rows)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rotor_places(flight: Flight) -> Floats:
    """Where the rotors are at tilt angles of zero, body axes, m, shape (rotors, 3)."""
    table = flight.scenario.any_rotorcraft
    vehicle = as_multirotor(table.resolve(), tilting=table.has_tilting_rotors)
    return np.array([rotor.place for rotor in vehicle.rotors])
