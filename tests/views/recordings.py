"""Reading recordings back."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa

from tiltsim.views.rerun.timeline import TIMELINE


def rerun_rrd(*arguments):
    program = Path(sys.executable).with_name("rerun")
    return subprocess.run(
        [str(program), "rrd", *map(str, arguments)], capture_output=True, text=True
    )


def entities(path):
    from rerun.chunk import RrdReader

    schema = RrdReader(path).store().schema()
    return {column.entity_path for column in schema.component_columns()}


def rows(path, entity, component):
    """Times (s) and values of one component, in order of time."""
    from rerun.chunk import RrdReader

    times, values = [], []
    for chunk in RrdReader(path).stream().filter(content=entity, is_static=False):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            times += batch.column(TIMELINE).cast(pa.int64()).to_pylist()
            values += batch.column(component).to_pylist()
    order = np.argsort(times, kind="stable")
    return np.array(times)[order] * 1e-9, [values[index] for index in order]


def scalars(path, entity, number=0):
    """Times (s) and values of one line of a plot."""
    times, values = rows(path, entity, "Scalars:scalars")
    return times, np.array(values)[:, number]
