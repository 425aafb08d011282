"""The results of a sweep: its folder, and their columns."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from tiltsim.errors import InputError
from tiltsim.scenario.messages import show
from tiltsim.scenario.table import in_one_line
from tiltsim.sweeps.chunks import FinishedChunk, schema
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.expressions import evaluate
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.tables import Sweep
from tiltsim.system.files import (
    is_file,
    is_folder,
    locked,
    prepare_folder,
    remove_leftovers,
    replacing,
)
from tiltsim.system.parquet import CHECKSUM, UnreadableError, open_parquet, parquet_writer
from tiltsim.system.public import optional_package
from tiltsim.system.text import html_table, short_repr

DEFINITION: Final = "sweep.json"
DATASET: Final = "sweep.parquet"
LOCK: Final = ".lock"
PARTS: Final = "parts"
FLIGHTS: Final = "flights"

ROW_GROUP: Final = 4096  # rows held in memory while the parts are joined
_TABLES: Final = re.compile(r"\d{6,}\.parquet")  # names in the folders of parts and flights


def part_file(folder: Path, number: int) -> Path:
    """The file of a chunk in the folder of a sweep."""
    return folder / PARTS / f"{number:06d}.parquet"


def finished_parts(folder: Path, points: SweepPoints) -> dict[int, Path]:
    """The files of the finished chunks by number; other files beside them are no parts."""
    files = {number: part_file(folder, number) for number in range(points.chunks)}
    return {number: file for number, file in files.items() if file.exists()}


def read_rows(
    file: Path, points: SweepPoints, indices: Sequence[int], *, scenarios: bool = True
) -> pa.Table:
    """The rows in one file of a sweep.

    Args:
        file: A part, or the whole dataset.
        points: The points of the sweep.
        indices: The points whose rows the file must hold.
        scenarios: Whether to read the column of scenarios as well.

    Raises:
        InputError: If the file is damaged, or holds anything else.
    """
    try:
        with open_parquet(file) as opened:
            found, further = opened.schema_arrow, opened.metadata.metadata or {}
            names = [name for name in found.names if scenarios or name != "scenario"]
            table = opened.read(columns=names)
    except UnreadableError as error:
        raise UnreadableError(f"{error}; delete it, and it is made again") from error
    text = (found.metadata or {}).get(b"sweep", b"").decode(errors="replace")
    difference = _difference(text, points.definition.to_json())
    if not difference and CHECKSUM.encode() not in further:
        difference = "has no checksum, as tiltsim writes it"
    if not difference and table["index"].to_pylist() != list(indices):
        difference = "holds the rows of other points"
    if difference:
        raise InputError(f"{file}: {difference}; delete it or move it away")
    return table


@lru_cache(maxsize=8)
def _difference(found: str, expected: str) -> str:
    """The difference of a file's definition from the sweep's; empty if it gives equal rows."""
    if found == expected:
        return ""
    try:
        difference = SweepDefinition.from_json(found).difference(
            SweepDefinition.from_json(expected)
        )
    except ValueError:
        return "not of a sweep"
    return f"of another sweep: {difference}" if difference else ""


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
        if self.dataset.exists():
            with suppress(UnreadableError):
                read_rows(self.dataset, self._points, range(len(self._points)), scenarios=False)
                self.is_joined = True

    def _flight_file(self, index: int) -> Path:
        return self.path / FLIGHTS / f"{index:07d}.parquet"

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


MAX_SHOWN: Final = 6  # metrics in the table for notebooks
Column = npt.NDArray[Any]


@dataclass(frozen=True, repr=False)
class SweepResults:
    """The rows of a sweep by column, and the points of the sweep.

    Columns have shape (rows,), in the order of the points: floats (NaN for missing values), objects
    for text and lists. Entries of lists have their own columns, ``key[0]``.
    """

    points: SweepPoints
    columns: Mapping[str, Column]
    table: pa.Table  # the columns as they are stored

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.columns["index"])

    def __repr__(self) -> str:
        """Title, size and ends, in one line."""
        return f"<SweepResults of {self._title}: {self._size}>"

    def _repr_html_(self) -> str:
        """Size, ends and the first rows, as a table for notebooks."""
        names = [*self.points.columns, "end", *self.points.metrics[:MAX_SHOWN]]
        names = [name for name in names if name in self.columns]
        rows = [[_cell(self.columns[name][row]) for name in names] for row in range(len(self))[:5]]
        return html_table(self._title, [self._size], rows, names)

    @property
    def _title(self) -> str:
        return self.points.sweep.title or self.points.definition.address

    @property
    def _size(self) -> str:
        ends = ", ".join(f"{n} {end}" for end, n in Counter(self.columns["end"]).most_common())
        return f"{len(self)} rows of {len(self.table.column_names)} columns; {ends}"

    def __getitem__(self, name: str) -> Column:
        """A column, or arithmetic on columns; see `values`."""
        return self.values(name)

    def to_arrow(self) -> pa.Table:
        """The rows as an Arrow table: values of the axes, how the flight ended, metrics."""
        return self.table

    def to_pandas(self) -> Any:
        """The rows as a pandas DataFrame. Raises `InputError` if pandas is not installed."""
        optional_package("pandas", "SweepResults.to_pandas")
        return self.table.to_pandas()

    def values(self, expression: str) -> Column:
        """A column, or arithmetic on columns row by row. Raises `InputError` if it is neither."""
        if not isinstance(expression, str):
            allowed = "must be a column or arithmetic on columns, as text"
            raise InputError(f"expression = {short_repr(expression)}: {allowed}")
        if expression in self.columns:
            return self.columns[expression]
        numbers = {k: v.tolist() for k, v in self.columns.items() if v.dtype == np.float64}
        try:
            return np.array(
                [
                    evaluate(expression, {key: column[row] for key, column in numbers.items()})
                    for row in range(len(self))
                ]
            )
        except ValueError as error:
            address = self.points.definition.address
            raise InputError(f"{address}: {show(expression)}: {error}") from None


def is_sweep_folder(path: Path) -> bool:
    """Whether a folder contains the results of a sweep."""
    return is_file(path / DEFINITION)


def load_results(folder: Path, *, scenarios: bool = False) -> SweepResults:
    """Read the dataset in a sweep's folder, or the finished chunks of an unfinished sweep.

    ``scenarios`` also reads the column ``scenario``, a few kB per row. Raises `InputError` if there
    is nothing yet, or it cannot be read.
    """
    definition = read_definition(folder / DEFINITION)
    with in_one_line(f"{folder / DEFINITION}", definition.sweep, Sweep):
        points = SweepPoints(definition)
    files = {part: points.chunk(number) for number, part in finished_parts(folder, points).items()}
    if (folder / DATASET).exists():
        files = {folder / DATASET: range(len(points))}
    if not files:
        raise InputError(f"{folder}: no chunk of this sweep is finished yet")
    tables = [read_rows(file, points, rows, scenarios=scenarios) for file, rows in files.items()]
    for file, part in zip(files, tables):
        if part.schema != tables[0].schema:
            raise InputError(f"{file}: has other columns than {next(iter(files)).name}; delete it")
    table = pa.concat_tables(tables)
    columns: dict[str, Column] = {}
    for name in table.column_names:
        values = table[name].to_pylist()
        columns[name] = _column(values)
        if pa.types.is_list(table.schema.field(name).type):
            for entry in range(max((len(value) for value in values if value), default=0)):
                entries = [value[entry] if value else None for value in values]
                columns[f"{name}[{entry}]"] = _column(entries)
    return SweepResults(points, columns, table)


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _column(values: list[Any]) -> Column:
    if all(value is None or isinstance(value, int | float) for value in values):
        return np.array([np.nan if value is None else float(value) for value in values])
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column
