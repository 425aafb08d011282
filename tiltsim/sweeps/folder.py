"""A sweep's folder: finished chunks survive any crash, and no file in it is half-written.

- ``sweep.json``: the definition, which later runs must match
- ``parts/000007.parquet``: one file per finished chunk
- ``flights/0000123.parquet``: one file per flight, if the sweep keeps flights
- ``sweep.parquet``: all rows in order, once every chunk is finished

A folder that is not new or of the same sweep is refused before anything in it is touched.
"""

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

import pyarrow as pa

from tiltsim.errors import InputError
from tiltsim.sweeps.chunks import FinishedChunk
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.rows import finished_parts, part_file, read_rows, schema
from tiltsim.system.files import is_folder, locked, prepare_folder, remove_leftovers, replacing
from tiltsim.system.parquet import UnreadableError, parquet_writer

DEFINITION: Final = "sweep.json"
DATASET: Final = "sweep.parquet"
LOCK: Final = ".lock"
PARTS: Final = "parts"
FLIGHTS: Final = "flights"

ROW_GROUP: Final = 4096  # rows held in memory while the parts are joined
_TABLES: Final = re.compile(r"\d{6,}\.parquet")  # names in the folders of parts and flights


class SweepFolder:
    """The results of one sweep on disk; opened with `open_sweep_folder`."""

    def __init__(self, path: Path, points: SweepPoints) -> None:
        self.path, self._points = path, points
        self.is_joined = False  # whether the dataset is complete and readable

    @property
    def dataset(self) -> Path:
        """The finished dataset."""
        return self.path / DATASET

    def check(self) -> None:
        """Raise `InputError` if a file holds anything but rows of this sweep.

        A damaged dataset is no mistake: it follows from the parts.
        """
        tables = {part_file(self.path, number) for number in range(self._points.chunks)}
        tables |= {self._flight_file(index) for index in range(len(self._points))}
        for foreign in sorted(
            {*self.path.glob(f"{PARTS}/*.parquet"), *self.path.glob(f"{FLIGHTS}/*.parquet")}
            - tables
        ):
            raise InputError(f"{foreign}: not written by this sweep; delete it or move it away")
        expected = schema(self._points)
        for number, file in finished_parts(self.path, self._points).items():
            found = read_rows(file, self._points, self._points.chunk(number)).schema
            differing = {field.name for field in {*found} ^ {*expected}}
            if differing:
                raise InputError(
                    f"{self.path}: made by another version of tiltsim: {file.name} "
                    f"differs in column {min(differing)}; choose another folder, or delete this one"
                )
        self.is_joined = self._has_dataset()

    def _flight_file(self, index: int) -> Path:
        return self.path / FLIGHTS / f"{index:07d}.parquet"

    def _has_dataset(self) -> bool:
        if self.dataset.exists():
            with suppress(UnreadableError):
                read_rows(self.dataset, self._points, range(len(self._points)), scenarios=False)
                return True
        return False

    def finished(self) -> set[int]:
        """Numbers of the chunks on disk."""
        return {*finished_parts(self.path, self._points)}

    def save(self, part: FinishedChunk) -> None:
        """Save a finished chunk durably: after this returns, no crash can lose it."""
        for index, flight in part.flights.items():
            _write(self._flight_file(index), flight)
        # Last, because the part marks the chunk as finished.
        _write(part_file(self.path, part.number), part.table)

    def join(self) -> None:
        """Write the whole dataset from the parts, a few thousand rows at a time."""
        columns = schema(self._points)
        waiting: list[pa.Table] = []
        with (
            replacing(self.dataset, durable=True) as temporary,
            parquet_writer(temporary, columns) as writer,
        ):
            for number in range(self._points.chunks):
                file = part_file(self.path, number)
                table = read_rows(file, self._points, self._points.chunk(number))
                table = table.select(columns.names)
                waiting.append(table.replace_schema_metadata(columns.metadata))
                last = number == self._points.chunks - 1
                if last or sum(map(len, waiting)) >= ROW_GROUP:
                    writer.write_table(pa.concat_tables(waiting))
                    waiting.clear()


@contextmanager
def open_sweep_folder(path: Path, points: SweepPoints) -> Iterator[SweepFolder]:
    """Open a new folder, or one to continue, with exclusive access.

    Raises:
        InputError: If the folder cannot be written, is in use, or contains another sweep; the
            message names the difference.
    """
    _require_new_or_same(path, points)
    prepare_folder(path)
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(path / LOCK, wait=False))
        except BlockingIOError:
            raise InputError(f"{path}: another tiltsim sweep is using it") from None
        _require_new_or_same(path, points)  # another sweep may have begun meanwhile
        opened = SweepFolder(path, points)
        opened.check()
        folders = {path: re.compile(f"{DEFINITION}|{DATASET}"), path / PARTS: _TABLES}
        folders |= {path / FLIGHTS: _TABLES} if points.sweep.keep_flights else {}
        if (path / DEFINITION).exists():
            for folder, names in folders.items():
                if folder.exists():
                    remove_leftovers(folder, names)
        _write(path / DEFINITION, points.definition.to_json().encode())
        for folder in folders:
            folder.mkdir(exist_ok=True)
        yield opened


def _require_new_or_same(path: Path, points: SweepPoints) -> None:
    """Raise `InputError` if a folder has files that this sweep has not written; change nothing."""
    if not is_folder(path):
        return
    for name in (LOCK, DEFINITION, DATASET, PARTS, FLIGHTS):
        if (path / name).is_symlink():
            raise InputError(f"{path}: {name} is a link; choose another folder")
    if (path / DEFINITION).exists():
        difference = read_definition(path / DEFINITION).difference(points.definition)
        if difference:
            raise InputError(
                f"{path}: contains another sweep: {difference}; choose another folder, "
                "or delete this one"
            )
        return
    foreign = {*path.glob("*.parquet"), *(path / name for name in (PARTS, FLIGHTS))}
    if (path / LOCK).exists() and (path / LOCK).stat().st_size:
        foreign.add(path / LOCK)  # a sweep's own is empty
    for file in sorted(foreign):
        if file.exists():
            raise InputError(f"{path}: contains other results: {file.name}; choose another folder")


def read_definition(file: Path) -> SweepDefinition:
    """The definition in a folder. Raises `InputError` if it cannot be read."""
    try:
        return SweepDefinition.from_json(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: not the definition of a sweep: {error}") from None


def _write(path: Path, content: bytes) -> None:
    with replacing(path, durable=True) as temporary:
        temporary.write_bytes(content)
