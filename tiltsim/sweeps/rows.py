"""The rows of a sweep's dataset: their columns, and their files.

Rows depend neither on the computer nor on the other flights, so that a chunk gives equal rows
wherever and whenever it is flown.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from tiltsim.errors import InputError
from tiltsim.scenario.metric_names import is_boolean
from tiltsim.sweeps.definition import VERSIONS, SweepDefinition, installed_versions
from tiltsim.sweeps.points import SweepPoints
from tiltsim.system.parquet import UnreadableError, open_parquet


def rows_to_table(points: SweepPoints, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Rows as an Arrow table, in the schema of the sweep, versions added."""
    versions = {f"{name}_version": number for name, number in installed_versions().items()}
    return pa.Table.from_pylist([{**row, **versions} for row in rows], schema=schema(points))


def schema(points: SweepPoints) -> pa.Schema:
    """The columns of a sweep's dataset; the definition is among the schema's metadata."""
    first = points.point(0)
    bisect = points.sweep.bisect
    searched = {} if bisect is None else {bisect.key: bisect.start}
    values = first | searched | points.derived(first | searched)
    fields = [pa.field("index", pa.int64(), nullable=False)]
    for key in points.columns:
        fields.append(pa.field(key, _column_type(values.get(key, 0.0))))
    if bisect is not None:
        fields.append(pa.field("flights", pa.int64(), nullable=False))
    fields += [
        pa.field("end", pa.string(), nullable=False),
        pa.field("end_time", pa.float64(), metadata={"unit": "s"}),
        pa.field("cause", pa.string(), nullable=False),
    ]
    for name in points.metrics:
        fields.append(pa.field(name, pa.bool_() if is_boolean(name) else pa.float64()))
    names = ("scenario", *(f"{name}_version" for name in VERSIONS))
    fields += [pa.field(name, pa.string(), nullable=False) for name in names]
    return pa.schema(fields, metadata={"sweep": points.definition.to_json()})


def _column_type(value: object) -> pa.DataType:
    if isinstance(value, list | tuple):
        return pa.list_(_column_type(value[0] if value else 0.0))
    for kind, column in ((bool, pa.bool_()), (int, pa.int64()), (str, pa.string())):
        if isinstance(value, kind):
            return column
    return pa.float64()


def part_file(folder: Path, number: int) -> Path:
    """The file of a chunk in the folder of a sweep."""
    return folder / "parts" / f"{number:06d}.parquet"


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
            found = opened.schema_arrow
            names = [name for name in found.names if scenarios or name != "scenario"]
            table = opened.read(columns=names)
    except UnreadableError as error:
        raise UnreadableError(f"{error}; delete it, and it is made again") from error
    text = (found.metadata or {}).get(b"sweep", b"").decode(errors="replace")
    difference = _difference(text, points.definition.to_json())
    difference = difference or _wrong_column(found, points)
    if not difference and table["index"].to_pylist() != list(indices):
        difference = "holds the rows of other points"
    difference = difference or _damaged_column(table, points)
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


def _wrong_column(found: pa.Schema, points: SweepPoints) -> str:
    """The first column that is there twice, has another type or, unless a metric, is missing."""
    for name in found.names:
        if found.names.count(name) > 1:
            return f"has two columns {name}"
    for field in schema(points):
        if field.name in found.names:
            kind = found.field(field.name).type
            if kind != field.type:
                return f"column {field.name} holds {kind} instead of {field.type}"
        elif field.name not in points.metrics:
            return f"has no column {field.name}"
    return ""


def _damaged_column(table: pa.Table, points: SweepPoints) -> str:
    """The first column with a number that is not finite, or of an axis with missing values."""
    axes = {key for axis in points.sweep.axis for key in axis.targets}
    for name in table.column_names:
        values = table[name]
        if name in axes and values.null_count:
            return f"damaged: column {name} has missing values"
        while pa.types.is_list(values.type):
            values = pc.list_flatten(values)
        is_float = pa.types.is_floating(values.type)
        if is_float and not pc.all(pc.is_finite(values), min_count=0).as_py():
            return f"damaged: column {name} contains non-finite values"
    return ""
