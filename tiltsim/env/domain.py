"""Domain randomization: every episode flies a scenario drawn along the axes of a sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.scenario.loading import without_none
from tiltsim.scenario.scenario import Scenario
from tiltsim.sweeps.definition import UNUSED
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.tables import Axis, NormalAxis, SeedAxis, UniformAxis
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

LARGEST_SEED: Final = 2**31


class Domain:
    """Scenarios around a base: values drawn along axes, independently for every episode.

    ``uniform`` and ``normal`` axes are drawn from their distributions; axes that list their values
    (``list``, ``linspace``, ``cases``) from these with equal probability, at one position for all
    axes of a group; a ``seed`` is drawn from all seeds.
    """

    def __init__(self, points: SweepPoints) -> None:
        self._points = points

    @classmethod
    def from_axes(cls, scenario: Scenario, axes: Sequence[Mapping[str, Any]]) -> Domain:
        """The domain around a scenario. Raises `InputError` if an axis is invalid."""
        several = isinstance(axes, Sequence) and not isinstance(axes, str)
        if not (several and all(isinstance(axis, Mapping) for axis in axes)):
            raise InputError(f"domain = {short_repr(axes)}: must be a list of axes, each a dict")
        drawn = any(axis.get("type") in {"uniform", "normal", "seed"} for axis in axes)
        document = {
            "scenario": without_none(scenario.model_dump(mode="json", exclude=UNUSED)),
            "axis": [dict(axis) for axis in axes],
            **({"sample": {"count": 1}} if drawn else {}),
        }
        return cls(SweepPoints(load_sweep(document, name="domain")))

    @classmethod
    def from_sweep(cls, path: str | Path) -> Domain:
        """The domain of a sweep file. Raises `InputError` if it is not a sweep along axes."""
        definition = load_sweep(path)
        points = SweepPoints(definition)
        if points.sweep.bisect is not None:
            raise InputError(f"{definition.address}: bisect: a search has no draws")
        return cls(points)

    @property
    def base(self) -> Scenario:
        """The scenario at the first value of every axis."""
        return self._points.scenario(self._points.point(0))

    def draw(self, generator: np.random.Generator) -> Scenario:
        """A scenario of the domain. Raises `InputError` if the values drawn cannot be flown."""
        return self._points.scenario(self._axes(generator))

    def values(self, generator: np.random.Generator) -> dict[str, Any]:
        """The changes that `draw` makes in the base, by key, with the same draws."""
        axes = self._axes(generator)
        every = axes | self._points.derived(axes)
        return {key: value for key, value in every.items() if "." in key}

    def sample(self, generators: Sequence[np.random.Generator]) -> Floats:
        """The numbers of `values`, a row for each generator, shape (generators, numbers)."""
        if self._uniform is None:
            return np.array([_flat(self.values(generator)) for generator in generators])
        columns, low, high = self._uniform
        axes = len(self._points.sweep.axis)
        shares = np.stack([generator.random(axes) for generator in generators])
        return np.asarray(low + (high - low) * shares[:, columns])

    @cached_property
    def _uniform(self) -> tuple[Any, Floats, Floats] | None:
        """The axis, low and high of each number, if all axes are uniform; else None."""
        columns: list[int] = []
        ends: list[tuple[float, float]] = []
        for column, axis in enumerate(self._points.sweep.axis):
            derives = self._points.sweep.derive or not all("." in key for key in axis.targets)
            if derives or not isinstance(axis, UniformAxis):
                return None
            low, high = (
                _flat(self._points.place(axis, [end] * len(axis.targets)))
                for end in (axis.low, axis.high)
            )
            columns += [column] * len(low)
            ends += zip(low, high, strict=True)
        return columns, *np.array(ends).T

    def _axes(self, generator: np.random.Generator) -> dict[str, Any]:
        values: dict[str, Any] = {}
        positions: dict[str, int] = {}
        for axis in self._points.sweep.axis:
            values |= self._points.place(axis, _row(axis, generator, positions))
        return values


def _flat(values: Mapping[str, Any]) -> Floats:
    """Numbers, and lists of them, one after the other."""
    return np.concatenate([np.empty(0), *map(np.atleast_1d, values.values())])


def _row(axis: Axis, generator: np.random.Generator, positions: dict[str, int]) -> Sequence[Any]:
    """One value for each key of an axis, which share a draw; ``positions`` of groups so far."""
    if isinstance(axis, UniformAxis):
        return [float(generator.uniform(axis.low, axis.high))] * len(axis.targets)
    if isinstance(axis, NormalAxis):
        drawn = generator.normal(axis.mean, axis.standard_deviation)
        return [float(drawn)] * len(axis.targets)
    if isinstance(axis, SeedAxis):
        return [int(generator.integers(LARGEST_SEED))] * len(axis.targets)
    rows = axis.rows()
    if axis.group in positions:
        return rows[positions[axis.group]]
    position = int(generator.integers(len(rows)))
    if axis.group is not None:
        positions[axis.group] = position
    return rows[position]
