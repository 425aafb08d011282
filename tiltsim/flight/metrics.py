"""A flight in numbers: its end, its metrics, and verdicts on its scenario's expectations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.errors import InputError
from tiltsim.scenario.expectation import Expectation
from tiltsim.scenario.messages import choose, did_you_mean
from tiltsim.scenario.metric_names import METRICS
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.records import unflatten
from tiltsim_controllers.mathematics.scalar import Floats

EndKind = Literal["completed", "diverged", "singular", "interrupted", "failed"]
"""``singular``: at a singular decoupling matrix; ``failed``: a user's own controller failed."""


@dataclass(frozen=True)
class End:
    """Kind, time and cause of a flight's end."""

    kind: EndKind
    time: float  # s
    cause: str = ""

    @property
    def message(self) -> str:
        """One line on a flight that was not completed."""
        return f"flight terminated early at t = {self.time:.3f} s ({self.kind}): {self.cause}"


class UnknownMetricError(InputError, KeyError):
    """A flight has no metric of a name."""

    __str__ = Exception.__str__  # a KeyError shows its message in quotes


class Metrics(dict[str, float | bool]):
    """Metrics by name, a companion's as ``wing.duration``. Others raise `UnknownMetricError`.

    Args:
        known: Metrics of the first vehicle.
        vehicles: Metrics of the companions by their names.
    """

    def __init__(
        self,
        known: Mapping[str, float | bool] = MappingProxyType({}),
        vehicles: Mapping[str, Metrics] = MappingProxyType({}),
    ) -> None:
        super().__init__(known)
        self.vehicles = dict(vehicles)

    def get(self, name: str, default: Any = None) -> Any:
        """A metric, or another value where the flight does not have it."""
        vehicle, _, own = str(name).partition(".")
        if own and vehicle in self.vehicles:
            return self.vehicles[vehicle].get(own, default)
        return super().get(name, default)

    def of_all_vehicles(self) -> dict[str, float | bool]:
        """The metrics with the companions', such as ``wing.duration``."""
        others = self.vehicles.items()
        return self | {f"{name}.{key}": value for name, own in others for key, value in own.items()}

    def __missing__(self, name: object) -> float | bool:
        vehicle, dot, own = name.partition(".") if isinstance(name, str) else ("", "", "")
        if dot and vehicle in self.vehicles:
            return self.vehicles[vehicle][own]
        hint = f"{did_you_mean(own or name, self)}see [*metrics]"
        if dot and self.vehicles:
            hint = choose(vehicle, self.vehicles)
        if isinstance(name, str) and name in METRICS:
            hint = "it has no value, or none that is finite"
        raise UnknownMetricError(f"{short_repr(name)}: no metric of this flight; {hint}")


def compute_metrics(
    columns: Mapping[str, Floats], assembly: Assembly, end: End, wall_time: float
) -> Metrics:
    """All metrics that a flight has of `tiltsim.scenario.metric_names.METRICS`.

    Args:
        columns: Columns of the flight by name, each of shape (N,).
        assembly: The assembly of the flight.
        end: Its end.
        wall_time: Duration of the integration, s.
    """
    values = assembly.loop.kind.metrics(columns, assembly.scenario, assembly.follows_position)
    own = {name: float(value) for name, value in values.items()}
    return _metrics(own, float(columns["time"][-1]), end, wall_time)


def _metrics(own: dict[str, float], duration: float, end: End, wall_time: float) -> Metrics:
    """Metrics of a kind of vehicle and of all kinds, without metrics that have no value."""
    metrics: dict[str, float | bool] = own | {
        "diverged": end.kind in {"diverged", "singular", "failed"},
        "duration": duration,
        "realtime_factor": duration / max(wall_time, 1e-9),
    }
    return Metrics({name: value for name, value in metrics.items() if isfinite(value)})


def metrics_of_rows(
    assemblies: Sequence[Assembly],
    numbers: Floats,
    samples: Floats,
    end: End,
    wall_times: Sequence[float],
) -> list[Metrics] | None:
    """`compute_metrics` of flights of one closed loop, computed together.

    Args:
        assemblies: One per flight, with equal knots.
        numbers: Numbers of their parameters, shape (rows, numbers), in the order of `flatten`.
        samples: Shape (rows, N, fields), at equal times.
        end: Their common end.
        wall_times: Durations of their integrations, s.

    Returns:
        None if scenarios differ in more than numbers that metrics read.
    """
    first, (rows, count, _) = assemblies[0], samples.shape
    loop, time = first.loop, samples[0, :, 0]
    try:
        read = {
            name: _together([getattr(assembly.scenario, name) for assembly in assemblies])
            for name in ("vehicle", "reference")
        }
    except _DifferentError:
        return None
    scenario = first.scenario.model_copy(update=read)
    same = (numbers.view(np.int64) == numbers[:1].view(np.int64)).all(axis=0)
    values: list[Any] = [
        value if common else np.repeat(column, count)
        for value, common, column in zip(numbers[0].tolist(), same, numbers.T)
    ]
    setup = ControlSetup(unflatten(loop.parameters, values), first.setup.knots)
    fields = np.ascontiguousarray(np.moveaxis(samples, -1, 0)).reshape(-1, rows * count)
    known = dict(zip(loop.sample_fields, fields, strict=True))
    known |= loop.derive(known, setup)
    columns = {name: np.reshape(column, (rows, count)) for name, column in known.items()}
    metrics = loop.kind.metrics(columns | {"time": time}, scenario, first.follows_position)
    table = np.stack([*metrics.values()], axis=-1).tolist()
    return [
        _metrics(dict(zip(metrics, row, strict=True)), float(time[-1]), end, wall_time)
        for row, wall_time in zip(table, wall_times, strict=True)
    ]


class _DifferentError(Exception):
    """Tables differ in more than numbers."""


def _together(tables: Sequence[Any]) -> Any:
    """Tables as one whose numbers, where they differ, are arrays (rows, 1)."""
    first = tables[0]
    if all(table is first or table == first for table in tables):
        return first
    if len({*map(type, tables)}) > 1:
        raise _DifferentError
    if isinstance(first, BaseModel):
        keys = type(first).model_fields
        values = {key: _together([getattr(table, key) for table in tables]) for key in keys}
        return first.model_copy(update=values)
    if isinstance(first, tuple) and len({*map(len, tables)}) == 1:
        return tuple(map(_together, zip(*tables)))
    if isinstance(first, float):
        return np.array(tables)[:, np.newaxis]
    raise _DifferentError


@dataclass(frozen=True)
class Verdict:
    """One expectation with the measured value, None where the flight does not have the metric."""

    expectation: Expectation
    measured: float | bool | None

    @property
    def holds(self) -> bool:
        """Whether the measured value lies within the bounds."""
        value, expected = self.measured, self.expectation
        if value is None or isnan(value):
            return False
        if expected.equals is not None and value is not expected.equals:
            return False
        if expected.min is not None and value < expected.min:
            return False
        return expected.max is None or value <= expected.max

    @property
    def measured_text(self) -> str:
        """The measured value as text, or why there is none."""
        value = self.measured
        if value is None:
            is_late = self.expectation.metric.endswith("after_20s")
            return "flight shorter than 20 s" if is_late else "no value"
        return str(value).lower() if isinstance(value, bool) else f"{value:.6g}"

    @property
    def bounds(self) -> str:
        """The bounds as text, such as ``-0.4 .. -0.36``."""
        low, high, equals = self.expectation.min, self.expectation.max, self.expectation.equals
        if equals is not None:
            return str(equals).lower()
        if low is None:
            return f"<= {high:g}"
        return f">= {low:g}" if high is None else f"{low:g} .. {high:g}"


def check_expectations(scenario: Scenario, metrics: Mapping[str, float | bool]) -> list[Verdict]:
    """The verdict on every expectation of a scenario that applies to its plant, in order."""
    return [
        Verdict(expected, metrics.get(expected.metric))
        for expected in scenario.expect
        if expected.plant in {None, scenario.simulation.plant}
    ]
