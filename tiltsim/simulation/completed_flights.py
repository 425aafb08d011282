"""Completed flights whose metrics are computed together."""

from collections.abc import Sequence
from functools import cache
from typing import Final

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import EngineName
from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import Metrics, metrics_of_rows
from tiltsim_controllers.mathematics.scalar import Floats

METRICS_ROWS: Final = 128
"""Flights whose metrics are computed together: they fit into the caches of a core."""


def completed_flights(
    assemblies: Sequence[Assembly],
    numbers: Floats,
    samples: Floats,
    engine: EngineName,
    seconds: Sequence[float],
) -> list[Flight]:
    """Flights of one closed loop that were flown to the end of their duration.

    Args:
        assemblies: One per flight.
        numbers: Parameters of their loops, shape (flights, numbers), as `flatten` returns them.
        samples: Shape (flights, N, fields), at the same times.
        engine: That flew them.
        seconds: Time that each took.

    Returns:
        The flights; the metrics of all of them are computed when the first is requested.
    """
    if not assemblies:
        return []
    end = End("completed", float(samples[0, -1, 0]))

    @cache
    def together() -> list[Metrics] | None:
        if len({assembly.setup.knots for assembly in assemblies}) > 1 or len(assemblies) < 2:
            return None
        return metrics_of_rows(assemblies, numbers, samples, end, seconds)

    def metrics_of(place: int) -> Metrics | None:
        found = together()
        return None if found is None else found[place]

    return [
        Flight(assembly, own, end, engine, time, lambda place=place: metrics_of(place))  # type: ignore[misc]
        for place, (assembly, own, time) in enumerate(zip(assemblies, samples, seconds))
    ]
