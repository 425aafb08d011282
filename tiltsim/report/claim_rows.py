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
    Claim,
    ClaimVerdict,
    Origin,
    Statement,
    Value,
    origins_of,
    verdict_on,
    worst,
)
from tiltsim.report.claims import registered_claims, scenario_claims, words
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
from tiltsim.scenario.scenario import Scenario

COMPUTED: Final = "computed"  # name of the cell of a row without flights


@dataclass(frozen=True)
class Cell:
    """The measured value of a claim on one plant, or by analysis, and its verdict."""

    measured: Value | None
    verdict: ClaimVerdict
    note: str = ""  # why there is no value, or when the flight terminated
    behind: float | None = None  # the metric behind a yes or no


@dataclass(frozen=True)
class Row:
    """A claim with a cell per plant, or the single cell `COMPUTED`."""

    claim: Claim
    cells: Mapping[str, Cell]
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
    def verdict(self) -> ClaimVerdict:
        """The worst verdict of the cells."""
        return worst([cell.verdict for cell in self.cells.values()])

    @property
    def splits(self) -> bool:
        """Whether the plants have different verdicts."""
        return len({cell.verdict for cell in self.cells.values()}) > 1


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
    computed = [claim for claim in registered_claims() if claim.measure and not claim.flights]
    missing = [claim for claim in computed if claim.id not in values]
    if missing:
        progress(0, len(missing))
        for done, claim in enumerate(missing, start=1):
            value = claim.measured()
            assert value is not None
            values[claim.id] = value
            progress(done, len(missing))
        folder.mkdir(parents=True, exist_ok=True)
        store(path, json.dumps(values, indent=1).encode())
    return values


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
    rows: dict[str, Row] = {}
    own = [claim for entry in entries for claim in scenario_claims(entry.scenario)]
    for claim in (*own, *registered_claims()):
        known = all((address, plant) in flights for address in claim.flights for plant in PLANTS)
        if not (whole or (claim.flights and known)):
            continue
        row = row_of(claim, flights, values.get(claim.id))
        if row.cells and (first := rows.get(claim.id)):  # of another plant
            first = replace(first, claim=replace(first.claim, why=first.claim.why or claim.why))
            row = replace(first, cells={**first.cells, **row.cells})
        if row.cells:
            rows[claim.id] = row
    ours = {entry.address: origins_of(entry.scenario.ours) for entry in entries}
    return [
        replace(row, origins=_origins(row.claim, ours))
        for row in sorted(rows.values(), key=lambda row: row.claim.chapter)
    ]


def _origins(claim: Claim, ours: Mapping[str, tuple[Origin, ...]]) -> tuple[Origin, ...]:
    flown = (origin for address in claim.flights for origin in ours.get(address, ()))
    found = {*claim.statement.origins, *claim.origins, *flown}
    return tuple(origin for origin in Origin if origin in found)


def row_of(claim: Claim, flights: Flights, computed: Value | None = None) -> Row:
    """The row of a claim from the records of its flights, or the measured value of a computed one.

    A plant that does not support one of the flights has no cell.
    """
    if not claim.flights:
        return Row(claim, {COMPUTED: Cell(computed, verdict_on(claim, computed))})
    cells: dict[str, Cell] = {}
    bound = claim.expectation
    for plant in PLANTS:
        records = [flights[address, plant] for address in claim.flights]
        flown = [record for record in records if isinstance(record, FlightRecord)]
        if len(flown) < len(records) or (bound and bound.plant not in {None, plant}):
            continue
        value = claim.measured([record.metrics for record in flown])
        early = [record for record in flown if record.ended_early]
        behind, note = None, "terminated" if early else ""
        if bound is not None:
            note = f"terminated at {_time(early[0])} s" if early else ""
            metric = flown[0].metrics.get(bound.metric)
            behind = metric if isinstance(value, bool) and not isinstance(metric, bool) else None
        cells[plant] = Cell(value, verdict_on(claim, value), note, behind)
    return Row(claim, cells)


def _time(record: FlightRecord) -> str:
    return f"{record.end_time:#.3g}".rstrip(".")


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
                row_of(claim, flights, None if claim.flights else claim.measured())
                for claim in scaled
            )
            changed.append(sum(row.verdict is not before[row.claim.id].verdict for row in new))
        value = f"{table['value']:g} {table.get('unit', '')}".rstrip()
        found.append(Criterion(name, value, table["reason"], len(users), tuple(changed)))
    numbers = [row for row in rows if not isinstance(row.claim.published, bool)]
    digits = tuple(sum(_widened(row, f) for row in numbers) for f in FACTORS)
    bounded = [
        row
        for row in rows
        if (bound := row.claim.expectation) and bound.holds and row.statement.id not in _OWN
    ]
    bounds = tuple(sum(_moved(row, flights, f) for row in bounded) for f in FACTORS)
    return [
        Criterion("digits", "half a unit", _DIGITS, len(numbers), digits),
        Criterion("bounds", "by row", _BOUNDS, len(bounded), bounds),
        *found,
    ]


def _widened(row: Row, factor: float) -> bool:
    """Whether the verdict changes with the tolerance of its numbers."""
    cells = row.cells.values()
    verdicts = [verdict_on(row.claim, cell.measured, factor) for cell in cells]
    return worst(verdicts) is not row.verdict


def _moved(row: Row, flights: Flights, factor: float) -> bool:
    """Whether the verdict changes if the bounds of a statement about a metric are scaled."""
    assert row.claim.expectation is not None
    bounds = row.claim.expectation.holds or ()
    moved = tuple(bound * factor if isfinite(bound) else bound for bound in bounds)
    expectation = row.claim.expectation.model_copy(update={"holds": moved})
    return row_of(replace(row.claim, expectation=expectation), flights).verdict is not row.verdict
