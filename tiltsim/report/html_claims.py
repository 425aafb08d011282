"""The statements and rows of a chapter on the page.

Every row is a ``details`` element: its summary is a line of a grid, its content what is needed to
check it. Without JavaScript everything can be opened and linked to; only the filter is missing.
"""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from itertools import groupby
from typing import Final

from tiltsim.report.claim import Claim, ClaimVerdict
from tiltsim.report.claim_rows import Cell, Row
from tiltsim.report.content import (
    CHAPTERS,
    Group,
    Report,
    criterion_text,
    flights_of,
    measured_text,
    published_text,
    test_of,
    why_of,
)
from tiltsim.report.drawing import Drawing
from tiltsim.report.flights import PLANTS
from tiltsim.report.html_text import CLASSES, anchor, mark, prose, tag, thumbnail

COLLAPSE: Final = 6
"""Rows of one statement with the same verdict from which they are collapsed."""

SHOWN_FLIGHTS: Final = 6
"""Flights of a row that are listed; of more, only the number is stated."""

_HEAD: Final = (
    '<div class="grid head" aria-hidden="true"><span>Case</span><span class="n">Published</span>'
    '<span class="n">Thesis plant</span><span class="n">MuJoCo</span><span>Verdict</span></div>'
)


def chapter_claims(report: Report, chapter: int) -> Iterator[str]:
    """The heading and the statements of a chapter."""
    title = escape(CHAPTERS.get(chapter, ""))
    yield f'<h2><span class="number">{chapter}</span>{title}</h2>{_HEAD}<div class="claims">'
    for group in report.chapter_groups(chapter):
        yield from _statement(group, report.drawings)
    yield "</div>"


def _statement(group: Group, drawings: list[Drawing]) -> Iterator[str]:
    statement = group.statement
    worst = max(row.verdict.rank for row in group.rows)
    yield f'<article class="claim" id="{statement.id}" data-rank="{worst}">'
    shown = [drawing for drawing in drawings if _shows(drawing, group)]
    if shown:
        yield f'<p class="thumbs">{"".join(map(thumbnail, shown))}</p>'
    yield f"<h3>{prose(statement.text)} {anchor(statement.id)}</h3>"
    yield f'<p class="thesis"><cite>{escape(group.sources)}</cite> {prose(statement.thesis)}</p>'
    yield f'<p class="criterion"><b>Criterion.</b> {prose(statement.criterion.rstrip("."))}.</p>'
    shared = f"Where not reproduced: {group.shared_why}" if group.shared_why else ""
    notes = filter(None, (statement.note, shared))
    yield from (f'<p class="note">{prose(note)}</p>' for note in notes)
    if statement.finding or any(row.claim.finding for row in group.rows):
        keys = dict.fromkeys(row.claim.settled_by for row in group.rows if row.claim.settled_by)
        links = ", ".join(f'<a href="#{key}">{key}</a>' for key in keys)
        yield f'<p class="note">Settled by the finding {links}.</p>'
    yield '<div class="rows">'
    ordered = sorted(group.rows, key=lambda row: -row.verdict.rank)
    for verdict, members in groupby(ordered, key=lambda row: row.verdict):
        yield from _alike(verdict, list(members), group)
    yield "</div></article>"


def _shows(drawing: Drawing, group: Group) -> bool:
    picture = drawing.picture
    if picture.name in group.statement.pictures:
        return True
    flown = {flight for row in group.rows for flight in flights_of(row.claim)}
    return len(picture.flights) == 1 and picture.flights[0][0] in flown


def _alike(verdict: ClaimVerdict, rows: list[Row], group: Group) -> Iterator[str]:
    """Rows with the same verdict, collapsed if they are many."""
    if len(rows) >= COLLAPSE:
        yield f'<details class="many"><summary>{len(rows)} cases: {mark(verdict)}</summary>'
    for row in rows:
        yield from _row(row, group)
    if len(rows) >= COLLAPSE:
        yield "</details>"


def _row(row: Row, group: Group) -> Iterator[str]:
    claim = row.claim
    own = "" if claim.id == claim.statement.id else f' id="{claim.id}"'
    label = prose(claim.case) or "all of it"
    link = anchor(claim.id) if own else ""
    origins = " ".join(origin.name.lower() for origin in row.origins)
    yield (
        f'<details class="row"{own} data-verdict="{CLASSES[row.verdict]}" '
        f'data-origins="{origins or "thesis"}"><summary class="grid">'
        f'<span class="what">{label} {link}</span>'
        f'<span class="n"><i>published</i> {_number(published_text(row), claim)}'
        f"{_tolerance(claim)}</span>{_measured(row)}"
        f'<span class="verdict">{mark(row.verdict)} {"".join(map(tag, row.origins))}</span>'
    )
    why = why_of(row) if not group.shared_why else ""
    if why:
        yield f'<span class="why">{prose(why)}</span>'
    yield '</summary><div class="more"><dl>'
    yield f"<dt>Id</dt><dd><code>{claim.id}</code></dd>"
    yield f"<dt>Place</dt><dd>{escape(claim.source)}</dd>"
    yield f"<dt>Criterion</dt><dd>{prose(criterion_text(claim))}</dd>"
    if claim.note:
        yield f"<dt>Note</dt><dd>{prose(claim.note)}</dd>"
    yield from _flights(claim)
    yield f"<dt>Test</dt><dd><pre>{escape(test_of(claim))}</pre></dd></dl></div></details>"


def _flights(claim: Claim) -> Iterator[str]:
    flights = flights_of(claim)
    if not flights:
        return
    files = dict.fromkeys(address.partition("#")[0] for address in flights)
    shown = "".join(f"<code>scenarios/{escape(file)}.toml</code> " for file in files)
    yield f"<dt>Scenario</dt><dd>{shown}</dd>"
    lines = [f"tiltsim run '{address}'" for address in flights[:SHOWN_FLIGHTS]]
    if len(flights) > SHOWN_FLIGHTS:
        lines.append(f"# and {len(flights) - SHOWN_FLIGHTS} more variants of it")
    lines.append("# other plant: --set simulation.plant=thesis")
    yield f"<dt>Fly it</dt><dd><pre>{escape(chr(10).join(lines))}</pre></dd>"


def _measured(row: Row) -> str:
    if row.analysis is not None:
        text = _number(measured_text(row.claim, row.analysis), row.claim)
        return f'<span class="n both"><i>computed</i> {text}</span>'
    return "".join(_plant(row, plant, row.cell(plant)) for plant in PLANTS)


def _plant(row: Row, plant: str, cell: Cell | None) -> str:
    name = "MuJoCo" if plant == "mujoco" else "thesis plant"
    if cell is None:
        return f'<span class="n"><i>{name}</i> –</span>'
    differs = len({one.verdict for one in row.cells}) > 1 and cell.verdict is row.verdict
    text = _number(measured_text(row.claim, cell), row.claim)
    return f'<span class="n{" off" if differs else ""}"><i>{name}</i> {text}</span>'


def _tolerance(claim: Claim) -> str:
    if isinstance(claim.published, bool):
        return ""
    tolerances = dict.fromkeys(f"{tolerance:g}" for _, tolerance in claim.numbers())
    return f" <small>± {', '.join(tolerances)}</small>"


def _number(text: str, claim: Claim) -> str:
    unit = claim.unit
    if unit and text.endswith(f" {unit}"):
        number = text.removesuffix(f" {unit}")
        return f'{escape(number)}&nbsp;<span class="unit">{escape(unit)}</span>'
    return escape(text)
