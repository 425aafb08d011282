"""From a sweep file to scenarios: which points there are, in which order, and what each one sets.

Everything follows from the `Definition`, so that processes and machines that share it agree on
every point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from math import prod
from typing import Any, Final, cast

import numpy as np

from tiltsim.errors import InputError
from tiltsim.scenario.loading import (
    apply_overrides,
    merge,
    parse_scenario,
    split_key,
)
from tiltsim.scenario.messages import show
from tiltsim.scenario.metric_names import METRICS, WALL_CLOCK_METRICS
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim.sweeps.definition import VERSIONS, Definition
from tiltsim.sweeps.expressions import evaluate, names
from tiltsim.sweeps.tables import (
    AxisTable,
    BisectTable,
    CasesAxis,
    GridAxis,
    NormalAxis,
    SeedAxis,
    Sweep,
    UniformAxis,
)
from tiltsim_controllers.mathematics.scalar import Floats

MAX_POINTS: Final = 10_000_000
MAX_SEARCH: Final = 1_000_000
"""Steps that a search may walk at one point."""
VALUES_TRIED: Final = 1000
"""So many values of an axis are tried before any is flown."""
LARGEST_CHUNK: Final = 32
"""Points of a chunk unless the file says otherwise: few enough to lose little when killed."""

RESERVED: Final = ("index", "end", "end_time", "cause", "scenario", "flights")
"""Columns of every dataset, besides metrics and versions."""


class Plan:
    """The points of a sweep.

    Points are numbered: the axes' groups in the order of the file, the last one fastest, and for
    each combination all samples. A chunk is a range of points.
    """

    def __init__(self, definition: Definition) -> None:
        self.definition = definition
        self.sweep = Sweep.model_validate(definition.sweep)
        self.base = definition.base
        self._check_count()
        self._groups = self._make_groups()
        axes = self.sweep.axis
        self._drawn = [axis for axis in axes if isinstance(axis, UniformAxis | NormalAxis)]
        self._seeds = [axis for axis in axes if isinstance(axis, SeedAxis)]
        self._cases = [axis for axis in axes if isinstance(axis, CasesAxis)]
        samples = self.sweep.sample.count if self.sweep.sample is not None else 1
        self._lengths = [*(len(group) for group in self._groups), samples]

    def __len__(self) -> int:
        """Number of points."""
        return prod(self._lengths)

    @property
    def chunk_size(self) -> int:
        """Points of a chunk."""
        if self.sweep.chunk_size is not None:
            return self.sweep.chunk_size
        return max(1, min(LARGEST_CHUNK, len(self) // 64))

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-len(self) // self.chunk_size)

    def chunk(self, number: int) -> range:
        """The points of a chunk."""
        first = number * self.chunk_size
        return range(first, min(first + self.chunk_size, len(self)))

    @property
    def metrics(self) -> tuple[str, ...]:
        """The metrics to keep."""
        everything = tuple(name for name in METRICS if name not in WALL_CLOCK_METRICS)
        return self.sweep.metrics if self.sweep.metrics is not None else everything

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The columns that axes and derived keys have in the results."""
        keys = [key for axis in self.sweep.axis for key in axis.targets]
        if self.sweep.bisect is not None:
            keys += [self.sweep.bisect.key, f"{self.sweep.bisect.key}_beyond"]
        return (*keys, *self.sweep.derive)

    def point(self, index: int) -> dict[str, Any]:
        """What the axes set at a point, by key."""
        values: dict[str, Any] = {}
        remaining, positions = index, []
        for length in reversed(self._lengths):
            remaining, position = divmod(remaining, length)
            positions.append(position)
        sample, *grid = positions
        for group, position in zip(self._groups, reversed(grid), strict=True):
            values |= group[position]
        for axis, draw in zip(self._drawn, self._draws[sample] if self._drawn else ()):
            values |= self._absolute(axis.relative, dict.fromkeys(axis.targets, float(draw)))
        for seed in self._seeds:
            values |= dict.fromkeys(seed.targets, seed.start + sample)
        return values

    def derived(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """What ``[derive]`` makes of the axes' values. Raises InputError where it makes nothing."""
        rules = self.sweep.derive.items()
        return {key: self._evaluate(f"derive.{key}", rule, values) for key, rule in rules}

    def stop(self, values: Mapping[str, Any]) -> float:
        """Where the bisected key stops at a point."""
        assert self.sweep.bisect is not None
        return float(self._evaluate("bisect.stop", self.sweep.bisect.stop, values))

    def document(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The scenario's document where the axes have the given values."""
        document = deepcopy(self.base)
        for axis in self._cases:
            document = merge(document, deepcopy(axis.cases[values[axis.key]]))
        overrides = {**self.sweep.set, **values, **self.derived(values)}
        overrides = {key: value for key, value in overrides.items() if "." in key}
        for key in overrides:
            if "[" in key:
                self._write_out(document, key.partition("[")[0])
        apply_overrides(document, overrides, self.definition.address)
        return document

    def scenario(self, values: Mapping[str, Any]) -> Scenario:
        """The scenario where the axes have the given values. Raises InputError if it is none."""
        return parse_scenario(self.document(values), self.definition.address)

    def check(self) -> list[Scenario]:
        """Try the values of every axis, with the others at their first.

        Of an axis with more than `VALUES_TRIED` as many, spread evenly and both ends among them;
        what is wrong with others is told in their rows. Returns the scenarios. Raises `InputError`
        where one is invalid.
        """
        self._check_names()
        first = self.point(0)
        points = [first]
        for position, length in enumerate(self._lengths[:-1]):
            stride = prod(self._lengths[position + 1 :])
            count = min(length, VALUES_TRIED)
            places = [place * (length - 1) // max(1, count - 1) for place in range(1, count)]
            points += [self.point(place * stride) for place in places]
        for values in points:
            tables = [key for key, value in values.items() if isinstance(value, dict)]
            if tables:
                allowed = f"{tables[0]} is a table; vary its keys one by one"
                raise self._mistake("axis.values", values[tables[0]], allowed)
            kinds = [type(value) for value in first.values()]
            wrong = [key for key, kind in zip(values, kinds) if type(values[key]) is not kind]
            if wrong:
                values_ = [first[wrong[0]], values[wrong[0]]]
                raise self._mistake("axis.values", values_, f"{wrong[0]} changes its type")
        bisect = self.sweep.bisect
        start = {} if bisect is None else {bisect.key: bisect.start}
        for values in points:
            if bisect is not None:
                self._check_search(bisect, self.stop(values))
        return [self.scenario(values | start) for values in points]

    def _check_search(self, bisect: BisectTable, stop: float) -> None:
        """Refuse a walk that would never end."""
        steps = abs(stop - bisect.start) / bisect.step
        if steps > MAX_SEARCH:
            allowed = f"{steps:.3g} steps to stop = {stop:g}; at most {MAX_SEARCH}"
            raise self._mistake("bisect.step", bisect.step, allowed)

    def _check_names(self) -> None:
        sweep = self.sweep
        rules = [*sweep.derive.values(), *([sweep.bisect.stop] if sweep.bisect else [])]
        rules += [sweep.plot.x, sweep.plot.y, sweep.plot.lines, sweep.plot.panels]
        read = {name for rule in rules for name in _names_in(rule)}
        targets = [key for axis in sweep.axis for key in axis.targets]
        targets += [sweep.bisect.key] if sweep.bisect is not None else []
        taken = {*RESERVED, *METRICS, *(f"{name}_version" for name in VERSIONS)}
        for key in (*targets, *sweep.derive):
            if key in taken:
                raise self._mistake("axis.key", key, "is a column of every result; rename it")
        named = {axis.key for axis in self._cases}
        for key in targets:
            if "." not in key and key not in read | named:
                raise self._mistake(
                    "axis.key",
                    key,
                    "a name without a dot must be used in [derive] or [plot]; keys of the "
                    "scenario have one, as gait.period",
                )
        for key in sweep.derive:
            if "." not in key:
                raise self._mistake("derive", key, "must be a key of the scenario, as gait.angles")

    def _check_count(self) -> None:
        """Refuse more points than a sweep may have, before any of them is made."""
        sample = self.sweep.sample
        points = 1 if sample is None else sample.count
        groups: set[str] = set()
        for axis in self.sweep.axis:
            if isinstance(axis, GridAxis) and axis.group not in groups:
                points *= axis.length
                groups |= {axis.group} if axis.group else set()
        if points > MAX_POINTS:
            raise self._mistake("axis", points, f"more than {MAX_POINTS} points")

    def _make_groups(self) -> list[list[dict[str, Any]]]:
        members: dict[str, list[list[dict[str, Any]]]] = {}
        for number, axis in enumerate(self.sweep.axis):
            if isinstance(axis, GridAxis):
                columns = [_of_one_type(column) for column in zip(*axis.rows())]
                rows = [
                    self._absolute(axis.relative, dict(zip(axis.targets, row, strict=True)))
                    for row in zip(*columns)
                ]
                # No group can be called by a number.
                members.setdefault(axis.group or f"{number}", []).append(rows)
        groups = []
        for name, axes in members.items():
            lengths = [len(rows) for rows in axes]
            if len(set(lengths)) > 1:
                raise self._mistake("axis.group", name, f"its axes have {lengths} values")
            groups.append(
                [
                    {key: value for part in parts for key, value in part.items()}
                    for parts in zip(*axes)
                ]
            )
        return groups

    @cached_property
    def _draws(self) -> Floats:
        """Values of the drawn axes, shape (samples, axes)."""
        sample = self.sweep.sample
        assert sample is not None
        unit = _unit_points(sample.method, sample.count, len(self._drawn), sample.seed)
        columns = []
        for axis, column in zip(self._drawn, unit.T, strict=True):
            if isinstance(axis, UniformAxis):
                columns.append(axis.low + (axis.high - axis.low) * column)
            else:
                from scipy.special import ndtri

                inside = np.clip(column, 2.0**-54, 1.0 - 2.0**-53)
                columns.append(axis.mean + axis.standard_deviation * ndtri(inside))
        return cast(Floats, np.stack(columns, axis=-1))

    @cached_property
    def _known(self) -> dict[str, Any]:
        """The base with the vehicle's numbers written out, for what is relative to them."""
        scenario = parse_scenario(self.base)
        if not isinstance(scenario.vehicle, VehicleTable):
            return self.base
        vehicle = scenario.vehicle.resolve()._asdict()
        inertia = [vehicle.pop(f"inertia_{axis}") for axis in ("xx", "yy", "zz")]
        numbers = {**vehicle, "inertia": inertia}
        return {**self.base, "vehicle": {**numbers, **self.base["vehicle"]}}

    def place(self, axis: AxisTable, values: Sequence[Any]) -> dict[str, Any]:
        """What an axis sets, by key, where it takes one value for each of its targets."""
        return self._absolute(axis.relative, dict(zip(axis.targets, values, strict=True)))

    def _absolute(self, relative: bool, values: dict[str, Any]) -> dict[str, Any]:
        if not relative:
            return values
        return {key: self._scaled(key, value) for key, value in values.items()}

    def _scaled(self, key: str, factor: Any) -> Any:
        base = self._look_up(key)
        if _is_number(factor) and _is_number(base):
            return float(base * factor)
        if _is_number(factor) and isinstance(base, list) and all(map(_is_number, base)):
            return [float(value * factor) for value in base]
        if not _is_number(factor):
            raise self._mistake("axis.values", factor, "relative values are numbers")
        raise self._mistake(
            "axis.relative", True, f"{key} = {show(base)} in the base scenario is no number"
        )

    def _look_up(self, key: str) -> Any:
        value: Any = self._known
        for step in split_key(key):
            inside = isinstance(value, dict) and step in value
            listed = isinstance(value, list) and isinstance(step, int) and step < len(value)
            if not (inside or listed):
                return None
            value = value[step]
        return value

    def _write_out(self, document: dict[str, Any], key: str) -> None:
        """Put a list that follows from a preset into the document, to change an entry of it."""
        table: Any = document
        *path, last = split_key(key)
        for step in path:
            table = table.get(step) if isinstance(table, dict) else None
        if isinstance(table, dict) and last not in table:
            value = self._look_up(key)
            if isinstance(value, list):
                table[last] = list(value)

    def _evaluate(self, key: str, rule: Any, values: Mapping[str, Any]) -> Any:
        if isinstance(rule, list | tuple):
            return [self._evaluate(key, entry, values) for entry in rule]
        if isinstance(rule, str):
            try:
                return evaluate(rule, values)
            except ValueError as error:
                raise self._mistake(key, rule, str(error)) from None
        if _is_number(rule):
            return float(rule)
        raise self._mistake(key, rule, "must be an expression or a list of them")

    def _mistake(self, key: str, value: object, allowed: str) -> InputError:
        return InputError(f"{self.definition.address}: {key} = {show(value)}: {allowed}")


def _unit_points(method: str, count: int, dimensions: int, seed: int) -> Floats:
    """Points in the unit cube, shape (count, dimensions)."""
    generator = np.random.default_rng(seed)
    if method == "random":
        return generator.random((count, dimensions))
    from scipy.stats import qmc

    if method == "latin_hypercube":
        points = qmc.LatinHypercube(dimensions, seed=generator).random(count)
    else:
        points = qmc.Sobol(dimensions, seed=generator).random_base2(count.bit_length() - 1)
    return np.asarray(points, dtype=np.float64)


def _of_one_type(values: Sequence[Any]) -> Sequence[Any]:
    """Numbers with whole ones among them as floats throughout; other values as they are."""
    mixed = all(map(_is_number, values)) and any(isinstance(value, float) for value in values)
    return [float(value) for value in values] if mixed else values


def _names_in(rule: Any) -> set[str]:
    if isinstance(rule, list | tuple):
        return {name for entry in rule for name in _names_in(entry)}
    try:
        return names(rule) if isinstance(rule, str) else set()
    except ValueError:
        return set()  # evaluating it will say what is wrong


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
