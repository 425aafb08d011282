"""Write a flight into a folder: metrics.json, flight.parquet, scenario.toml.

A later flight into the same folder replaces these files, but none that tiltsim has not written, and
no scenario or controller that was edited: the resolved scenario begins with digests of itself and
of the controllers that were copied into the folder.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.loading import scenario_toml
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.files import digest, file_digests, prepare_folder, replacing
from tiltsim.system.parquet import parquet_bytes
from tiltsim.system.text import printable

if TYPE_CHECKING:
    import pyarrow

FLIGHT: Final = "flight.parquet"
METRICS: Final = "metrics.json"
SCENARIO: Final = "scenario.toml"

_WRITTEN: Final = "# written by tiltsim: sha256 {}\n"
_COPIED: Final = "# its controller: sha256 {}\n"
"""One for each controller in the folder that is a copy of tiltsim's."""

_UNWRITTEN: Final = (
    "# Not to be flown from this file: its controller, {}, was given in Python. Give it again:\n"
    '# tiltsim.simulate("scenario.toml", controller=...)\n'
)


def prepare_flight_folder(folder: Path, scenario: Scenario) -> None:
    """Create a folder for a flight of a scenario.

    Raises:
        InputError: If that is impossible, or the flight would replace what is not a file, or what
            tiltsim did not write.
    """
    prepare_folder(folder)
    controller = _controller_file(scenario)
    files = [folder / name for name in (FLIGHT, METRICS, SCENARIO)]
    files += [] if controller is None else [folder / controller.name]
    for file in files:
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: not a file; choose another folder")
    if not _read_if_written(folder / SCENARIO):
        for file in (folder / FLIGHT, folder / METRICS):
            if file.exists():
                raise _foreign(file)
    if controller is not None:
        copy = folder / controller.name
        own = {digest(controller.read_bytes()), *_copies(folder)}
        if copy.exists() and digest(copy.read_bytes()) not in own:
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
    files = {FLIGHT: parquet_bytes(table), METRICS: metrics_json(metrics).encode()}
    files |= _resolved_files(scenario, folder)
    # All are complete before the first takes its place, and that is the last of them: a killed
    # process leaves no file without the scenario that marks it as tiltsim's.
    with ExitStack() as stack:
        for name, content in files.items():
            stack.enter_context(replacing(folder / name)).write_bytes(content)


def _resolved_files(scenario: Scenario, folder: Path) -> dict[str, bytes]:
    """By name: the file of a user's controller, unless it is there, and last scenario.toml."""
    controller, table = _controller_file(scenario), scenario.controller
    copies, files = _copies(folder), {}
    if controller is not None and isinstance(table, PythonController):
        copy, content = folder / controller.name, controller.read_bytes()
        if not copy.exists() or copy.read_bytes() != content:
            files[copy.name] = content
            copies.append(digest(content))
        named = table.model_copy(update={"function": f"{copy.name}:{table.attribute}"})
        scenario = scenario.model_copy(update={"controller": named})
    lines = "".join(map(_COPIED.format, copies))
    if controller is None and isinstance(table, PythonController):
        lines += _UNWRITTEN.format(printable(table.function))
    text = lines + scenario_toml(scenario)
    return {**files, SCENARIO: (_WRITTEN.format(digest(text.encode())) + text).encode()}


def _controller_file(scenario: Scenario) -> Path | None:
    """The file of a user's controller, if the scenario names one that exists."""
    table = scenario.controller
    file = table.file if isinstance(table, PythonController) else None
    return file if file is not None and file.is_file() else None


def _copies(folder: Path) -> list[str]:
    """Digests of the controllers that tiltsim copied into a folder and nobody has edited since."""
    written = _read_if_written(folder / SCENARIO)
    there = {*file_digests(folder.glob("*.py")).values()} if written else set()
    return sorted(one for one in there if _COPIED.format(one) in written)


def _read_if_written(file: Path) -> str:
    """The text of a resolved scenario, empty without one; `InputError` if it is somebody's own."""
    if not file.exists():
        return ""
    content = file.read_bytes()
    first, _, text = content.partition(b"\n")
    if first + b"\n" != _WRITTEN.format(digest(text)).encode():
        raise _foreign(file)
    return content.decode()


def _foreign(file: Path) -> InputError:
    return InputError(
        f"{file}: not written by this version of tiltsim, or edited since; choose another folder, "
        "or move it away"
    )


def metrics_json(metrics: Mapping[str, float | bool]) -> str:
    """Metrics as a flat JSON object in the order of `METRICS`, with all their digits."""
    return json.dumps(dict(metrics), indent=2, allow_nan=False) + "\n"
