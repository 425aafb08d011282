"""Domain randomisation: every episode flies a scenario drawn along the axes of a sweep."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pydantic import ValidationError

from tiltsim.errors import InputError
from tiltsim.scenario.document import without_none
from tiltsim.scenario.messages import one_line_message
from tiltsim.sweeps.definition import Definition
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.plan import Plan
from tiltsim.sweeps.tables import NormalAxis, SeedAxis, Sweep, UniformAxis

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.sweeps.tables import Axis

LARGEST_SEED: Final = 2**31


class Domain:
    """Scenarios around a base: values drawn along axes, independently for every episode.

    ``uniform`` and ``normal`` axes are drawn from their distributions, those with values of their
    own (``list``, ``linspace``, ``cases``) from these, each as likely as the next, and one place
    for all axes of a group; a ``seed`` is any.
    """

    def __init__(self, scenario: Scenario, axes: Sequence[Mapping[str, Any]]) -> None:
        """Raises `InputError`, as a sweep would, where an axis is invalid."""
        drawn = any(axis.get("type") in {"uniform", "normal", "seed"} for axis in axes)
        document = {
            "scenario": "base",
            "axis": [dict(axis) for axis in axes],
            **({"sample": {"count": 1}} if drawn else {}),
        }
        try:
            sweep = Sweep.model_validate(document)
        except ValidationError as error:
            raise InputError(f"domain: {one_line_message(error, document, Sweep)}") from None
        base = without_none(scenario.model_dump(mode="json"))
        base.pop("expect", None)
        self._plan = _plan(sweep, base)
        self._plan.check()

    @classmethod
    def of_sweep(cls, path: str | Path) -> tuple[Domain, Scenario]:
        """The domain of a sweep file, and its base scenario.

        Raises `InputError` where the file is no sweep along axes.
        """
        definition = load_sweep(path)
        sweep = Sweep.model_validate(definition.sweep)
        if sweep.bisect is not None:
            raise InputError(f"{definition.address}: bisect: a search is nothing to draw from")
        domain = cls.__new__(cls)
        domain._plan = Plan(definition)
        return domain, domain._plan.scenario(domain._plan.point(0))

    def draw(self, generator: np.random.Generator) -> Scenario:
        """A scenario of the domain. Raises `InputError` where what was drawn cannot be flown."""
        values: dict[str, Any] = {}
        places: dict[str, int] = {}
        for axis in self._plan.sweep.axis:
            values |= self._plan.place(axis, _row(axis, generator, places))
        return self._plan.scenario(values)


def _plan(sweep: Sweep, base: dict[str, Any]) -> Plan:
    tables = json.loads(sweep.model_dump_json(exclude_none=True))
    return Plan(Definition("domain", tables, json.loads(json.dumps(base)), {}))


def _row(axis: Axis, generator: np.random.Generator, places: dict[str, int]) -> Sequence[Any]:
    """One value for each key of an axis; keys that move together get the same draw.

    ``places`` are those drawn for groups so far.
    """
    if isinstance(axis, UniformAxis):
        return [float(generator.uniform(axis.low, axis.high))] * len(axis.targets)
    if isinstance(axis, NormalAxis):
        drawn = generator.normal(axis.mean, axis.standard_deviation)
        return [float(drawn)] * len(axis.targets)
    if isinstance(axis, SeedAxis):
        return [int(generator.integers(LARGEST_SEED))] * len(axis.targets)
    rows = axis.rows()
    if axis.group in places:
        return rows[places[axis.group]]
    place = int(generator.integers(len(rows)))
    if axis.group is not None:
        places[axis.group] = place
    return rows[place]
