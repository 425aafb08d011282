"""The rows of the report: every claim with what was measured and how it is judged."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tiltsim.flight.verdicts import Verdict, judge
from tiltsim.report.claims import registered_claims
from tiltsim.report.flying import PLANTS, Flights, Plan, Plant, Record
from tiltsim.report.model import (
    Claim,
    ExpectationClaim,
    FlightClaim,
    Outcome,
    Value,
    judge_value,
    plain,
    scenario_claims,
    worst,
)
from tiltsim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


@dataclass(frozen=True)
class Cell:
    """What one plant, or the analysis, has to say on a claim."""

    measured: Value | None
    outcome: Outcome
    note: str = ""  # why there is no value, or how a lost flight ended


@dataclass(frozen=True)
class Row:
    """A claim with a cell for each plant, or the one cell of an analysis."""

    claim: Claim
    analysis: Cell | None = None
    plants: tuple[tuple[Plant, Cell], ...] = ()

    @property
    def cells(self) -> list[Cell]:
        """All cells that say something."""
        return [self.analysis] if self.analysis else [cell for _, cell in self.plants]

    @property
    def outcome(self) -> Outcome:
        """The least favourable verdict among the cells."""
        return worst([cell.outcome for cell in self.cells])

    def cell(self, plant: Plant) -> Cell | None:
        """The cell of a plant, None where it says nothing."""
        return dict(self.plants).get(plant)


@dataclass(frozen=True)
class Failure:
    """A bound of a scenario that does not hold."""

    address: str
    plant: Plant
    verdict: Verdict


def make_rows(
    plans: list[Plan], flights: Flights, values: Mapping[str, Value], *, whole: bool
) -> list[Row]:
    """All claims that can be judged, in the order of the text.

    Parameters
    ----------
    plans
        The scenarios that were flown, in order.
    flights
        What came of them.
    values
        What the analysis measured, by `AnalysisClaim.key`; not read unless ``whole``.
    whole
        Whether the library was flown as a whole: else the claims that are computed are left out,
        and those about several flights where one of these is missing.
    """
    rows = _expectation_rows(plans, flights)
    for claim in registered_claims():
        if isinstance(claim, FlightClaim):
            if whole or all((address, "mujoco") in flights for address in claim.flights):
                rows.append(_flight_row(claim, flights))
        elif whole:
            value = values[claim.key]
            rows.append(Row(claim, analysis=Cell(value, judge_value(claim, value))))
    return sorted((row for row in rows if row.cells), key=lambda row: row.claim.chapter)


def _expectation_rows(plans: list[Plan], flights: Flights) -> list[Row]:
    rows: dict[tuple[str, str, str], Row] = {}
    for plan in plans:
        for claim in scenario_claims(plan.scenario):
            for plant in PLANTS:
                record = flights[plan.address, plant]
                if claim.expectation.plant in {None, plant} and isinstance(record, Record):
                    row = rows.get(claim.key, Row(claim))
                    cell = _expectation_cell(claim, record)
                    if claim.why and not row.claim.why:
                        row = replace(row, claim=replace(row.claim, why=claim.why))
                    rows[claim.key] = replace(row, plants=(*row.plants, (plant, cell)))
    return list(rows.values())


def _expectation_cell(claim: ExpectationClaim, record: Record) -> Cell:
    measured = claim.measure(record.metrics)
    return Cell(measured, judge_value(claim, measured), _ending(record))


def _ending(record: Record) -> str:
    return f"lost at {f'{record.end_time:#.3g}'.rstrip('.')} s" if record.lost else ""


def _flight_row(claim: FlightClaim, flights: Flights) -> Row:
    cells: list[tuple[Plant, Cell]] = []
    for plant in PLANTS:
        records = [flights[address, plant] for address in claim.flights]
        flown = [record for record in records if isinstance(record, Record)]
        if len(flown) < len(records):
            continue
        metrics = {record.address: record.metrics for record in flown}
        lost = any(record.lost for record in flown)
        try:
            value: Value | None = plain(claim.measure(metrics))
        except KeyError:  # a lost flight has no final values
            value = None
        note = "lost" if value is None and lost else ""
        cells.append((plant, Cell(value, judge_value(claim, value), note)))
    return Row(claim, plants=tuple(cells))


def failures(plans: list[Plan], flights: Flights) -> list[Failure]:
    """The bounds that do not hold, on either plant."""
    return [
        Failure(plan.address, plant, verdict)
        for plan in plans
        for plant, scenario in plan.plants.items()
        if isinstance(scenario, Scenario)
        and isinstance(record := flights[plan.address, plant], Record)
        for verdict in judge(scenario, record.metrics)
        if not verdict.holds
    ]


def count(rows: Iterable[Row]) -> Counter[Outcome]:
    """How many rows have each verdict."""
    return Counter(row.outcome for row in rows)
