"""How many verdicts depend on the numbers of ours in criteria: each is halved and doubled."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Final

from tiltsim.report.claim import AnalysisClaim, ExpectationClaim, plain, verdict_on, worst
from tiltsim.report.claim_rows import Row, row_of
from tiltsim.report.claims import registered_claims, words
from tiltsim.report.flights import FlightRecord, Flights

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
