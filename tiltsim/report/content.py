"""The content of the report as text, shared by page and summary."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import groupby
from math import floor, inf, isfinite, log10
from typing import Final

from tiltsim.report.claim import Claim, ClaimVerdict, Origin, Statement
from tiltsim.report.claim_rows import Cell, Criterion, Failure, Row, count, count_statements, errors
from tiltsim.report.findings import ERRORS, FINDINGS, Finding, PublishedError
from tiltsim.report.flights import Comparison, Flights, ReportEntry
from tiltsim.report.pictures import Drawing, Picture
from tiltsim.scenario.metric_names import metric_of
from tiltsim.scenario.scenario import Scenario

TITLE: Final = "Reproduction report"
SUBJECT: Final = (
    "The results that the doctoral thesis “Advanced Feedback Linearization Control for Tiltrotor "
    "UAVs: Gait Plan, Controller Design, and Stability Analysis” by Zhe Shen (The University of "
    "Tokyo, 2023) states with a number or a yes/no answer, compared with the results of tiltsim."
)
PROVENANCE: Final = (
    "We worked from a conversion of the thesis into text, without its figures: paths, curves and "
    "values that only a figure shows are not known here. Dots above symbols, brackets and indices "
    "may be errors of that conversion; before citing a misprint, compare the article. The author "
    "has not been asked to comment."
)
CHAPTERS: Final = {
    1: "Hovering in a gust",
    2: "Yaw-position control of the quadrotor",
    3: "Fixed gaits and the decoupling matrix",
    4: "Tracking with the trot",
    5: "Cat-inspired gaits",
    6: "The Two Color Map",
    7: "Tracking with robust gaits",
    8: "The generalized map",
    9: "Rotor limits",
    10: "State drift of a tilt-car",
    11: "Saturation of a tilt-car",
    12: "The map of another vehicle",
    13: "Outlook",
}
METHOD: Final = (
    "Every scenario is simulated on two plants with the same controller. The thesis plant "
    "integrates the printed equations, which have no gyroscopic torque, with a fixed-step "
    "third-order method. MuJoCo integrates a multibody model with a fourth-order method. Claims "
    "that need no flight are computed. A row gets the worse of its two verdicts. Flights of ch. 3 "
    "to 9 use the decoupling matrix as printed, except that K_f, printed twice, is counted once.",
    "A number is reproduced if it rounds to the printed digits, unless the row states another "
    "tolerance. All values and verdicts are computed from the scenario library and cached only "
    "until a source or a version changes.",
)

_TESTS: Final = "tests/report/test_claims.py"
_COMPUTED: Final = "test_computed_claims_have_verdicts_and_reasons"
_FLOWN: Final = "test_a_comparison_of_flights_can_come_out_either_way"


@dataclass(frozen=True)
class Report:
    """Everything that a page or summary shows."""

    entries: list[ReportEntry]
    flights: Flights
    rows: list[Row]
    failures: list[Failure]
    drawings: list[Drawing]
    comparisons: list[Comparison]
    findings: tuple[Finding, ...] = FINDINGS
    criteria: Sequence[Criterion] = ()

    @property
    def errors(self) -> list[tuple[PublishedError, list[Row]]]:
        """The entries of the list of errors that rows name, with these rows."""
        named = errors(self.rows)
        return [
            (entry, [row for row in self.rows if row.claim.error == key])
            for key, entry in ERRORS.items()
            if key in named
        ]

    @property
    def chapters(self) -> list[int]:
        """Chapters with rows, in order."""
        return sorted({row.claim.chapter for row in self.rows})

    def of_chapter(self, chapter: int) -> list[Row]:
        """The rows of a chapter."""
        return [row for row in self.rows if row.claim.chapter == chapter]

    def chapter_groups(self, chapter: int) -> list[Group]:
        """The rows of a chapter grouped by statement, section by section."""
        rows = self.of_chapter(chapter)
        order = list(dict.fromkeys(row.statement.id for row in rows))
        places = {row.statement.id: row.statement.place for row in reversed(rows)}
        rows.sort(key=lambda row: (places[row.statement.id], order.index(row.statement.id)))
        return [Group(list(group)) for _, group in groupby(rows, lambda row: row.statement.id)]

    def failing_groups(self, chapter: int) -> list[Group]:
        """The groups of a chapter without the rows that are reproduced."""
        groups = [group.without(ClaimVerdict.REPRODUCED) for group in self.chapter_groups(chapter)]
        return [group for group in groups if group.rows]

    def drawings_of(self, finding: Finding) -> list[Drawing]:
        """The pictures that show a finding."""
        return [drawing for drawing in self.drawings if drawing.picture.name in finding.pictures]

    def errors_of(self, finding: Finding) -> set[str]:
        """Keys of the list of errors that rows settled by a finding name."""
        rows = (row for row in self.rows if row.claim.settled_by == finding.key)
        return {row.claim.error for row in rows if row.claim.error}

    def settled_by(self, finding: Finding) -> list[str]:
        """Ids of the statements of which a finding settles a row."""
        rows = (row for row in self.rows if row.claim.settled_by == finding.key)
        return list(dict.fromkeys(row.statement.id for row in rows))


@dataclass(frozen=True)
class Group:
    """Claims that share a statement."""

    rows: list[Row]

    @property
    def statement(self) -> Statement:
        """The statement that all rows are cases of."""
        return self.rows[0].statement

    @property
    def rank(self) -> int:
        """Rank of the worst verdict."""
        return max(row.verdict.rank for row in self.rows)

    @property
    def by_verdict(self) -> list[tuple[ClaimVerdict, list[Row]]]:
        """The rows with each verdict, the worst first."""
        ordered = sorted(self.rows, key=lambda row: -row.verdict.rank)
        return [(kind, list(rows)) for kind, rows in groupby(ordered, lambda row: row.verdict)]

    @property
    def settled_by(self) -> list[str]:
        """Keys of the findings that settle rows."""
        keys = (row.claim.settled_by for row in self.rows)
        return list(dict.fromkeys(filter(None, keys)))

    @property
    def described(self) -> str:
        """Statement, notes and shared reason in one cell of Markdown."""
        statement = self.statement
        place = "; ".join(filter(None, (self.sources, f"`{statement.id}`")))
        listed = any(row.claim.error for row in self.rows)
        notes = (statement.note, "" if listed else self.shared_why)
        return "\n".join(filter(None, (f"**{statement.text}** ({place})", *notes)))

    @property
    def many_fits(self) -> int:
        """The number of rows consistent with a fit, from three on."""
        fits = sum(row.verdict is ClaimVerdict.FITTED for row in self.rows)
        return fits if fits >= 3 else 0

    @property
    def only_fits(self) -> bool:
        """Whether all rows, from three on, are consistent with a fit."""
        return self.many_fits == len(self.rows)

    def without(self, verdict: ClaimVerdict) -> Group:
        """The group without the rows of this verdict."""
        return Group([row for row in self.rows if row.verdict is not verdict])

    def shown(self, drawings: list[Drawing]) -> list[Drawing]:
        """The pictures that the statement names, and the pictures of a flight of its rows."""
        flown = {flight for row in self.rows for flight in row.claim.flights}

        def shows(picture: Picture) -> bool:
            alone = len(picture.flights) == 1 and picture.flights[0][0] in flown
            return alone or picture.name in self.statement.pictures

        return [drawing for drawing in drawings if shows(drawing.picture)]

    @property
    def sources(self) -> str:
        """Sections and figures of the claims, without the chapter and the labels of cases."""
        panels = (re.sub(r" \([A-Z]\d*\)$", "", row.claim.section) for row in self.rows)
        texts, last = [], ""
        for place in dict.fromkeys(panels):
            section, comma, rest = place.partition(", ")
            texts.append(rest if comma and section == last else place)
            last = section
        return "; ".join(texts)

    @property
    def shared_why(self) -> str:
        """The reason, if several rows that fail have the same one."""
        reasons = [reason for row in self.rows if (reason := why_of(row))]
        return reasons[0] if len(reasons) > 1 and len(set(reasons)) == 1 else ""


def why_of(row: Row) -> str:
    """The reason of a row that is not reproduced."""
    return (
        ""
        if row.verdict is ClaimVerdict.REPRODUCED
        else row.claim.why or row.claim.missing or row.statement.missing
    )


def test_of(claim: Claim) -> str:
    """The commands that check a row, in a checkout."""
    test = _FLOWN if claim.flights else _COMPUTED
    first = f"pytest -n 0 '{_TESTS}::{test}[{claim.id}]'"
    if claim.expectation is not None:
        first = f"tiltsim check '{claim.flights[0]}'"
    return "\n".join([first, *(f"pytest -n 0 tests/{test}" for test in claim.statement.tests)])


def criterion_text(claim: Claim) -> str:
    """The condition under which the row would fail, in words, with its tolerance or range."""
    if not claim.statement.criterion:
        return ""
    parts, bound = [claim.statement.criterion.rstrip(".")], claim.expectation
    if not isinstance(claim.published, bool):
        tolerances = claim.tolerances.replace(", ", " and ")
        parts.append(f"tolerance {tolerances} {claim.unit}".rstrip())
    elif bound is not None and bound.equals is None:
        low, high = bound.holds or (bound.min, bound.max)
        parts.append(_range_text(metric_of(bound.metric).described, low, high, claim.unit))
    if claim.in_kind is not None:
        parts.append("qualitatively: " + _range_text("value", *claim.in_kind, claim.unit))
    return "; ".join(parts) + "."


def _range_text(name: str, low: float | None, high: float | None, unit: str) -> str:
    low = None if low == -inf else low
    high = None if high == inf else high
    if low is None:
        text = f"at most {high:g}"
    else:
        text = f"at least {low:g}" if high is None else f"from {low:g} to {high:g}"
    return f"{name.removesuffix(f', {unit}')} {text} {unit}".rstrip()


def published_text(row: Row) -> str:
    """The published value: yes, no, or the number with its printed digits.

    The value that its statement implies where the thesis flew nothing.
    """
    claim = row.claim
    value = claim.published
    if isinstance(value, bool):
        implied = "implied: " if Origin.FLIGHT in row.origins else ""
        return implied + _yes_or_no(value, claim)
    several = value if isinstance(value, tuple) else (value,)
    shown = [one if isinstance(one, str) else f"{one:g}" for one in several]
    text = _sign(shown[0]) if len(shown) == 1 else f"({', '.join(map(_sign, shown))})"
    return f"{text} {claim.unit}".rstrip()


def measured_text(claim: Claim, cell: Cell) -> str:
    """The measured value, with one digit more than the published one, or why there is none."""
    value = cell.measured
    if value is None:
        return cell.note or "no value"
    if isinstance(value, bool):
        text = _yes_or_no(value, claim)
        if cell.behind is not None:
            return f"{text} ({_sign(f'{cell.behind:.4g}')} {claim.unit}".rstrip() + ")"
        return cell.note if cell.note and text == "terminated" else text
    numbers = value if isinstance(value, tuple) else (value,)
    shown = [_measured_number(one, claim) for one in numbers]
    text = shown[0] if len(shown) == 1 else f"({', '.join(shown)})"
    return f"{text} {claim.unit}".rstrip()


def _yes_or_no(value: bool, claim: Claim) -> str:
    if claim.expectation is not None and claim.expectation.metric == "diverged":
        return "terminated" if value else "completed"
    return "yes" if value else "no"


def _measured_number(value: float, claim: Claim) -> str:
    if not isfinite(value):
        return str(value)
    if isinstance(claim.published, bool):
        return _sign(f"{value:.4g}")
    if not claim.unit and value == int(value) and _decimals(claim) == 0:
        return _sign(f"{value:.0f}")  # a count
    finest = floor(-log10(_tolerance(claim)) + 1e-9)
    decimals = max(max(_decimals(claim), finest) + 1, 0)
    text = f"{value:.{decimals}f}"
    if len(text) > 12:
        text = f"{value:.4g}"
    return _sign(text)


def _decimals(claim: Claim) -> int:
    published = claim.published if isinstance(claim.published, tuple) else (claim.published,)
    texts = [one if isinstance(one, str) else f"{one:g}" for one in published]
    return max(-int(Decimal(text).as_tuple().exponent) for text in texts)


def _tolerance(claim: Claim) -> float:
    return max(min(tolerance for _, tolerance in claim.numbers()), 1e-12)


def _sign(text: str) -> str:
    """A number with a typographic minus sign, without one before zero."""
    bare = text.lstrip("-")
    negative = text.startswith("-") and float(text) != 0.0
    return f"−{bare}" if negative else bare


def failure_text(failure: Failure) -> str:
    """One line about a bound that does not hold."""
    verdict = failure.verdict
    measured = verdict.measured
    shown = "no value" if measured is None else f"{measured:.6g}"
    if isinstance(measured, bool):
        shown = str(measured).lower()
    return (
        f"{failure.address} on the {failure.plant} plant: {verdict.expectation.metric} = {shown}, "
        f"expected {verdict.bounds}"
    )


def lead_text(rows: list[Row]) -> str:
    """The first sentences of the summary, without verdicts that no row has."""
    counts, statements = count(rows), count_statements(rows)
    alone = sum(row.on_the_thesis_alone for row in rows)
    flown = sum(bool(row.claim.flights) for row in rows)
    share = f", {alone} of them with no number of ours in setting or criterion" if alone else ""
    wrong = counts[ClaimVerdict.REFUTED] + counts[ClaimVerdict.MISPRINT]
    found = {
        f"rows are reproduced{share}.": counts[ClaimVerdict.REPRODUCED],
        "are reproduced qualitatively.": counts[ClaimVerdict.QUALITATIVE],
        "are consistent with a fit, which is no evidence.": counts[ClaimVerdict.FITTED],
        "are not reproduced.": counts[ClaimVerdict.NOT_REPRODUCED],
        "are not testable, as the text leaves something open.": counts[ClaimVerdict.NOT_TESTABLE],
        "are one rounding artifact: true of the printed digits of the blue angles and of P, not of "
        "the exact ones.": counts[ClaimVerdict.ROUNDING],
        f"rows are refuted or misprints; they trace back to {len(errors(rows))} errors.": wrong,
    }
    how = f"{flown} of them flown, the others computed" if flown < len(rows) else "all flown"
    lead = f"{statements.total()} statements in {len(rows)} rows, {how}."
    return " ".join([lead, *(f"{number} {text}" for text, number in found.items() if number)])


def flown_text(report: Report) -> str:
    """The number of simulated scenarios, as text."""
    both = sum(
        all(isinstance(scenario, Scenario) for scenario in entry.plants.values())
        for entry in report.entries
    )
    text = f"{len(report.entries)} scenarios, {both} of them on both plants"
    return text if both < len(report.entries) else f"{both} scenarios, each on both plants"
