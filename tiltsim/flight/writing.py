"""Write a flight into a folder: metrics.json, flight.parquet, scenario.toml.

A later flight into the same folder replaces these files, but none that tiltsim has not written, and
no scenario, controller or table that was edited: the resolved scenario begins with digests of
itself and of the controllers and tables that were copied into the folder.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import OwnFunctionController
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
_COPIED: Final = {".py": "# its controller: sha256 {}\n", ".csv": "# its table: sha256 {}\n"}
"""One for each controller and table in the folder that is a copy of tiltsim's."""

_UNWRITTEN: Final = (
    "# Not to be flown from this file: its controller, {}, was given in Python. Give it again:\n"
    '# tiltsim.simulate("scenario.toml", controller=...)\n'
)


def prepare_flight_folder(folder: Path, scenario: Scenario) -> None:
    """Create a folder for a flight of a scenario.

    Raises:
        InputError: If that is impossible, or the flight would replace a path that is no file or a
            file that tiltsim did not write.
    """
    prepare_folder(folder)
    named = _named_files(scenario)
    for file in [folder / name for name in (FLIGHT, METRICS, SCENARIO, *named)]:
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: not a file; choose another folder")
    if not _read_if_written(folder / SCENARIO):
        for file in (folder / FLIGHT, folder / METRICS):
            if file.exists():
                raise _foreign(file)
    copies = _copies(folder)
    for name, content in named.items():
        copy = folder / name
        if copy.exists() and digest(copy.read_bytes()) not in {digest(content), *copies}:
            raise _foreign(copy)


def write_flight(
    folder: Path, table: pyarrow.Table, metrics: Mapping[str, Any], scenario: Scenario
) -> None:
    """Write a flight into a folder; each file appears whole or not at all.

    Args:
        folder: Folder to write to; created if missing.
        table: The columns, for flight.parquet.
        metrics: Content of metrics.json.
        scenario: For scenario.toml, with all defaults filled in; the file of a user's controller is
            copied, and the tables of its reference and gait are written as reference.csv and
            gait.csv.

    Raises:
        InputError: See `prepare_flight_folder`; or if a file cannot be written.
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
    """By name: the files that the scenario names, unless they are there, and last scenario.toml."""
    copies, files = _copies(folder), {}
    for name, content in _named_files(scenario).items():
        copy = folder / name
        if not copy.exists() or copy.read_bytes() != content:
            files[name] = content
            copies[digest(content)] = copy.suffix
    controller, table = _controller_file(scenario), scenario.controller
    lines = "".join(_COPIED[suffix].format(one) for one, suffix in sorted(copies.items()))
    tables = scenario.time_tables
    changes: dict[str, Any] = {name: own.in_file(f"{name}.csv") for name, own in tables.items()}
    if controller is not None and isinstance(table, OwnFunctionController):
        function = f"{controller.name}:{table.attribute}"
        changes["controller"] = table.model_copy(update={"function": function})
    elif isinstance(table, OwnFunctionController):
        lines += _UNWRITTEN.format(printable(table.function))
    text = lines + scenario_toml(scenario.model_copy(update=changes))
    return {**files, SCENARIO: (_WRITTEN.format(digest(text.encode())) + text).encode()}


def _named_files(scenario: Scenario) -> dict[str, bytes]:
    """Files that a flight folder needs for its scenario, by name: a controller and tables."""
    controller = _controller_file(scenario)
    files = {} if controller is None else {controller.name: controller.read_bytes()}
    return files | {f"{name}.csv": own.csv() for name, own in scenario.time_tables.items()}


def _controller_file(scenario: Scenario) -> Path | None:
    """The file of a user's controller, if the scenario names one that exists."""
    table = scenario.controller
    file = table.file if isinstance(table, OwnFunctionController) else None
    return file if file is not None and file.is_file() else None


def _copies(folder: Path) -> dict[str, str]:
    """Digests of files that tiltsim copied into a folder and nobody has edited, with suffixes."""
    written = _read_if_written(folder / SCENARIO)
    return {
        one: suffix
        for suffix, line in _COPIED.items()
        for one in (file_digests(folder.glob(f"*{suffix}")).values() if written else ())
        if line.format(one) in written
    }


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


def metrics_json(metrics: Mapping[str, Any]) -> str:
    """Metrics as a JSON object in the order of `METRICS`, with all their digits."""
    return json.dumps(dict(metrics), indent=2, allow_nan=False) + "\n"
