"""Executing scenarios of a sweep: the one place where a sweep calls the simulation."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Final

from tiltsim.errors import InputError
from tiltsim.simulation.batch import fly
from tiltsim.simulation.simulate import simulate

if TYPE_CHECKING:
    from tiltsim.flight.end import End
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario

_ONE_FLIGHT_AT_A_TIME: Final = threading.Lock()
"""MuJoCo's control callback is global to the process, and a cluster may use threads."""


@dataclass(frozen=True)
class ScenarioResult:
    """The part of one flight that goes into the dataset."""

    metrics: Mapping[str, float | bool]
    end: str  # an `EndKind`, invalid or crashed
    end_time: float | None  # s
    cause: str
    flight: bytes | None = None  # flight.parquet, if the sweep keeps flights


def fly_scenarios(
    scenarios: Sequence[Scenario], *, keep_flights: bool = False
) -> list[ScenarioResult]:
    """Fly scenarios and return their results in the same order.

    Raises KeyboardInterrupt if a flight was interrupted from the keyboard.
    """
    with _ONE_FLIGHT_AT_A_TIME:
        try:
            results = list(fly(scenarios, threads=1, keep_samples=keep_flights))
        except Exception:
            # One bad flight must not end the others: find it by flying one at a time.
            return [_fly_alone(scenario, keep_flights) for scenario in scenarios]
    return [_result(result.metrics, result.end, result.flight) for result in results]


def _fly_alone(scenario: Scenario, keep_flight: bool) -> ScenarioResult:
    try:
        flight = simulate(scenario)
        metrics = flight.metrics()
    except InputError as error:
        return ScenarioResult({}, "invalid", None, str(error))
    except Exception as error:
        return ScenarioResult({}, "crashed", None, f"{type(error).__name__}: {error}")
    if flight.end.kind == "interrupted":
        raise KeyboardInterrupt
    return _result(metrics, flight.end, flight if keep_flight else None)


def _result(metrics: Mapping[str, float | bool], end: End, flight: Flight | None) -> ScenarioResult:
    table = None if flight is None else _flight_file(flight)
    return ScenarioResult(metrics, end.kind, end.time, end.cause, table)


def _flight_file(flight: Flight) -> bytes:
    import pyarrow.parquet as pq

    table = flight.to_arrow()
    # Two equal flights make equal files.
    origin = {**table.schema.metadata, b"wall_time": b"0.0"}
    buffer = BytesIO()
    pq.write_table(table.replace_schema_metadata(origin), buffer, compression="zstd")
    return buffer.getvalue()
