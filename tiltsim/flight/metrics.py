"""A flight in numbers: the metrics that expectations check and sweeps collect."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.end import End
from tiltsim_controllers.mathematics.scalar import Floats


def compute_metrics(
    columns: Mapping[str, Floats], assembly: Assembly, end: End, wall_time: float
) -> dict[str, float | bool]:
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
    return {name: value for name, value in metrics.items() if isfinite(value)}
