"""Tables over time, of references and gaits: in a file, in the scenario, or of other libraries."""

import csv
from collections.abc import Callable, Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, ClassVar, Final, Self

import numpy as np
from pydantic import Field, PrivateAttr

from tiltsim.errors import InputError
from tiltsim.scenario.library import MAX_FILE_SIZE, MAX_ROWS, read_text
from tiltsim.scenario.table import Table, default
from tiltsim.system.arguments import real_array
from tiltsim.system.files import exists, is_file
from tiltsim.system.parquet import open_parquet
from tiltsim.system.text import printable, short_repr
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.mathematics.scalar import Values

Rows = tuple[Values, ...]

REFERENCE_COLUMNS: Final = ("time", "x", "y", "z")
POSE_COLUMNS: Final = (*REFERENCE_COLUMNS, "roll", "pitch", "yaw")
QUATERNION_COLUMNS: Final = (*REFERENCE_COLUMNS, "qw", "qx", "qy", "qz")


def rows_with_angles(rows: Rows) -> Rows:
    """Rows with roll, pitch and yaw, unwrapped, for rows with quaternions.

    Raises `InputError` for a quaternion whose norm is not one within 1 %, and where the motion
    passes so close to a pitch of pi/2 that roll and yaw turn much faster than the vehicle.
    """
    quaternions = np.array([row[4:] for row in rows])
    norms = np.linalg.norm(quaternions, axis=1)
    for number in np.flatnonzero(np.abs(norms - 1.0) > NORM_TOLERANCE) + 1:
        raise InputError(
            f"row {number}: norm of qw, qx, qy, qz = {norms[number - 1]:.3g}; must be 1"
        )
    quaternions /= norms[:, np.newaxis]
    angles = np.unwrap(euler_angles(quaternions.T).T, axis=0)
    overlap = np.abs(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    turns, steps = 2.0 * np.arccos(np.minimum(overlap, 1.0)), np.abs(np.diff(angles, axis=0))
    fast = steps.max(axis=1, initial=0.0) > np.maximum(LARGEST_STEP, FASTER * turns)
    for number in np.flatnonzero(fast) + 2:
        raise InputError(f"row {number}: too close to a pitch of pi/2, where roll and yaw jump")
    return tuple((*row[:4], *own) for row, own in zip(rows, angles.tolist(), strict=True))


SHORTEST_STEP: Final = 1e-4  # seconds between the rows of any table
NORM_TOLERANCE: Final = 0.01  # by which the norm of a quaternion may differ from one

LARGEST_STEP: Final = 0.3
"""Change of roll or yaw (rad) from row to row up to which they may turn at any rate."""

FASTER: Final = 5.0  # times the turn of the vehicle that roll or yaw may turn by beyond this
SEPARATORS: Final = ",;\t "  # characters that may separate the columns of a CSV file
_NUMBERS: Final = ("double", "float", "int64", "int32")  # types of columns of a Parquet file


class TimeTable(Table):
    """A table over time, from a file or in the scenario itself."""

    columns: ClassVar[tuple[str, ...]]  # see `columns_among`
    largest: ClassVar[float]  # magnitude of a value

    file: str | None = Field(None)
    hold: bool = default(
        True,
        "after the last row, hold it, at rest: the velocity jumps there unless the table ends at "
        "rest; false: the flight must not be longer than the table, as where a function of time "
        "in Python was sampled",
    )
    _rows: Rows = PrivateAttr(())

    @property
    def table(self) -> Rows:
        """The rows: a time (s) and the values of the other columns."""
        return self._rows

    @classmethod
    def columns_among(cls, names: Sequence[str]) -> tuple[str, ...]:
        """The columns that a table with columns of these names has to have."""
        return cls.columns

    @classmethod
    def columns_of_width(cls, width: int) -> tuple[str, ...]:
        """The columns of rows with ``width`` numbers; `columns` where no table has that width."""
        return cls.columns

    def ends_before(self, time: float) -> bool:
        """Whether the table says nothing about a time (s)."""
        goes_on = self.hold or dict(self).get("repeat", False)
        return not goes_on and time > self._rows[-1][0]

    def in_file(self, name: str) -> Self:
        """The table, to be read from a file of that name."""
        return self.model_copy(update={"file": name, "rows": None})

    def in_scenario(self) -> Self:
        """The table with its rows in the scenario, without a file."""
        return self.model_copy(update={"file": None, "rows": self._rows})

    def csv(self) -> bytes:
        """The table as a CSV file, with all its digits."""
        lines = [self.columns_of_width(len(self._rows[0])), *(map(repr, row) for row in self._rows)]
        return "".join(f"{','.join(line)}\n" for line in lines).encode()

    def _check_values(self) -> None:
        given: Rows | None = dict(self)["rows"]
        if (self.file is None) == (given is None):
            raise self.mistake("file", "give one of file and rows")
        try:
            rows = _read_rows(Path(self.file), self.columns_among) if self.file else given or ()
            columns = self.columns_of_width(len(rows[0]) if rows else 0)
            self._rows = _checked(rows, columns, self.largest)
        except InputError as error:
            key, reason = "rows" if self.file is None else "file", str(error)
            raise self.mistake(key, reason.removeprefix(f"{self.file}: ")) from None


ColumnsAmong = Callable[[Sequence[str]], Sequence[str]]


def rows_of_columns(table: Any, columns_among: ColumnsAmong) -> list[Values]:
    """Rows of a table of another library. Raises `InputError` in one line."""
    names = [*map(str, getattr(table, "column_names", getattr(table, "columns", table)))]
    columns = columns_among(names)
    _check_names(names, columns)
    values = {name: _column(name, table[name]) for name in columns}
    lengths = {name: len(column) for name, column in values.items()}
    if len({*lengths.values()}) > 1:
        counts = ", ".join(f"{name} has {length}" for name, length in lengths.items())
        raise InputError(f"columns must have one number of rows; {counts}")
    return [*zip(*values.values(), strict=True)]


def _column(name: str, given: Any) -> list[float]:
    try:
        column = real_array(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"column {name} must be numbers: {error}") from None
    if column.ndim != 1:
        raise InputError(f"column {name} = {short_repr(given)}: must be a list of numbers")
    return column.tolist()


def _read_rows(file: Path, columns_among: ColumnsAmong) -> list[Values]:
    """Rows of a CSV or Parquet file."""
    if "\0" in str(file):
        raise InputError("a file name has no NUL")
    if exists(file) and not is_file(file):
        raise InputError("not a file")
    if file.suffix.lower() == ".parquet":
        return _read_parquet(file, columns_among)
    if file.suffix.lower() != ".csv":
        raise InputError("must end with .csv or .parquet")
    head, *lines = csv_fields(file, SEPARATORS) or [[]]
    if not head:
        raise InputError("is empty")
    columns = columns_among(head)
    _check_names(head, columns)
    _check_count(len(lines))
    order = [head.index(name) for name in columns]
    return [tuple(row[place] for place in order) for row in csv_rows(head, lines)]


def csv_fields(file: Path, separators: str = ",") -> list[list[str]]:
    """Fields of the lines of a CSV file; the first line shows which of some separators it has."""
    lines = [line.strip() for line in read_text(file).splitlines() if line.strip()]
    separator = next((mark for mark in separators if lines and mark in lines[0]), ",")
    rows = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    return [[field.strip() for field in row] for row in rows]


def csv_rows(
    head: Sequence[str], lines: Sequence[Sequence[str]], empty: str = ""
) -> Iterator[Values]:
    """The numbers of the lines of a CSV file below its head; ``empty`` stands for no field.

    Raises `InputError` for the first line of another length, and the first field that is no number.
    """
    for number, line in enumerate(lines, start=1):
        if len(line) != len(head):
            raise InputError(f"row {number}: {len(line)} values in {len(head)} columns")
        row = []
        for name, text in zip(head, line):
            try:
                row.append(float(text or empty))
            except ValueError:
                where = f"row {number}, column {printable(name)}"
                raise InputError(f"{where} = {short_repr(text)}: no number") from None
        yield tuple(row)


def _read_parquet(file: Path, columns_among: ColumnsAmong) -> list[Values]:
    if is_file(file) and file.stat().st_size > MAX_FILE_SIZE:
        raise InputError(f"{file.stat().st_size} bytes; at most {MAX_FILE_SIZE}")
    with open_parquet(file) as opened:
        columns = columns_among(opened.schema_arrow.names)
        _check_names(opened.schema_arrow.names, columns)
        _check_count(opened.metadata.num_rows)
        for name in columns:  # text could be long beyond any limit once it is decompressed
            if (kind := str(opened.schema_arrow.field(name).type)) not in _NUMBERS:
                raise InputError(f"column {name} is of type {kind}; choose {', '.join(_NUMBERS)}")
        return rows_of_columns(opened.read(columns=[*columns]), columns_among)


def _check_names(names: Sequence[str], columns: Sequence[str]) -> None:
    for name in columns:
        if (count := names.count(name)) != 1:
            problem = f"{count} columns" if count else "no column"
            needed, found = ", ".join(columns), short_repr([*names])
            raise InputError(f"{problem} {name}; needs one each of {needed}; found {found}")
    for name in names:
        if name not in columns:
            may = ", and may have roll, pitch and yaw, or qw, qx, qy and qz"
            may = may if columns == REFERENCE_COLUMNS else ""
            needed = ", ".join(columns)
            raise InputError(f"column {short_repr(name)} is unknown; needs {needed}{may}")


def _check_count(rows: int) -> None:
    if rows > MAX_ROWS:
        every = "every second" if rows <= 2 * MAX_ROWS else f"one in {-(-rows // MAX_ROWS)}"
        raise InputError(f"{rows} rows; at most {MAX_ROWS}: keep {every}")


def _checked(rows: Sequence[Values], columns: Sequence[str], largest: float) -> Rows:
    """Rows whose numbers are allowed. Raises `InputError` for the first that is not."""
    _check_count(len(rows))
    if len(rows) < 2:
        raise InputError(f"{len(rows)} row{'s' * (len(rows) != 1)}; at least 2")
    before = -SHORTEST_STEP
    for number, (time, *values) in enumerate(rows, start=1):
        where = f"row {number}, column"
        if len(values) != len(columns) - 1:
            raise InputError(f"row {number}: {1 + len(values)} values in {len(columns)} columns")
        if number == 1 and time != 0.0:
            raise InputError(f"{where} time = {time!r}: must be 0")
        if not before + SHORTEST_STEP <= time <= 1e9:
            allowed = f"must be at least {SHORTEST_STEP:g} s after the row before, and finite"
            raise InputError(f"{where} time = {time!r}: {allowed}")
        for name, value in zip(columns[1:], values, strict=True):
            if not abs(value) <= largest:
                allowed = (
                    f"from {-largest:g} to {largest:g}" if isfinite(value) else "a finite number"
                )
                raise InputError(f"{where} {name} = {value!r}: must be {allowed}")
        before = time
    return tuple(rows)
