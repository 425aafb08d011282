"""Flying a chunk of a sweep: from points to rows, searches for boundaries included."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.flight.expectations import Verdict
from tiltsim.plants.engine_choice import with_engine
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.trust import require_trust, with_trust
from tiltsim.sweeps.columns import installed_versions, make_row, rows_to_table
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.executing import FEW, ScenarioResult, fly_scenarios
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.search import boundary
from tiltsim.system.parquet import parquet_bytes

Row = dict[str, Any]


@dataclass(frozen=True)
class FinishedChunk:
    """The rows of a chunk, ready to be written."""

    number: int
    rows: int
    table: bytes  # the rows as a Parquet file
    flights: dict[int, bytes]  # flight.parquet by point, if the sweep keeps flights
    versions: dict[str, str]  # of the packages that made the rows


@dataclass(frozen=True)
class ChunkWork:
    """Flies chunks of a sweep by number, in this process or, pickled, in another."""

    definition_json: str  # see `SweepDefinition.to_json`
    engine: EngineName | None  # for scenarios whose engine is auto; None lets each choose
    trusted: bool = False  # whether to execute Python code that scenarios name

    def __call__(self, number: int) -> FinishedChunk:
        """Fly one chunk. Raises `InputError` if a file that scenarios name has changed."""
        points = _points(self.definition_json)
        rows, flights = fly_points(points, points.chunk(number), self.engine, trusted=self.trusted)
        points.definition.require_same_files()
        table = parquet_bytes(rows_to_table(points, rows))
        return FinishedChunk(number, len(rows), table, flights, installed_versions())


@lru_cache(maxsize=2)
def _points(definition_json: str) -> SweepPoints:
    return SweepPoints(SweepDefinition.from_json(definition_json))


def fly_points(
    points: SweepPoints, indices: Iterable[int], engine: EngineName | None, *, trusted: bool = False
) -> tuple[list[Row], dict[int, bytes]]:
    """Fly some points of a sweep; return their rows, in order, and the flights to keep.

    The searches of all points advance together, so that their flights come in batches.

    Args:
        points: The sweep's.
        indices: Of the points to fly.
        engine: For scenarios whose engine is auto.
        trusted: Whether to execute Python code that scenarios name.
    """
    finished: dict[int, tuple[Row, ScenarioResult]] = {}
    searches = {index: _search(points, index) for index in indices}
    pending = {index: next(search) for index, search in searches.items()}
    while pending:
        results = _fly_values(points, list(pending.values()), engine, trusted)
        for index, result in zip(list(pending), results, strict=True):
            try:
                pending[index] = searches[index].send(result)
            except StopIteration as stop:
                finished[index] = stop.value
                del pending[index]
    rows = [finished[index][0] for index in searches]
    flights = {index: finished[index][1].flight for index in searches}
    return rows, {index: flight for index, flight in flights.items() if flight is not None}


def _fly_values(
    points: SweepPoints, batch: list[dict[str, Any]], engine: EngineName | None, trusted: bool
) -> list[ScenarioResult]:
    """Results for values of the axes, "invalid" where they do not make a scenario."""
    results: dict[int, ScenarioResult] = {}
    asked: dict[int, Scenario] = {}
    scenarios: dict[int, Scenario] = {}
    for position, values in enumerate(batch):
        try:
            scenario = with_trust(points.scenario(values), trusted)
        except InputError as error:
            results[position] = ScenarioResult({}, "invalid", None, str(error))
            continue
        require_trust(scenario)
        asked[position] = scenario
        if engine is not None and scenario.simulation.engine == "auto":
            scenario = with_engine(scenario, engine)
        scenarios[position] = scenario
    flown = fly_scenarios(
        list(scenarios.values()),
        keep_flights=points.sweep.keep_flights,
        others=lambda: _valid(points, points.spread(FEW), trusted),
    )
    for position, result in zip(scenarios, flown, strict=True):
        results[position] = replace(result, scenario=asked[position])
    return [results[position] for position in range(len(batch))]


def _valid(
    points: SweepPoints, several: Iterable[dict[str, Any]], trusted: bool
) -> Iterator[Scenario]:
    """The scenarios of points that have one, without code that is not trusted."""
    for values in several:
        with suppress(InputError):
            scenario = with_trust(points.scenario(values), trusted)
            require_trust(scenario)
            yield scenario


Search = Generator[dict[str, Any], ScenarioResult, tuple[Row, ScenarioResult]]


def _search(points: SweepPoints, index: int) -> Search:
    """The flights of one point: yields values of the axes, returns the row."""
    values, bisect = points.point(index), points.sweep.bisect
    if bisect is None:
        result = yield values
        return make_row(points, index, values, result), result
    walk = boundary(bisect.start, points.stop(values), bisect.step, bisect.tolerance)
    at, flights = next(walk), 0
    shown: ScenarioResult | None = None  # the last at which the condition holds, or the first
    while True:
        result = yield values | {bisect.key: at}
        flights += 1
        holds = _holds(points, result)
        if holds or shown is None:
            shown = result
        try:
            at = walk.send(holds)
        except StopIteration as stop:
            found = stop.value
            break
    reached = bisect.start if found.holds is None else found.holds
    row = make_row(points, index, values | {bisect.key: reached}, shown)
    row[bisect.key] = found.holds
    return row | {f"{bisect.key}_beyond": found.fails, "flights": flights}, shown


def _holds(points: SweepPoints, result: ScenarioResult) -> bool:
    assert points.sweep.bisect is not None
    bounds = points.sweep.bisect.holds
    may_diverge = any(bound.metric == "diverged" for bound in bounds)
    if result.end != "completed" and not may_diverge:
        return False
    return all(Verdict(bound, result.metrics.get(bound.metric)).holds for bound in bounds)
