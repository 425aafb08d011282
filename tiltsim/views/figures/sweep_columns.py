"""Columns of sweep results for figures: groups, labels, units, completed flights."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from tiltsim.scenario.key_units import quantity_of_key
from tiltsim.scenario.metric_names import METRICS
from tiltsim.sweeps.dataset import Column, SweepResults
from tiltsim.sweeps.tables import NormalAxis, UniformAxis
from tiltsim.views.figures.style import verbatim


def sampled_keys(results: SweepResults) -> list[str]:
    """The first key of every axis that is sampled from a distribution."""
    axes = results.points.sweep.axis
    return [a.targets[0] for a in axes if isinstance(a, UniformAxis | NormalAxis)]


def spans_decades(values: Column) -> bool:
    """Whether all values are positive and the largest is over 50 times the smallest."""
    known = values[~np.isnan(values)]
    return bool(known.size) and 0.0 < 50.0 * float(known.min()) < float(known.max())


def completed_mask(results: SweepResults) -> Column:
    """Whether the flight of each row was completed, shape (rows,)."""
    return np.array(results.columns["end"] == "completed")


def groups_of(results: SweepResults, key: str | None, mask: Column) -> Iterator[tuple[str, Column]]:
    """The distinct values of a column as text, each with its rows within a mask.

    Without a column (None) all rows are one group without a name.
    """
    if key is None:
        yield "", mask
        return
    column = results.values(key)
    texts = np.array([text_of(value) for value in column], dtype=object)
    for text in dict.fromkeys(texts[mask].tolist()):
        yield text, mask & (texts == text)


def text_of(value: Any) -> str:
    """A value as text for figures."""
    if isinstance(value, list):
        return "(" + ", ".join(map(text_of, value)) + ")"
    if isinstance(value, float | int):
        return f"{value:g}"
    text = str(value)
    return verbatim(text.replace("_", " ") if text.isidentifier() else text)


def label_of(results: SweepResults, name: str) -> str:
    """The label of a column, from the sweep's ``[plot]`` table or by default, with a known unit."""
    own = results.points.sweep.plot.labels.get(name)
    if own is not None:
        return verbatim(own)
    if name in METRICS:
        return METRICS[name].quantity.text
    known = quantity_of_key(name)
    # Errors of a model without a unit are factors.
    factor = name.startswith("model_error.") and known.unit in {"", "1"}
    return f"{known.text} factor" if factor else known.text
