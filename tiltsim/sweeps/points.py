"""The points of a sweep: which there are, in which order, and which scenario each one flies."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cache, cached_property
from math import prod
from typing import Any, Final, NamedTuple

import numpy as np
from pydantic import BaseModel, ValidationError

from tiltsim.errors import InputError
from tiltsim.scenario.documents import merge, split_key, value_at, with_value
from tiltsim.scenario.loading import apply_overrides, parse_scenario
from tiltsim.scenario.messages import InvalidValueError, show
from tiltsim.scenario.metric_names import KEPT_METRICS
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.vehicle import MOMENTS, VehicleTable
from tiltsim.sweeps import tables
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.expressions import evaluate
from tiltsim.system.arguments import is_number
from tiltsim_controllers.mathematics.scalar import Floats

Document = dict[str, Any]


class _Known(NamedTuple):
    """A scenario with the values by key that it was made from."""

    values: Mapping[str, Any]
    document: Document
    scenario: Scenario


def _alike(first: Any, second: Any) -> bool:
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(_alike, first, second))
    return type(first) is type(second) and is_number(first)


def _similar(known: _Known, values: Mapping[str, Any]) -> Scenario | None:
    """A known scenario with other values by key.

    None if one is no number or list of numbers as before, its table has no keys, or the scenario is
    not valid.
    """
    if known.values.keys() != values.keys():
        return None
    # 0.0 equals -0.0 and 1, but a flight's scenario is the one that its row names.
    changes = {k: value for k, value in values.items() if repr(value) != repr(known.values[k])}
    if not all(_alike(known.values[key], value) for key, value in changes.items()):
        return None
    changed: Document = {}
    for key, value in changes.items():
        name, *path = _split(key)
        if not isinstance(getattr(known.scenario, str(name), None), BaseModel):
            return None
        table = changed.get(str(name), known.document[str(name)])
        changed[str(name)] = with_value(table, path, value)
    try:
        tables = {
            name: type(getattr(known.scenario, name)).model_validate(table)
            for name, table in changed.items()
        }
        scenario = known.scenario.model_copy(update=tables)
        scenario.require_consistency()
    except (ValidationError, InvalidValueError):  # in words of the whole document: by the caller
        return None
    return scenario


_split: Final = cache(split_key)


MAX_POINTS: Final = 10_000_000
LARGEST_CHUNK: Final = 32
"""Points per chunk unless the file sets it: few enough that little is lost when killed."""

LARGEST_TOGETHER: Final = 1024
"""Points per chunk on equations of motion, whose flights are short and computed side by side."""


class SweepPoints:
    """The points of a sweep.

    Points are numbered: the axes' groups in the order of the file, the last one fastest, and for
    each combination all samples. A chunk is a range of points.
    """

    def __init__(self, definition: SweepDefinition) -> None:
        self.definition = definition
        self.sweep = tables.Sweep.model_validate(definition.sweep)
        self._known: dict[object, _Known] = {}  # one scenario of each kind, made in full
        self._groups = self._make_groups()
        axes = self.sweep.axis
        self._drawn = [
            axis for axis in axes if isinstance(axis, tables.UniformAxis | tables.NormalAxis)
        ]
        self._seeds = [axis for axis in axes if isinstance(axis, tables.SeedAxis)]
        self.cases = [axis for axis in axes if isinstance(axis, tables.CasesAxis)]
        samples = self.sweep.sample.count if self.sweep.sample is not None else 1
        self._lengths = [*(len(group) for group in self._groups), samples]
        points = prod(self._lengths)  # may be too large for `len`
        if points > MAX_POINTS:
            raise definition.mistake("axis", points, f"more than {MAX_POINTS} points")

    def __len__(self) -> int:
        """Number of points."""
        return prod(self._lengths)

    @cached_property
    def chunk_size(self) -> int:
        """Points per chunk."""
        if self.sweep.chunk_size is not None:
            return self.sweep.chunk_size
        try:
            simulation = self.scenario(self.point(0)).simulation
        except InputError:  # reported when it is flown
            return max(1, min(LARGEST_CHUNK, len(self) // 64))
        largest = LARGEST_CHUNK if simulation.plant == "mujoco" else LARGEST_TOGETHER
        parts = 4 if simulation.engine == "jax" else 64  # which compiles for every size
        return max(1, min(largest, len(self) // parts))

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
        """The metrics that the dataset holds, by default every vehicle's."""
        if self.sweep.metrics is not None:
            return self.sweep.metrics
        prefixes = ("", *(f"{name}." for name in self.vehicles))
        return tuple(prefix + name for prefix in prefixes for name in KEPT_METRICS)

    @cached_property
    def vehicles(self) -> tuple[str, ...]:
        """The names of the companions in the base scenario and in cases."""
        documents = [self.definition.base, *(d for a in self.cases for d in a.cases.values())]
        lists = [one.get("companion") for one in documents]
        tables = [each for one in lists if isinstance(one, list) for each in one]
        names = (str(each.get("name")) for each in tables if isinstance(each, dict))
        return tuple(dict.fromkeys(names))

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The columns of axes and derived keys in the results."""
        beyond = (f"{key}_beyond" for key in self.sweep.search)
        return (*self.sweep.targets, *beyond, *self.sweep.derive)

    def point(self, index: int) -> dict[str, Any]:
        """The values that the axes set at a point, by key."""
        values: dict[str, Any] = {}
        remaining, positions = index, []
        for length in reversed(self._lengths):
            remaining, position = divmod(remaining, length)
            positions.append(position)
        sample, *grid = positions
        for group, position in zip(self._groups, reversed(grid), strict=True):
            values |= group[position]
        for axis, draw in zip(self._drawn, self._draws[sample] if self._drawn else ()):
            values |= self.place(axis, [float(draw)] * len(axis.targets))
        for seed in self._seeds:
            values |= dict.fromkeys(seed.targets, seed.start + sample)
        return values

    def along_each_group(self, most: int) -> list[dict[str, Any]]:
        """The first point, and points at other values of one group of axes at a time.

        A group with more than ``most`` values gives ``most`` of them, spread evenly, both ends
        included.
        """
        points = [self.point(0)]
        for position, length in enumerate(self._lengths[:-1]):
            stride = prod(self._lengths[position + 1 :])
            count = min(length, most)
            places = [place * (length - 1) // max(1, count - 1) for place in range(1, count)]
            points += [self.point(place * stride) for place in places]
        return points

    def spread(self, most: int) -> list[dict[str, Any]]:
        """At most ``most`` points, spread evenly over the sweep, both ends included."""
        count = min(len(self), most)
        return [self.point(n * (len(self) - 1) // max(1, count - 1)) for n in range(count)]

    def derived(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The ``[derive]`` keys for values of the axes. Raises `InputError` if one has no value."""
        rules = self.sweep.derive.items()
        return {key: self._evaluate(f"derive.{key}", rule, values) for key, rule in rules}

    def stop(self, values: Mapping[str, Any]) -> float:
        """Where the bisected key stops at a point."""
        assert self.sweep.bisect is not None
        return float(self._evaluate("bisect.stop", self.sweep.bisect.stop, values))

    def document(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The scenario's document for values of the axes."""
        document = deepcopy(self.definition.base)
        for axis in self.cases:
            document = merge(document, deepcopy(axis.cases[values[axis.key]]))
        overrides = self._given(values)
        for key in overrides:
            if "[" in key:
                self._write_out(document, key.partition("[")[0])
        apply_overrides(document, overrides, self.definition.address)
        return document

    def _given(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The keys of the scenario that a point sets, dotted, and their values."""
        given = {**self.sweep.set, **values, **self.derived(values)}
        return {key: value for key, value in given.items() if "." in key}

    def scenario(self, values: Mapping[str, Any]) -> Scenario:
        """The scenario for values of the axes. Raises `InputError` if it is not valid."""
        given = self._given(values)
        kind = tuple(values[axis.key] for axis in self.cases)
        similar = _similar(self._known[kind], given) if kind in self._known else None
        if similar is not None:
            return similar
        document = self.document(values)
        scenario = parse_scenario(document, self.definition.address)
        self._known.setdefault(kind, _Known(given, document, scenario))
        return scenario

    def place(self, axis: tables.AxisTable, values: Sequence[Any]) -> dict[str, Any]:
        """The values that an axis sets, by key, from one value for each of its targets."""
        placed = dict(zip(axis.targets, values, strict=True))
        if not axis.relative:
            return placed
        return {key: self._scaled(key, factor) for key, factor in placed.items()}

    @cached_property
    def _base(self) -> dict[str, Any]:
        """The base scenario with the vehicle's preset written out."""
        base = self.definition.base
        vehicle = parse_scenario(base).vehicle
        if not isinstance(vehicle, VehicleTable):
            return base
        known = vehicle.resolve()._asdict()
        known["inertia"] = [known.pop(moment) for moment in MOMENTS]
        return {**base, "vehicle": {**known, **base["vehicle"]}}

    def _scaled(self, key: str, factor: Any) -> Any:
        """A base value times a factor. Raises `InputError` if either is not numeric."""
        base = value_at(self._base, key)
        if not is_number(factor):
            raise self.definition.mistake("axis.values", factor, "relative values are numbers")
        if is_number(base):
            return float(base * factor)
        if isinstance(base, list) and all(map(is_number, base)):
            return [float(value * factor) for value in base]
        allowed = f"{key} = {show(base)} in the base scenario is not a number"
        raise self.definition.mistake("axis.relative", True, allowed)

    def _write_out(self, document: dict[str, Any], key: str) -> None:
        """Put a list that follows from a preset into the document, to change an entry of it."""
        name, _, last = key.rpartition(".")
        table, value = value_at(document, name), value_at(self._base, key)
        if isinstance(table, dict) and last not in table and isinstance(value, list):
            table[last] = [*value]

    def _evaluate(self, key: str, rule: Any, values: Mapping[str, Any]) -> Any:
        if isinstance(rule, list | tuple):
            return [self._evaluate(key, entry, values) for entry in rule]
        if isinstance(rule, str):
            try:
                return evaluate(rule, values)
            except ValueError as error:
                raise self.definition.mistake(key, rule, str(error)) from None
        if is_number(rule):
            return float(rule)
        raise self.definition.mistake(key, rule, "must be an expression or a list of them")

    def _make_groups(self) -> list[list[dict[str, Any]]]:
        members: dict[str, list[list[dict[str, Any]]]] = {}
        for number, axis in enumerate(self.sweep.axis):
            if isinstance(axis, tables.GridAxis):
                columns = [_of_one_type(column) for column in zip(*axis.rows())]
                rows = [self.place(axis, row) for row in zip(*columns)]
                # A group's name is never a number.
                members.setdefault(axis.group or f"{number}", []).append(rows)
        groups = []
        for name, axes in members.items():
            lengths = [len(rows) for rows in axes]
            if len(set(lengths)) > 1:
                allowed = f"its axes have {lengths} values"
                raise self.definition.mistake("axis.group", name, allowed)
            groups.append(
                [
                    {key: value for part in parts for key, value in part.items()}
                    for parts in zip(*axes)
                ]
            )
        return groups

    @cached_property
    def _draws(self) -> Floats:
        """Values of the drawn axes, shape (samples, axes); equal for equal seeds."""
        assert self.sweep.sample is not None
        columns = []
        for axis, column in zip(self._drawn, _unit_points(self.sweep.sample, len(self._drawn)).T):
            if isinstance(axis, tables.UniformAxis):
                columns.append(axis.low + (axis.high - axis.low) * column)
            else:
                from scipy.special import ndtri

                inside = np.clip(column, 2.0**-54, 1.0 - 2.0**-53)
                columns.append(axis.mean + axis.standard_deviation * ndtri(inside))
        return np.stack(columns, axis=-1)


def _of_one_type(values: Sequence[Any]) -> Sequence[Any]:
    """Integers mixed with floats as floats; other values unchanged."""
    mixed = all(map(is_number, values)) and any(isinstance(value, float) for value in values)
    return [float(value) for value in values] if mixed else values


def _unit_points(sample: tables.SampleTable, dimensions: int) -> Floats:
    """Points in the unit cube, shape (samples, dimensions)."""
    generator = np.random.default_rng(sample.seed)
    if sample.method == "random":
        return generator.random((sample.count, dimensions))
    from scipy.stats import qmc

    if sample.method == "latin_hypercube":
        points = qmc.LatinHypercube(dimensions, seed=generator).random(sample.count)
    else:
        exponent = sample.count.bit_length() - 1
        points = qmc.Sobol(dimensions, seed=generator).random_base2(exponent)
    return np.asarray(points, dtype=np.float64)
