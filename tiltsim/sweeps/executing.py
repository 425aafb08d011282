"""Executing scenarios of a sweep: the one place where a sweep calls the simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tiltsim.errors import InputError
from tiltsim.simulation.batch import fly
from tiltsim.system.parquet import parquet_bytes

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario


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
    scenarios: Sequence[Scenario], *, keep_flights: bool = False
) -> list[ScenarioResult]:
    """Fly scenarios and return their results in the same order.

    Raises KeyboardInterrupt if a flight was interrupted from the keyboard.
    """
    try:
        return _fly(scenarios, keep_flights)
    except Exception:
        # One bad flight must not end the others: find it by flying one at a time.
        return [_fly_alone(scenario, keep_flights) for scenario in scenarios]


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
