"""Flying a chunk of a sweep: from points to rows of the dataset.

`fly_chunk` is the one place where scenarios are executed. Rows hold nothing that depends on the
computer or on what else was flown, so that a chunk gives the same rows wherever and whenever it is
flown.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from typing import TYPE_CHECKING, Any, Final

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.flight.verdicts import Verdict
from tiltsim.plants.engine_choice import with_engine
from tiltsim.scenario.document import without_none
from tiltsim.scenario.metric_names import BOOLEAN_METRICS
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.batch import fly
from tiltsim.simulation.simulate import simulate
from tiltsim.sweeps.definition import VERSIONS, Definition
from tiltsim.sweeps.plan import Plan
from tiltsim.sweeps.search import boundary

if TYPE_CHECKING:
    import pyarrow

    from tiltsim.flight.end import End
    from tiltsim.flight.flight import Flight

_ONE_FLIGHT_AT_A_TIME: Final = threading.Lock()
"""MuJoCo's control callback is global to the process, and a cluster may use threads."""


@dataclass(frozen=True)
class Outcome:
    """What is kept of one flight."""

    metrics: Mapping[str, float | bool]
    end: str  # an `EndKind`, invalid or crashed
    end_time: float | None  # s
    cause: str
    flight: bytes | None = None  # flight.parquet, where it is kept


@dataclass(frozen=True)
class Part:
    """A finished chunk.

    Attributes
    ----------
    number
        Of the chunk.
    rows
        Of the dataset.
    table
        The rows as a Parquet file.
    flights
        Files ``flight.parquet`` by point, where they are kept.
    versions
        Of the packages that made the rows.
    """

    number: int
    rows: int
    table: bytes
    flights: dict[int, bytes]
    versions: dict[str, str]


def fly_chunk(scenarios: Sequence[Scenario], *, keep_flights: bool = False) -> list[Outcome]:
    """Fly scenarios, and tell what is kept of each, in the order given.

    Raises KeyboardInterrupt where the keyboard interrupted a flight.
    """
    with _ONE_FLIGHT_AT_A_TIME:
        try:
            results = list(fly(scenarios, threads=1, keep_samples=keep_flights))
        except Exception:
            # One bad flight must not take the others down: find it by flying one at a time.
            return [_fly_alone(scenario, keep_flights) for scenario in scenarios]
    return [_outcome(r.metrics, r.end, r.flight) for r in results]


def _fly_alone(scenario: Scenario, keep_flight: bool) -> Outcome:
    try:
        flight = simulate(scenario)
        metrics = flight.metrics()
    except InputError as error:
        return Outcome({}, "invalid", None, str(error))
    except Exception as error:
        return Outcome({}, "crashed", None, f"{type(error).__name__}: {error}")
    if flight.end.kind == "interrupted":
        raise KeyboardInterrupt
    return _outcome(metrics, flight.end, flight if keep_flight else None)


def _outcome(metrics: Mapping[str, float | bool], end: End, flight: Flight | None) -> Outcome:
    table = None if flight is None else _flight_file(flight)
    return Outcome(metrics, end.kind, end.time, end.cause, table)


def _flight_file(flight: Flight) -> bytes:
    import pyarrow.parquet as pq

    table = flight.to_arrow()
    # Two equal flights make equal files.
    origin = {**table.schema.metadata, b"wall_time": b"0.0"}
    buffer = BytesIO()
    pq.write_table(table.replace_schema_metadata(origin), buffer, compression="zstd")
    return buffer.getvalue()


def fly_sweep_chunk(definition_json: str, number: int, engine: EngineName | None) -> Part:
    """Fly one chunk of a sweep.

    Parameters
    ----------
    definition_json
        The sweep, see `Definition.to_json`.
    number
        Of the chunk.
    engine
        What scenarios fly with whose engine is auto; None leaves it to each.
    """
    plan = _plan(definition_json)
    rows, flights = fly_points(plan, plan.chunk(number), engine)
    table = rows_to_table(plan, rows)
    import pyarrow.parquet as pq

    buffer = BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return Part(number, len(rows), buffer.getvalue(), flights, installed_versions())


@lru_cache(maxsize=2)
def _plan(definition_json: str) -> Plan:
    return Plan(Definition.from_json(definition_json))


@lru_cache(maxsize=1)
def installed_versions() -> dict[str, str]:
    """Versions of the packages that rows depend on."""
    from importlib.metadata import version

    return {name: version(name) for name in VERSIONS}


def fly_points(
    plan: Plan, points: Iterable[int], engine: EngineName | None
) -> tuple[list[dict[str, Any]], dict[int, bytes]]:
    """Fly some points of a sweep: their rows, in order, and the flights to keep.

    The searches of all points go on side by side, so that their flights come in batches.
    """
    finished: dict[int, tuple[dict[str, Any], Outcome]] = {}
    searches = {index: _search(plan, index) for index in points}
    wanted = {index: next(search) for index, search in searches.items()}
    while wanted:
        outcomes = _fly_all(plan, list(wanted.values()), engine)
        for index, outcome in zip(list(wanted), outcomes, strict=True):
            try:
                wanted[index] = searches[index].send(outcome)
            except StopIteration as stop:
                finished[index] = stop.value
                del wanted[index]
    rows = [finished[index][0] for index in searches]
    flights = {index: finished[index][1].flight for index in searches}
    return rows, {index: flight for index, flight in flights.items() if flight is not None}


def _fly_all(plan: Plan, points: list[dict[str, Any]], engine: EngineName | None) -> list[Outcome]:
    """Outcomes for the values of axes, those that make no scenario included."""
    outcomes: dict[int, Outcome] = {}
    scenarios: dict[int, Scenario] = {}
    for position, values in enumerate(points):
        try:
            scenario = plan.scenario(values)
        except InputError as error:
            outcomes[position] = Outcome({}, "invalid", None, str(error))
            continue
        if engine is not None and scenario.simulation.engine == "auto":
            scenario = with_engine(scenario, engine)
        scenarios[position] = scenario
    flown = fly_chunk(list(scenarios.values()), keep_flights=plan.sweep.keep_flights)
    outcomes |= dict(zip(scenarios, flown, strict=True))
    return [outcomes[position] for position in range(len(points))]


Search = Generator[dict[str, Any], Outcome, tuple[dict[str, Any], Outcome]]


def _search(plan: Plan, index: int) -> Search:
    """The flights of one point: yields values of the axes, returns the row."""
    values, bisect = plan.point(index), plan.sweep.bisect
    if bisect is None:
        outcome = yield values
        return _row(plan, index, values, outcome), outcome
    walk = boundary(bisect.start, plan.stop(values), bisect.step, bisect.tolerance)
    at, flights = next(walk), 0
    shown: Outcome | None = None  # the last to hold, or the very first
    while True:
        outcome = yield values | {bisect.key: at}
        flights += 1
        holds = _holds(plan, outcome)
        if holds or shown is None:
            shown = outcome
        try:
            at = walk.send(holds)
        except StopIteration as stop:
            found = stop.value
            break
    reached = bisect.start if found.holds is None else found.holds
    row = _row(plan, index, values | {bisect.key: reached}, shown)
    row[bisect.key] = found.holds
    return row | {f"{bisect.key}_beyond": found.fails, "flights": flights}, shown


def _holds(plan: Plan, outcome: Outcome) -> bool:
    assert plan.sweep.bisect is not None
    wanted = plan.sweep.bisect.holds
    loss_expected = any(expectation.metric == "diverged" for expectation in wanted)
    if outcome.end != "completed" and not loss_expected:
        return False
    return all(Verdict(bound, outcome.metrics.get(bound.metric)).holds for bound in wanted)


def _row(plan: Plan, index: int, values: Mapping[str, Any], outcome: Outcome) -> dict[str, Any]:
    try:
        document = without_none(plan.scenario(values).model_dump(mode="json"))
    except InputError:
        document = plan.document(values)  # as far as it got
    return {
        "index": index,
        **values,
        **plan.derived(values),
        "end": outcome.end,
        "end_time": outcome.end_time,
        "cause": outcome.cause,
        **{name: outcome.metrics.get(name) for name in plan.metrics},
        "scenario": json.dumps(document),
    }


def rows_to_table(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> pyarrow.Table:
    """Rows as an Arrow table, in the schema of the sweep."""
    import pyarrow as pa

    versions = {f"{name}_version": number for name, number in installed_versions().items()}
    return pa.Table.from_pylist([{**row, **versions} for row in rows], schema=schema(plan))


def schema(plan: Plan) -> pyarrow.Schema:
    """The columns of a sweep's dataset; the definition is among the schema's metadata."""
    import pyarrow as pa

    first = plan.point(0)
    bisect = plan.sweep.bisect
    searched = {} if bisect is None else {bisect.key: bisect.start}
    values = first | searched | plan.derived(first | searched)
    fields = [pa.field("index", pa.int64(), nullable=False)]
    for key in plan.columns:
        fields.append(pa.field(key, _column_type(values.get(key, 0.0))))
    if bisect is not None:
        fields.append(pa.field("flights", pa.int64(), nullable=False))
    fields += [
        pa.field("end", pa.string(), nullable=False),
        pa.field("end_time", pa.float64(), metadata={"unit": "s"}),
        pa.field("cause", pa.string(), nullable=False),
    ]
    for name in plan.metrics:
        fields.append(pa.field(name, pa.bool_() if name in BOOLEAN_METRICS else pa.float64()))
    names = ("scenario", *(f"{name}_version" for name in VERSIONS))
    fields += [pa.field(name, pa.string(), nullable=False) for name in names]
    return pa.schema(fields, metadata={"sweep": plan.definition.to_json()})


def _column_type(value: Any) -> pyarrow.DataType:
    import pyarrow as pa

    if isinstance(value, list | tuple):
        return pa.list_(_column_type(value[0] if value else 0.0))
    for kind, column in ((bool, pa.bool_()), (int, pa.int64()), (str, pa.string())):
        if isinstance(value, kind):
            return column
    return pa.float64()
