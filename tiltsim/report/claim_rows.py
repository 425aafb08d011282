"""The rows of the report: every claim with its measured values and verdicts."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Final

from tiltsim.flight.metrics import Verdict, check_expectations
from tiltsim.report.claim import (
    AnalysisClaim,
    Claim,
    ClaimVerdict,
    ExpectationClaim,
    FlightClaim,
    Value,
    plain,
    scenario_claims,
    verdict_on,
    worst,
)
from tiltsim.report.claims import registered_claims, words
from tiltsim.report.flights import (
    PLANTS,
    FlightRecord,
    Flights,
    Plant,
    ReportEntry,
    code_digest,
    sources_digest,
    store,
)
from tiltsim.report.statement import Origin, Statement
from tiltsim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Cell:
    """The measured value of a claim on one plant, or by analysis, and its verdict."""

    measured: Value | None
    verdict: ClaimVerdict
    note: str = ""  # why there is no value, or when the flight terminated
    behind: float | None = None  # the metric behind a yes or no


@dataclass(frozen=True)
class Row:
    """A claim with a cell per plant, or the single cell of an analysis."""

    claim: Claim
    analysis: Cell | None = None
    plants: tuple[tuple[Plant, Cell], ...] = ()
    origins: tuple[Origin, ...] = ()
    """Choices in it that are ours, by its statement, itself and its flights."""

    @property
    def statement(self) -> Statement:
        """The statement that it is a case of."""
        return self.claim.statement

    @property
    def on_the_thesis_alone(self) -> bool:
        """Whether it is reproduced, with no number of ours in its setting or its criterion."""
        ours = self.origins or self.claim.thresholds
        return self.verdict is ClaimVerdict.REPRODUCED and not ours

    @property
    def cells(self) -> list[Cell]:
        """All cells."""
        return [self.analysis] if self.analysis else [cell for _, cell in self.plants]

    @property
    def verdict(self) -> ClaimVerdict:
        """The worst verdict of the cells."""
        return worst([cell.verdict for cell in self.cells])

    @property
    def splits(self) -> bool:
        """Whether the plants have different verdicts."""
        return len({cell.verdict for cell in self.cells}) > 1

    def cell(self, plant: Plant) -> Cell | None:
        """The cell of a plant, None if it has none."""
        return dict(self.plants).get(plant)


@dataclass(frozen=True)
class Failure:
    """A bound of a scenario that does not hold."""

    address: str
    plant: Plant
    verdict: Verdict


def analyze(
    folder: Path, progress: Callable[[int, int], None] = lambda done, total: None
) -> dict[str, Value]:
    """The measured values of all computed claims, by `Claim.id`.

    They are stored in the folder until the core or the report changes. ``progress`` is called with
    the number of computed claims and their total: this takes seconds, not worth processes.
    """
    digest = sources_digest(
        [*Path(__file__).parent.rglob("measures/*.py"), *Path(__file__).parent.rglob("*.toml")],
        code_digest().hex(),
    ).hex()
    path = folder / f"analysis-{digest[:24]}.json"
    try:
        stored = json.loads(path.read_bytes())
    except (OSError, ValueError):
        stored = {}
    values: dict[str, Value] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in stored.items()
    }
    missing = {key: claim for key, claim in _computed().items() if key not in values}
    if missing:
        progress(0, len(missing))
        for done, (key, claim) in enumerate(missing.items(), start=1):
            assert claim.measure is not None
            values[key] = plain(claim.measure())
            progress(done, len(missing))
        folder.mkdir(parents=True, exist_ok=True)
        store(path, json.dumps(values, indent=1).encode())
    return values


def _computed() -> dict[str, AnalysisClaim]:
    return {
        claim.id: claim
        for claim in registered_claims()
        if isinstance(claim, AnalysisClaim) and claim.measure
    }


def make_rows(
    entries: list[ReportEntry], flights: Flights, values: Mapping[str, Value], *, whole: bool
) -> list[Row]:
    """All claims that can be evaluated, in the order of the text.

    Args:
        entries: The scenarios, in order.
        flights: Their records.
        values: Measured values of the computed claims, by `Claim.id`; read only if
            ``whole``.
        whole: Whether this is the whole library. Otherwise computed claims are omitted, and so are
            claims about several flights of which one is missing.
    """
    rows = _expectation_rows(entries, flights)
    ours = {entry.address: entry.scenario.ours for entry in entries}
    for claim in registered_claims():
        flown = claim.flights if isinstance(claim, FlightClaim) else ()
        if whole or (flown and all((address, "mujoco") in flights for address in flown)):
            rows.append(row_of(claim, flights, values.get(claim.id)))
    return [
        replace(row, origins=_origins(row.claim, ours))
        for row in sorted(rows, key=lambda row: row.claim.chapter)
        if row.cells
    ]


def _origins(claim: Claim, ours: Mapping[str, tuple[str, ...]]) -> tuple[Origin, ...]:
    flights = claim.flights if isinstance(claim, FlightClaim) else ()
    flown = {Origin[name.upper()] for address in flights for name in ours.get(address, ())}
    found = {*claim.statement.origins, *claim.origins, *flown}
    return tuple(origin for origin in Origin if origin in found)


def _expectation_rows(entries: list[ReportEntry], flights: Flights) -> list[Row]:
    rows: dict[str, Row] = {}
    for entry in entries:
        for claim in scenario_claims(entry.scenario):
            for plant in PLANTS:
                record = flights[entry.address, plant]
                if claim.expectation.plant in {None, plant} and isinstance(record, FlightRecord):
                    row = rows.get(claim.id, Row(claim))
                    cell = _expectation_cell(claim, record)
                    if claim.why and not row.claim.why:
                        row = replace(row, claim=replace(row.claim, why=claim.why))
                    rows[claim.id] = replace(row, plants=(*row.plants, (plant, cell)))
    return list(rows.values())


def _expectation_cell(claim: ExpectationClaim, record: FlightRecord) -> Cell:
    measured = claim.measure(record.metrics)
    value = record.metrics.get(claim.expectation.metric)
    behind = value if isinstance(measured, bool) and not isinstance(value, bool) else None
    return Cell(measured, verdict_on(claim, measured), _ending(record), behind)


def _ending(record: FlightRecord) -> str:
    if not record.ended_early:
        return ""
    time = f"{record.end_time:#.3g}".rstrip(".")
    return f"terminated at {time} s"


def row_of(claim: AnalysisClaim | FlightClaim, flights: Flights, value: Value | None) -> Row:
    """The row of a claim, with the measured value of a computed one."""
    if isinstance(claim, AnalysisClaim):
        return Row(claim, analysis=Cell(value, verdict_on(claim, value)))
    cells: list[tuple[Plant, Cell]] = []
    for plant in PLANTS:
        records = [flights[address, plant] for address in claim.flights]
        flown = [record for record in records if isinstance(record, FlightRecord)]
        if len(flown) < len(records):
            continue
        try:
            value = plain(claim.measure([record.metrics for record in flown]))
        except KeyError:  # a flight that terminates early has no final values
            value = None
        ended_early = any(record.ended_early for record in flown)
        note = "terminated" if value is None and ended_early else ""
        cells.append((plant, Cell(value, verdict_on(claim, value), note)))
    return Row(claim, plants=tuple(cells))


def failures(entries: list[ReportEntry], flights: Flights) -> list[Failure]:
    """The bounds that do not hold, on either plant."""
    return [
        Failure(entry.address, plant, verdict)
        for entry in entries
        for plant, scenario in entry.plants.items()
        if isinstance(scenario, Scenario)
        and isinstance(record := flights[entry.address, plant], FlightRecord)
        for verdict in check_expectations(scenario, record.metrics)
        if not verdict.holds
    ]


def count(rows: Iterable[Row]) -> Counter[ClaimVerdict]:
    """The number of rows with each verdict."""
    return Counter(row.verdict for row in rows)


def count_statements(rows: Iterable[Row]) -> Counter[ClaimVerdict]:
    """The number of distinct statements with each verdict, the worst of their rows."""
    verdicts: dict[str, list[ClaimVerdict]] = {}
    for row in rows:
        verdicts.setdefault(row.statement.id, []).append(row.verdict)
    return Counter(map(worst, verdicts.values()))


def errors(rows: Iterable[Row]) -> set[str]:
    """Keys of the entries in the list of errors that a refuted or misprinted row names."""
    wrong = {ClaimVerdict.REFUTED, ClaimVerdict.MISPRINT}
    return {row.claim.error for row in rows if row.verdict in wrong}


FACTORS: Final = (0.5, 2.0)

_DIGITS: Final = (
    "A number that rounds to the printed digits is reproduced: half a unit of the last."
)
_BOUNDS: Final = (
    "Bounds in scenario files, each with its reason in the row's criterion; those that are the "
    "thesis's own numbers are not changed here."
)
_OWN: Final = ("ch9-cannot-hover", "ch9-can-hover", "ch9-larger-orbit")
"""Statements whose bounds are the thesis's own rotor limits and radius."""


@dataclass(frozen=True)
class Criterion:
    """A number of ours, the reason for it, and the rows that depend on it."""

    name: str
    value: str
    reason: str
    rows: int
    changed: tuple[int, ...]  # verdicts that change by each of `FACTORS`


def criteria(rows: Sequence[Row], flights: Flights) -> list[Criterion]:
    """The numbers of ours in the criteria of rows, with the verdicts that depend on them.

    Args:
        rows: All rows of a report.
        flights: The flights that they rest on.
    """
    before = {row.claim.id: row for row in rows}
    found = []
    for name, table in words("thresholds").items():
        users = [row for row in rows if name in row.claim.thresholds]
        ids = {row.claim.id for row in users}
        changed = []
        for factor in FACTORS:
            scaled = [claim for claim in registered_claims(name, factor) if claim.id in ids]
            new = (
                row_of(claim, flights, plain(claim.measure()))
                if isinstance(claim, AnalysisClaim) and claim.measure
                else row_of(claim, flights, None)
                for claim in scaled
            )
            changed.append(sum(row.verdict is not before[row.claim.id].verdict for row in new))
        value = f"{table['value']:g} {table.get('unit', '')}".rstrip()
        found.append(Criterion(name, value, table["reason"], len(users), tuple(changed)))
    numbers = [row for row in rows if not isinstance(row.claim.published, bool)]
    digits = tuple(sum(_widened(row, f) for row in numbers) for f in FACTORS)
    bounded = [row for row in rows if _bounds(row) and row.statement.id not in _OWN]
    bounds = tuple(sum(_moved(row, flights, f) for row in bounded) for f in FACTORS)
    return [
        Criterion("digits", "half a unit", _DIGITS, len(numbers), digits),
        Criterion("bounds", "by row", _BOUNDS, len(bounded), bounds),
        *found,
    ]


def _widened(row: Row, factor: float) -> bool:
    """Whether the verdict changes with the tolerance of its numbers."""
    verdicts = [verdict_on(row.claim, cell.measured, factor) for cell in row.cells]
    return worst(verdicts) is not row.verdict


def _bounds(row: Row) -> tuple[float, float] | None:
    claim = row.claim
    return claim.expectation.holds if isinstance(claim, ExpectationClaim) else None


def _moved(row: Row, flights: Flights, factor: float) -> bool:
    """Whether the verdict changes if the bounds of a statement about a metric are scaled."""
    claim, bounds = row.claim, _bounds(row)
    assert isinstance(claim, ExpectationClaim)
    assert bounds is not None
    moved = tuple(bound * factor if isfinite(bound) else bound for bound in bounds)
    expectation = claim.expectation.model_copy(update={"holds": moved})
    scaled = replace(claim, expectation=expectation)
    records = [flights[claim.address, plant] for plant, _ in row.plants]
    values = [scaled.measure(r.metrics) for r in records if isinstance(r, FlightRecord)]
    return worst([verdict_on(scaled, value) for value in values]) is not row.verdict
