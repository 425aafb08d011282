"""A flight in numbers: the metrics that expectations check and sweeps collect."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import NoReturn

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.errors import InputError
from tiltsim.flight.end import End
from tiltsim.scenario.messages import did_you_mean
from tiltsim.scenario.metric_names import METRICS
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats


class UnknownMetricError(InputError, KeyError):
    """A flight has no metric of a name."""

    __str__ = Exception.__str__  # a KeyError shows its message in quotes


class Metrics(dict[str, float | bool]):
    """Metrics by name. Others raise `UnknownMetricError`."""

    def __missing__(self, name: object) -> NoReturn:
        hint = f"{did_you_mean(name, self)}see [*metrics]"
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
        end: How it ended.
        wall_time: Duration of the integration, s.
    """
    duration = float(columns["time"][-1])
    metrics = assembly.loop.kind.metrics(columns, assembly.scenario, assembly.follows_position) | {
        "diverged": end.kind in {"diverged", "singular", "failed"},
        "duration": duration,
        "realtime_factor": duration / max(wall_time, 1e-9),
    }
    return Metrics({name: value for name, value in metrics.items() if isfinite(value)})
