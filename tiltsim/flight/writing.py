"""Write a flight into a folder: metrics.json, flight.parquet, scenario.toml.

A later flight into the same folder replaces these files, but never a scenario or controller that
somebody has written or edited: the resolved scenario begins with digests of itself and of the
controller that was copied with it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.loading import scenario_toml
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.files import prepare_folder, replacing
from tiltsim.system.parquet import parquet_bytes
from tiltsim.system.text import printable

if TYPE_CHECKING:
    import pyarrow

FLIGHT: Final = "flight.parquet"
METRICS: Final = "metrics.json"
SCENARIO: Final = "scenario.toml"

_WRITTEN: Final = "# written by tiltsim: sha256 {}\n"
_COPIED: Final = "# its controller: sha256 {}\n"
_UNWRITTEN: Final = (
    "# Not to be flown from this file: its controller, {}, was given in Python. Give it again:\n"
    '# tiltsim.simulate("scenario.toml", controller=...)\n'
)


def prepare_flight_folder(folder: Path, scenario: Scenario) -> None:
    """Create a folder for a flight of a scenario.

    Raises:
        InputError: If that is impossible, or the flight would replace what is not a file, or a
            scenario or controller that tiltsim did not write.
    """
    prepare_folder(folder)
    controller = _controller_file(scenario)
    files = [folder / name for name in (FLIGHT, METRICS, SCENARIO)]
    files += [] if controller is None else [folder / controller.name]
    for file in files:
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: not a file; choose another folder")
    written = _read_if_written(folder / SCENARIO)
    if controller is not None:
        copy = folder / controller.name
        if copy.exists() and not copy.samefile(controller):
            digest = _digest(copy.read_bytes())
            if digest != _digest(controller.read_bytes()) and _COPIED.format(digest) not in written:
                raise _foreign(copy)


def write_flight(
    folder: Path, table: pyarrow.Table, metrics: Mapping[str, float | bool], scenario: Scenario
) -> None:
    """Write a flight into a folder; each file appears whole or not at all.

    Args:
        folder: Where to; created if missing.
        table: The columns, for flight.parquet.
        metrics: For metrics.json.
        scenario: For scenario.toml, with all defaults filled in; the file of a user's controller is
            copied.

    Raises:
        InputError: As `prepare_flight_folder`, or if a file cannot be written.
    """
    prepare_flight_folder(folder, scenario)
    with replacing(folder / FLIGHT) as path:
        path.write_bytes(parquet_bytes(table))
    with replacing(folder / METRICS) as path:
        path.write_text(metrics_json(metrics), encoding="utf-8")
    text = resolved_text(scenario, folder)
    with replacing(folder / SCENARIO) as path:
        path.write_bytes(text.encode())


def resolved_text(scenario: Scenario, folder: Path) -> str:
    """The text of scenario.toml; the file of a user's controller is copied to its folder."""
    controller, table, copied = _controller_file(scenario), scenario.controller, ""
    if controller is not None and isinstance(table, PythonController):
        copy, content = folder / controller.name, controller.read_bytes()
        if not (copy.exists() and copy.samefile(controller)):
            with replacing(copy) as path:
                path.write_bytes(content)
        named = table.model_copy(update={"function": f"{copy.name}:{table.attribute}"})
        scenario = scenario.model_copy(update={"controller": named})
        copied = _COPIED.format(_digest(content))
    elif isinstance(table, PythonController):
        copied = _UNWRITTEN.format(printable(table.function))
    text = copied + scenario_toml(scenario)
    return _WRITTEN.format(_digest(text.encode())) + text


def _controller_file(scenario: Scenario) -> Path | None:
    """The file of a user's controller, if the scenario names one that exists."""
    table = scenario.controller
    file = table.file if isinstance(table, PythonController) else None
    return file if file is not None and file.is_file() else None


def _read_if_written(file: Path) -> str:
    """The text of a resolved scenario, empty without one; `InputError` if it is somebody's own."""
    if not file.exists():
        return ""
    content = file.read_bytes()
    first, _, text = content.partition(b"\n")
    if first + b"\n" != _WRITTEN.format(_digest(text)).encode():
        raise _foreign(file)
    return content.decode()


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()


def _foreign(file: Path) -> InputError:
    return InputError(
        f"{file}: not written by tiltsim, or edited since; choose another folder, or move it away"
    )


def metrics_json(metrics: Mapping[str, float | bool]) -> str:
    """Metrics as a flat JSON object in the order of `METRICS`, with all their digits."""
    return json.dumps(dict(metrics), indent=2, allow_nan=False) + "\n"
