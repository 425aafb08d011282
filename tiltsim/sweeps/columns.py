"""The columns of a sweep's dataset, and the rows that fill them.

Rows hold nothing that depends on the computer or on the other flights, so that a chunk gives the
same rows wherever and whenever it is flown.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from tiltsim.scenario.metric_names import BOOLEAN_METRICS
from tiltsim.sweeps.definition import VERSIONS
from tiltsim.sweeps.executing import ScenarioResult
from tiltsim.sweeps.points import SweepPoints
from tiltsim.system.text import valid_unicode

if TYPE_CHECKING:
    import pyarrow


@lru_cache(maxsize=1)
def installed_versions() -> dict[str, str]:
    """Versions of the packages that rows depend on."""
    from importlib.metadata import version

    return {name: version(name) for name in VERSIONS}


def make_row(
    points: SweepPoints, index: int, values: Mapping[str, Any], result: ScenarioResult
) -> dict[str, Any]:
    """The row of a point, by column, without versions.

    Args:
        points: The sweep's.
        index: Number of the point.
        values: Those that the axes set, by key.
        result: Of the flight with these values.
    """
    if result.scenario is None:
        document = points.document(values)  # not valid, but it shows the mistake
    else:
        document = result.scenario.model_dump(mode="json", exclude_none=True)
    return {
        "index": index,
        **values,
        **points.derived(values),
        "end": result.end,
        "end_time": result.end_time,
        "cause": valid_unicode(result.cause),
        **{name: result.metrics.get(name) for name in points.metrics},
        "scenario": json.dumps(document),
    }


def rows_to_table(points: SweepPoints, rows: Sequence[Mapping[str, Any]]) -> pyarrow.Table:
    """Rows as an Arrow table, in the schema of the sweep, versions added."""
    import pyarrow as pa

    versions = {f"{name}_version": number for name, number in installed_versions().items()}
    return pa.Table.from_pylist([{**row, **versions} for row in rows], schema=schema(points))


def schema(points: SweepPoints) -> pyarrow.Schema:
    """The columns of a sweep's dataset; the definition is among the schema's metadata."""
    import pyarrow as pa

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
        fields.append(pa.field(name, pa.bool_() if name in BOOLEAN_METRICS else pa.float64()))
    names = ("scenario", *(f"{name}_version" for name in VERSIONS))
    fields += [pa.field(name, pa.string(), nullable=False) for name in names]
    return pa.schema(fields, metadata={"sweep": points.definition.to_json()})


def _column_type(value: object) -> pyarrow.DataType:
    import pyarrow as pa

    if isinstance(value, list | tuple):
        return pa.list_(_column_type(value[0] if value else 0.0))
    for kind, column in ((bool, pa.bool_()), (int, pa.int64()), (str, pa.string())):
        if isinstance(value, kind):
            return column
    return pa.float64()
