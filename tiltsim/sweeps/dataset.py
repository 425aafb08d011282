"""Reading the results of a sweep, finished or not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from pydantic import ValidationError

from tiltsim.errors import InputError
from tiltsim.scenario.messages import one_line_message, show
from tiltsim.sweeps.expressions import evaluate
from tiltsim.sweeps.folder import DATASET, DEFINITION, read_definition
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.rows import finished_parts, read_rows
from tiltsim.sweeps.tables import Sweep
from tiltsim.system.files import is_file
from tiltsim.system.public import optional_package
from tiltsim.system.text import html_table, short_repr

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
    try:
        points = SweepPoints(definition)
    except ValidationError as error:
        mistake = one_line_message(error, definition.sweep, Sweep)
        raise InputError(f"{folder / DEFINITION}: {mistake}") from None
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
