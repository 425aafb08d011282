"""The tables of a sweep file and their keys, validated like a scenario's."""

from collections.abc import Iterator
from math import isfinite
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from tiltsim.scenario.documents import leaves
from tiltsim.scenario.expectation import Expectation
from tiltsim.scenario.library import MAX_VALUES
from tiltsim.scenario.messages import InvalidValueError, choose
from tiltsim.scenario.metric_names import KEPT_METRICS, METRICS, is_metric, split_metric
from tiltsim.scenario.table import Many, Positive, Table, default, example, required
from tiltsim_controllers.mathematics.scalar import clipped

Keys = Annotated[Many[str], Field(min_length=1)]
Names = Many[str]
Count = Annotated[int, Field(ge=1, le=10_000_000)]
Group = Annotated[
    str | None,
    Field(description="axes of one group advance together, not crossed", examples=["diagonal"]),
]


class AxisTable(Table):
    """The keys that every axis has: one key, or several that move together."""

    model_config = example(key="gait.period")
    table_name = "axis"

    key: str | None = default(
        None,
        "a key of the scenario such as gait.period or gait.angles[0], or a name without a dot for "
        "use in [derive]",
        "gait.period",
    )
    keys: Keys | None = default(
        None,
        "several keys that move together, in place of key",
        ["gait.angles[0]", "gait.angles[1]"],
    )
    relative: bool = default(False, "the values multiply the base scenario's own")

    @property
    def targets(self) -> tuple[str, ...]:
        """The keys that the axis sets."""
        return self.keys or ((self.key,) if self.key else ())

    @property
    def name(self) -> str:
        """The axis's name in messages."""
        return ", ".join(self.targets)

    def _check_values(self) -> None:
        if (self.key is None) == (self.keys is None):
            raise self.mistake("key", "give either key or keys")
        if self.relative and not all("." in key for key in self.targets):
            raise self.mistake("relative", "only keys of the scenario have a base value")


def _leaves(value: Any) -> Iterator[Any]:
    """The items of nested lists."""
    if isinstance(value, list | tuple):
        for item in value:
            yield from _leaves(item)
    else:
        yield value


class ListAxis(AxisTable):
    """A list of values; for several keys, a list of rows of values."""

    type: Literal["list"] = required("given values")
    values: Annotated[Many[Any], Field(min_length=1)] = required(
        "of any kind that the key takes", [1.0, 2.0, 3.0]
    )
    group: Group = None

    def _check_values(self) -> None:
        super()._check_values()
        for value in self.values:
            if any(isinstance(v, float) and not isfinite(v) for v in _leaves(value)):
                raise InvalidValueError("axis.values", value, "must be finite")
        for row in self.values if self.keys else ():
            if not isinstance(row, list | tuple) or len(row) != len(self.keys or ()):
                raise InvalidValueError(
                    "axis.values", row, f"must be a list with one value for each of {self.name}"
                )

    def rows(self) -> list[tuple[Any, ...]]:
        """The values of all keys, point by point."""
        return [tuple(value) if self.keys else (value,) for value in self.values]


class LinspaceAxis(AxisTable):
    """Evenly spaced values, both ends included; several keys get the same value."""

    type: Literal["linspace"] = required("evenly spaced values")
    start: float = required("the first value [the key's]", 1.0)
    stop: float = required("the last value [the key's]", 3.0)
    count: Annotated[int, Field(ge=2, le=MAX_VALUES)] = required("number of values", 9)
    group: Group = None

    def rows(self) -> list[tuple[Any, ...]]:
        """The values of all keys, point by point."""
        last, start, stop = self.count - 1, self.start, self.stop
        low, high = sorted((start, stop))
        # Weighted from both ends; rounding must not carry a value past the last one allowed.
        between = [
            clipped((start * (last - step) + stop * step) / last, low, high)
            for step in range(1, last)
        ]
        return [(value,) * len(self.targets) for value in (start, *between, stop)]


class UniformAxis(AxisTable):
    """A number drawn from a uniform distribution; several keys get the same draw."""

    type: Literal["uniform"] = required("drawn evenly between two bounds")
    low: float = required("the lower bound [the key's]", 1.0)
    high: float = required("the upper bound [the key's]", 3.0)

    def _check_values(self) -> None:
        super()._check_values()
        if self.low >= self.high:
            raise self.mistake("low", f"must be below high = {self.high}")


class NormalAxis(AxisTable):
    """A number drawn from a normal distribution; several keys get the same draw."""

    type: Literal["normal"] = required("drawn from a normal distribution")
    mean: float = required("of the values [the key's]", 2.0)
    standard_deviation: Positive = required("of the values [the key's]", 0.1)


class SeedAxis(AxisTable):
    """A different integer for each sample, for ``simulation.seed``; other axes do not change it."""

    model_config = example(key="simulation.seed")

    type: Literal["seed"] = required("a number of its own for each sample")
    start: Annotated[int, Field(ge=0)] = default(0, "the first sample's", 100)
    relative: Literal[False] = default(False, "always false")


class CasesAxis(AxisTable):
    """Named sets of tables that override the base, as a ``[[variant]]`` does."""

    model_config = example(key="law")

    type: Literal["cases"] = required("named sets of tables")
    key: str = required("a name without a dot: the column with the name of the case", "law")
    keys: None = default(None, "not for cases")
    relative: Literal[False] = default(False, "always false")
    cases: Annotated[dict[str, dict[str, Any]], Field(min_length=1)] = required(
        "tables of the scenario by the name of the case",
        {"exact": {"controller": {"decoupler": "exact"}}},
    )
    group: Group = None

    def _check_values(self) -> None:
        super()._check_values()
        if "." in self.key:
            raise self.mistake("key", "the key of cases is a name without a dot")

    def rows(self) -> list[tuple[Any, ...]]:
        """The names of the cases."""
        return [(name,) for name in self.cases]


SampledAxis = UniformAxis | NormalAxis | SeedAxis  # axes with a value for every sample
GridAxis = ListAxis | LinspaceAxis | CasesAxis
"""Axes with rows of values, crossed with the other axes or advancing with a group."""

Axis = Annotated[GridAxis | SampledAxis, Field(discriminator="type")]


class SampleTable(Table):
    """How all uniform and normal axes are drawn together."""

    table_name = "sample"

    method: Literal["random", "latin_hypercube", "sobol"] = default(
        "random", "independent draws, or draws that cover the ranges more evenly"
    )
    count: Count = required(
        "number of samples at each point of the other axes; a power of two for sobol", 64
    )
    seed: Annotated[int, Field(ge=0)] = default(0, "of the draws", 1)

    def _check_values(self) -> None:
        if self.method == "sobol" and self.count & (self.count - 1):
            raise self.mistake("count", "Sobol's sequence is balanced only for powers of two")


class BisectTable(Table):
    """A search for the first value at which a condition no longer holds.

    The key walks from start to stop by step, until the condition fails; bisection then closes in
    on the boundary.
    """

    key: str = required("the key that is searched", "gait.amplitude")
    start: float = required("where the search begins and the condition holds [the key's]", 0.1)
    stop: float | str = required("a number, or an expression over the axes' names [the key's]", 1.0)
    step: Positive = required("of the walk that finds a value at which it fails [the key's]", 0.1)
    tolerance: Positive = required(
        "maximum width of the bracket at the end of the search [the key's]", 0.01
    )
    holds: Annotated[Many[Expectation], Field(min_length=1)] = required(
        "bounds on metrics, as in [[expect]]; they fail if the flight terminates early",
        [{"metric": "diverged", "equals": False}],
    )


class PlotTable(Table):
    """How ``tiltsim plot`` draws the sweep; by default the axes decide."""

    model_config = example(kind="lines", x="gait.period")

    kind: Literal["lines", "map", "quantiles", "boundary", "plane"] | None = default(
        None, "of figure; default: what suits the axes", "map"
    )
    x: str | None = default(None, "a column, or an expression over columns", "gait.period")
    y: str | None = default(None, "likewise; for map and plane", "gait.amplitude")
    metrics: Names = default((), "one row of panels each; default: a choice", ["max_abs_roll"])
    lines: str | None = default(None, "a column; one line per value", "gait.amplitude")
    panels: str | None = default(None, "a column; one panel per value", "gait.scale")
    log: Annotated[tuple[Literal["x", "y"], ...], Field(strict=False)] = default(
        (), "axes of lines with a logarithmic scale", ["y"]
    )
    labels: dict[str, str] = default(
        {}, "what the figure calls columns, with their units", {"wind": "wind speed (m/s)"}
    )


class Sweep(Table):
    """One sweep, fully specified."""

    title: str = default("", "one line about the sweep", "My first sweep")
    source: str = default("", "where the experiment is described", "ch. 4, Sec. 6.3")
    scenario: str | dict[str, Any] = required(
        "the base: a file or an address of the library, or a scenario's tables",
        "ch04_tracking/circle#continuous_t2_modified",
    )
    set: dict[str, Any] = default(
        {}, "values by dotted key, the same for all flights", {"simulation.duration": 85.0}
    )
    axis: Many[Axis] = default((), "what varies; axes are crossed, the last one fastest")
    sample: SampleTable | None = default(
        None, "how often and how uniform and normal axes are drawn"
    )
    derive: dict[str, Any] = default(
        {},
        "keys that follow from the axes: expressions, or lists of expressions",
        {"gait.lean": "0.5 * scale"},
    )
    bisect: BisectTable | None = default(None, "a search for a stability boundary at each point")
    metrics: Names | None = default(None, "metrics in the dataset; default: all", ["max_abs_roll"])
    keep_flights: bool = default(False, "also keep every flight.parquet")
    chunk_size: Count | None = default(
        None,
        "number of points that are flown and saved together; default: 1/64 of all, at most 32; "
        "with the jax engine a quarter, at most 1024",
        100,
    )
    plot: PlotTable = default(PlotTable(), "how tiltsim plot draws the sweep")

    @property
    def search(self) -> dict[str, float]:
        """The key that is searched, and its first value; empty without ``[bisect]``."""
        return {} if self.bisect is None else {self.bisect.key: self.bisect.start}

    @property
    def targets(self) -> list[str]:
        """The keys that the axes and the search set."""
        return [*(key for axis in self.axis for key in axis.targets), *self.search]

    @field_validator("set", "derive", mode="before")
    @classmethod
    def _dotted(cls, value: Any) -> Any:
        # TOML reads simulation.duration = 1 as a table in a table.
        return dict(leaves(value)) if isinstance(value, dict) else value

    def _check_values(self) -> None:
        for metric in self.metrics or ():
            if (own := split_metric(metric)[1]) not in KEPT_METRICS:
                raise InvalidValueError("metrics", metric, choose(own, KEPT_METRICS))
        for metric in self.plot.metrics:
            if not is_metric(metric) or metric not in (self.metrics or (metric,)):
                kept = METRICS if self.metrics is None else self.metrics
                reason = f"is not in the dataset; {choose(metric, kept)}"
                raise InvalidValueError("plot.metrics", metric, reason)
        if not self.axis and self.bisect is None:
            raise InvalidValueError("axis", [], "a sweep needs at least one [[axis]] or a [bisect]")
        drawn = [a for a in self.axis if isinstance(a, SampledAxis)]
        if drawn and self.sample is None:
            raise InvalidValueError(
                "axis.type", drawn[0].type, "needs a [sample] table with its count and seed"
            )
        if self.sample is not None and not drawn:
            raise self.mistake("sample.count", "no axis is of type uniform, normal or seed")
        targets = [*self.targets, *self.derive]
        twice = next((key for key in targets if targets.count(key) > 1), None)
        if twice is not None:
            raise InvalidValueError("axis.key", twice, "set twice")
        scaled = [key for axis in self.axis if axis.relative for key in axis.targets]
        fixed = next((key for key in targets if key in self.set and key not in scaled), None)
        if fixed is not None:
            raise InvalidValueError(
                f"set.{fixed}", self.set[fixed], "also set by an axis; remove it"
            )
        for axis in self.axis:
            if isinstance(axis, CasesAxis):
                self._check_cases(axis, [key for key in (*targets, *self.set) if "." in key])

    def _check_cases(self, axis: CasesAxis, taken: list[str]) -> None:
        for name, tables in axis.cases.items():
            for key, value in leaves(tables):
                if any(key == other or key.startswith(f"{other}.") for other in taken):
                    raise InvalidValueError(
                        f"axis.cases.{name}.{key}", value, "also set by another axis or by set"
                    )
