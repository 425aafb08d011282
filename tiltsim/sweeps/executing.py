"""Executing scenarios of a sweep: the one place where a sweep calls the simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from tiltsim.errors import InputError
from tiltsim.simulation.batch import fly
from tiltsim.system.parquet import parquet_bytes

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario

FEW: Final = 3
"""Crashed flights after which others of the sweep are tried before more are flown."""


@dataclass(frozen=True)
class ScenarioResult:
    """The part of one flight that goes into the dataset."""

    metrics: Mapping[str, float | bool]
    end: str  # an `EndKind`, invalid or crashed
    end_time: float | None  # s
    cause: str
    flight: bytes | None = None  # flight.parquet, if the sweep keeps flights
    scenario: Scenario | None = None  # as the sweep has it; None if invalid


def fly_scenarios(
    scenarios: Sequence[Scenario],
    *,
    keep_flights: bool = False,
    others: Callable[[], Iterable[Scenario]] = tuple,
) -> list[ScenarioResult]:
    """Fly scenarios and return their results in the same order.

    Args:
        scenarios: Of a chunk of a sweep.
        keep_flights: Whether results hold their flights.
        others: Makes a few scenarios from all over the sweep.

    Raises:
        InputError: If the first few crash, and the others, all with one Python error.
        KeyboardInterrupt: If a flight was interrupted from the keyboard.
    """
    try:
        return _fly(scenarios, keep_flights)
    except Exception:
        # One bad flight must not end the others: find it by flying one at a time.
        first = [_fly_alone(scenario, keep_flights) for scenario in scenarios[:FEW]]
        if _have_one_crash(first):
            crash = first[0]
            tried = [*first, *(_fly_alone(scenario, False) for scenario in others())]
            if len(tried) > len(first) and _have_one_crash(tried):
                raise InputError(
                    f"every flight tried, from all over the sweep, crashed with {crash.cause}"
                ) from None
        return [*first, *(_fly_alone(scenario, keep_flights) for scenario in scenarios[FEW:])]


def _have_one_crash(results: Sequence[ScenarioResult]) -> bool:
    """Whether all flights crashed, for one reason."""
    return len({(result.end, result.cause) for result in results}) == 1 and (
        results[0].end == "crashed"
    )


def _fly(scenarios: Sequence[Scenario], keep_flights: bool) -> list[ScenarioResult]:
    return [
        ScenarioResult(
            result.metrics,
            result.end.kind,
            result.end.time,
            result.end.cause,
            None if result.flight is None else _flight_file(result.flight),
        )
        for result in fly(scenarios, threads=1, keep_samples=keep_flights)
    ]


def _fly_alone(scenario: Scenario, keep_flight: bool) -> ScenarioResult:
    try:
        return _fly([scenario], keep_flight)[0]
    except InputError as error:
        return ScenarioResult({}, "invalid", None, str(error))
    except Exception as error:
        return ScenarioResult({}, "crashed", None, f"{type(error).__name__}: {error}")


def _flight_file(flight: Flight) -> bytes:
    table = flight.to_arrow()
    # Two equal flights make equal files.
    origin = {**table.schema.metadata, b"wall_time": b"0.0"}
    return parquet_bytes(table.replace_schema_metadata(origin))
