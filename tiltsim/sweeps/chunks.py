"""Flying a chunk of a sweep: from points to rows, searches for boundaries included.

Only this module of the sweeps calls the simulation. Rows depend neither on the computer nor on the
other flights, so that a chunk gives equal rows wherever and whenever it is flown.
"""

import json
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
from math import ceil, copysign
from typing import Any, Final, NamedTuple

import pyarrow as pa

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import Verdict
from tiltsim.plants.plant import with_engine
from tiltsim.scenario.metric_names import is_boolean
from tiltsim.scenario.own_parts import require_trust, with_trust
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.batch import fly
from tiltsim.sweeps.definition import VERSIONS, SweepDefinition, installed_versions
from tiltsim.sweeps.points import SweepPoints
from tiltsim.system.parquet import parquet_bytes
from tiltsim.system.text import valid_unicode

Row = dict[str, Any]

FEW: Final = 3  # crashed flights after which others of the sweep are tried before more are flown


@dataclass(frozen=True)
class ScenarioResult:
    """The part of one flight that goes into the dataset."""

    end: str  # an `EndKind`, invalid or crashed
    cause: str
    end_time: float | None = None  # s
    metrics: Mapping[str, float | bool] = field(default_factory=dict)
    flight: bytes | None = None  # flight.parquet, if the sweep keeps flights
    scenario: Scenario | None = None  # as the sweep has it; None if invalid


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
        points: The points of the sweep.
        indices: Numbers of the points to fly.
        engine: Engine of scenarios whose engine is auto.
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
    made: list[Scenario | ScenarioResult] = []
    for values in batch:
        try:
            made.append(with_trust(points.scenario(values), trusted))
        except InputError as error:
            made.append(ScenarioResult("invalid", str(error)))
    scenarios = [one for one in made if isinstance(one, Scenario)]
    for scenario in scenarios:
        require_trust(scenario)

    def others() -> Iterator[Scenario]:
        for values in points.spread(FEW):
            with suppress(InputError):
                scenario = with_trust(points.scenario(values), trusted)
                require_trust(scenario)
                yield scenario

    fly_some = partial(_fly, engine, points.sweep.keep_flights)
    flown = iter(_fly_scenarios(scenarios, fly_some, others))
    return [next(flown) if isinstance(one, Scenario) else one for one in made]


Search = Generator[dict[str, Any], ScenarioResult, tuple[Row, ScenarioResult]]


def _search(points: SweepPoints, index: int) -> Search:
    """The flights of one point: yields values of the axes, returns the row."""
    values, bisect = points.point(index), points.sweep.bisect
    if bisect is None:
        result = yield values
        return _row(points, index, values, result), result
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
    row = _row(points, index, values | {bisect.key: reached}, shown)
    row[bisect.key] = found.holds
    return row | {f"{bisect.key}_beyond": found.fails, "flights": flights}, shown


def _holds(points: SweepPoints, result: ScenarioResult) -> bool:
    assert points.sweep.bisect is not None
    bounds = points.sweep.bisect.holds
    may_diverge = any(bound.metric == "diverged" for bound in bounds)
    if result.end != "completed" and not may_diverge:
        return False
    return all(Verdict(bound, result.metrics.get(bound.metric)).holds for bound in bounds)


def _row(
    points: SweepPoints, index: int, values: Mapping[str, Any], result: ScenarioResult
) -> dict[str, Any]:
    """The row of a point, by column, without versions, for the values that the axes set."""
    if result.scenario is None:
        document = points.document(values)  # not valid, but it shows the mistake
    else:
        document = result.scenario.model_dump(mode="json", exclude_none=True)
    return {
        "index": index,
        **values,
        **points.derived(values),
        "end": result.end,
        "end_time": result.end_time,
        "cause": valid_unicode(result.cause),
        **{name: result.metrics.get(name) for name in points.metrics},
        "scenario": json.dumps(document),
    }


def rows_to_table(points: SweepPoints, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Rows as an Arrow table, in the schema of the sweep, versions added."""
    versions = {f"{name}_version": number for name, number in installed_versions().items()}
    return pa.Table.from_pylist([{**row, **versions} for row in rows], schema=schema(points))


def schema(points: SweepPoints) -> pa.Schema:
    """The columns of a sweep's dataset; the definition is among the schema's metadata."""
    first = points.point(0) | points.sweep.search
    values = first | points.derived(first)
    fields = [pa.field("index", pa.int64(), nullable=False)]
    for key in points.columns:
        fields.append(pa.field(key, _column_type(values.get(key, 0.0))))
    if points.sweep.search:
        fields.append(pa.field("flights", pa.int64(), nullable=False))
    fields += [
        pa.field("end", pa.string(), nullable=False),
        pa.field("end_time", pa.float64(), metadata={"unit": "s"}),
        pa.field("cause", pa.string(), nullable=False),
    ]
    for name in points.metrics:
        fields.append(pa.field(name, pa.bool_() if is_boolean(name) else pa.float64()))
    names = ("scenario", *(f"{name}_version" for name in VERSIONS))
    fields += [pa.field(name, pa.string(), nullable=False) for name in names]
    return pa.schema(fields, metadata={"sweep": points.definition.to_json()})


def _column_type(value: object) -> pa.DataType:
    if isinstance(value, list | tuple):
        return pa.list_(_column_type(value[0] if value else 0.0))
    for kind, column in ((bool, pa.bool_()), (int, pa.int64()), (str, pa.string())):
        if isinstance(value, kind):
            return column
    return pa.float64()


def _fly_scenarios(
    scenarios: Sequence[Scenario],
    fly_some: Callable[[Sequence[Scenario]], list[ScenarioResult]],
    others: Callable[[], Iterable[Scenario]],
) -> list[ScenarioResult]:
    """Fly scenarios and return their results in the same order.

    Raises `InputError` if the first few crash, and the few that ``others`` makes from all over the
    sweep, all with one Python error; KeyboardInterrupt if a flight was interrupted.
    """

    def alone(scenario: Scenario) -> ScenarioResult:
        try:
            return fly_some([scenario])[0]
        except InputError as error:
            return ScenarioResult("invalid", str(error), scenario=scenario)
        except Exception as error:
            cause = f"{type(error).__name__}: {error}"
            return ScenarioResult("crashed", cause, scenario=scenario)

    try:
        return fly_some(scenarios)
    except Exception:
        # One bad flight must not end the others: find it by flying one at a time.
        first = [*map(alone, scenarios[:FEW])]
        if _have_one_crash(first):
            tried = [*first, *map(alone, others())]
            if len(tried) > len(first) and _have_one_crash(tried):
                raise InputError(
                    f"every flight tried, from all over the sweep, crashed with {first[0].cause}"
                ) from None
        return [*first, *map(alone, scenarios[FEW:])]


def _have_one_crash(results: Sequence[ScenarioResult]) -> bool:
    """Whether all flights crashed, for one reason."""
    return results[0].end == "crashed" and len({(one.end, one.cause) for one in results}) == 1


def _fly(
    engine: EngineName | None, keep_flights: bool, scenarios: Sequence[Scenario]
) -> list[ScenarioResult]:
    """Fly scenarios, with an engine in place of ``auto``."""
    chosen = [
        with_engine(one, engine) if engine and one.simulation.engine == "auto" else one
        for one in scenarios
    ]
    results = []
    for scenario, found in zip(scenarios, fly(chosen, threads=1, keep_samples=keep_flights)):
        end, flight = found.end, found.flight
        file = None if flight is None else _flight_file(flight)
        kept = ScenarioResult(end.kind, end.cause, end.time, found.metrics, file, scenario)
        results.append(kept)
    return results


def _flight_file(flight: Flight) -> bytes:
    table = flight.to_arrow()
    # Two equal flights make equal files.
    origin = {**table.schema.metadata, b"wall_time": b"0.0"}
    return parquet_bytes(table.replace_schema_metadata(origin))


class Boundary(NamedTuple):
    """The last value found at which the condition holds, and the first at which it fails.

    ``holds`` is None if it fails at the start, ``fails`` is None if it holds up to the end.
    """

    holds: float | None
    fails: float | None


def boundary(
    start: float, stop: float, step: float, tolerance: float
) -> Generator[float, bool, Boundary]:
    """Search a boundary; yields values, and is sent whether the condition holds there.

    The value walks from ``start`` to ``stop`` (up or down) in steps, so that the condition holds at
    all values before the boundary, as in ch. 3, Eq. (26). After the first failure the bracket is
    halved.

    Args:
        start, stop: Ends of the walk.
        step: Its step; the last one may be shorter.
        tolerance: Maximum width of the final bracket, unless floats are coarser.
    """
    length = abs(stop - start)
    last = start
    holding: float | None = None
    for number in range(ceil(length / step - 1e-9) + 1):
        # Decimal steps stay decimal: 0.3, not 0.30000000000000004.
        last = round(start + copysign(min(number * step, length), stop - start), 12)
        if not (yield last):
            break
        holding = last
    else:
        return Boundary(holding, None)
    if holding is None:
        return Boundary(None, last)
    while abs(last - holding) > tolerance * (1.0 + 1e-9):
        middle = 0.5 * (holding + last)
        if middle in (holding, last):
            break
        if (yield middle):
            holding = middle
        else:
            last = middle
    return Boundary(holding, last)
