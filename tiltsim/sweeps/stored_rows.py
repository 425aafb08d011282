"""Reading rows of a sweep back: of this sweep, of these points, and undamaged."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from tiltsim.errors import InputError
from tiltsim.sweeps.columns import schema
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.points import SweepPoints
from tiltsim.system.parquet import UnreadableError, open_parquet

if TYPE_CHECKING:
    import pyarrow


def part_file(folder: Path, number: int) -> Path:
    """The file of a chunk in the folder of a sweep."""
    return folder / "parts" / f"{number:06d}.parquet"


def finished_parts(folder: Path, points: SweepPoints) -> dict[int, Path]:
    """The files of the finished chunks by number; other files beside them are no parts."""
    files = {number: part_file(folder, number) for number in range(points.chunks)}
    return {number: file for number, file in files.items() if file.exists()}


def read_rows(
    file: Path, points: SweepPoints, indices: Sequence[int], *, scenarios: bool = True
) -> pyarrow.Table:
    """The rows in one file of a sweep.

    Args:
        file: A part, or the whole dataset.
        points: The sweep's.
        indices: The points whose rows the file must hold.
        scenarios: Whether to read their scenarios, too.

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
    """How the definition in a file differs from that of the sweep; empty if it gives equal rows."""
    if found == expected:
        return ""
    try:
        difference = SweepDefinition.from_json(found).difference(
            SweepDefinition.from_json(expected)
        )
    except ValueError:
        return "not of a sweep"
    return f"of another sweep: {difference}" if difference else ""


def _wrong_column(found: pyarrow.Schema, points: SweepPoints) -> str:
    """The first column that is there twice, has another type, or is missing.

    Versions differ in their metrics, which are optional here.
    """
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


def _damaged_column(table: pyarrow.Table, points: SweepPoints) -> str:
    """The first column with a NaN or an infinity, which no sweep stores, or an axis without values.

    What a flight does not have is stored as null.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

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
