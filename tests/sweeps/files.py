"""Sweeps of flights as short as can be, for tests of all that is around them."""

from __future__ import annotations

import json
import re

SHORT = """
title = "short flights"
chunk_size = {chunk_size}
[scenario.simulation]
duration = 0.01
timestep = 0.002
engine = "python"
[scenario.gait]
type = "fixed"
angles = [-0.65, -0.65, 0.65, 0.65]
[[axis]]
type = "normal"
key = "initial.attitude[0]"
mean = 0.0
standard_deviation = 0.1
[[axis]]
type = "list"
key = "controller.decoupler"
values = ["conventional", "modified"]
[sample]
count = {count}
seed = 3
"""


def short_sweep(path, *, count=6, chunk_size=3):
    """A sweep file with twice ``count`` flights."""
    path.write_text(SHORT.format(count=count, chunk_size=chunk_size), encoding="utf-8")
    return path


def boundary_sweep(path):
    """The largest roll at the start with which max_abs_roll stays below 0.3: 0.3 itself."""
    text = re.sub(r"\[\[axis\]\]\ntype = \"normal\"(.|\n)*?\n(?=\[\[)", "", SHORT)
    text = text.partition("[sample]")[0].format(chunk_size=1)
    text += """
[derive]
initial.attitude = ["roll", 0, "2 * roll"]
[bisect]
key = "roll"
start = 0.0
stop = 0.5
step = 0.1
tolerance = 0.001
[[bisect.holds]]
metric = "max_abs_roll"
max = 0.2345
"""
    path.write_text(text, encoding="utf-8")
    return path


def scenario_of(row):
    """The scenario's document in a row."""
    return json.loads(row["scenario"])
