"""The report as one self-contained HTML page, with style and figures inside."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Final

from tiltsim.report import comparisons
from tiltsim.report.claim import ClaimVerdict
from tiltsim.report.claim_rows import Cell, Row, count
from tiltsim.report.content import (
    CHAPTERS,
    MEANINGS,
    METHOD,
    SUBJECT,
    TITLE,
    Group,
    Report,
    failure_text,
    flown_text,
    measured_text,
    published_text,
    why_of,
)
from tiltsim.report.drawing import DPI, Drawing
from tiltsim.report.findings import Finding
from tiltsim.report.flights import PLANTS
from tiltsim.system.text import printable_html as escape

_CLASSES: Final = {
    ClaimVerdict.REPRODUCED: "reproduced",
    ClaimVerdict.QUALITATIVE: "qualitative",
    ClaimVerdict.FITTED: "fitted",
    ClaimVerdict.NOT_REPRODUCED: "not-reproduced",
    ClaimVerdict.WRONG: "wrong",
}

_SHOWN_DPI: Final = 108


def page(report: Report) -> str:
    """The whole page."""
    style = (Path(__file__).parent / "html_page.css").read_text(encoding="utf-8")
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>tiltsim: {escape(TITLE.lower())}</title>",
            f"<style>\n{style}</style>",
            "</head>",
            "<body>",
            *_header(report),
            "<main>",
            *_summary(report),
            *_alarm(report),
            *_findings(report.findings),
            *(line for chapter in report.chapters for line in _chapter(report, chapter)),
            *_beyond(report.comparisons),
            "</main>",
            f"<footer>tiltsim {version('tiltsim')}, MuJoCo {version('mujoco')}. "
            f"{escape(flown_text(report))}.</footer>",
            "</body>",
            "</html>",
            "",
        ]
    )


def _header(report: Report) -> Iterator[str]:
    yield "<header>"
    yield f"<h1>{escape(TITLE)}</h1>"
    yield f'<p class="lead">{escape(SUBJECT)}</p>'
    yield '<nav aria-label="Contents"><ol>'
    yield '<li><a href="#summary">Summary</a></li>'
    if report.findings:
        yield '<li><a href="#findings">Our findings</a></li>'
    for chapter in report.chapters:
        title = f"{chapter} {CHAPTERS.get(chapter, '')}"
        yield f'<li><a href="#chapter-{chapter}">{escape(title)}</a></li>'
    if report.comparisons:
        yield f'<li><a href="#beyond">{escape(comparisons.TITLE)}</a></li>'
    yield "</ol></nav>"
    yield "</header>"


def _summary(report: Report) -> Iterator[str]:
    counts = count(report.rows)
    total = len(report.rows)
    yield '<section id="summary"><h2>Summary</h2>'
    reproduced = counts[ClaimVerdict.REPRODUCED]
    yield (
        f"<p>{total} claims, {flown_text(report)}: {reproduced} reproduced, "
        f"{counts[ClaimVerdict.QUALITATIVE]} reproduced qualitatively, "
        f"{counts[ClaimVerdict.NOT_REPRODUCED]} not reproduced, "
        f"{counts[ClaimVerdict.WRONG]} published claims wrong.</p>"
    )
    yield f'<div class="bar" role="img" aria-label="{reproduced} of {total} claims reproduced">'
    for verdict in ClaimVerdict:
        if counts[verdict]:
            yield f'<i class="{_CLASSES[verdict]}" style="flex:{counts[verdict]}"></i>'
    yield '</div><ul class="key">'
    for verdict, meaning in MEANINGS.items():
        yield f'<li>{_mark(verdict)} <span class="meaning">{escape(meaning)}</span></li>'
    yield "</ul>"
    yield from (f"<p>{escape(paragraph)}</p>" for paragraph in METHOD)
    yield '<div class="scroll summary" tabindex="0"><table><thead><tr><th>Chapter</th>'
    yield "".join(f'<th class="n">{escape(verdict.value)}</th>' for verdict in ClaimVerdict)
    yield '<th class="n">claims</th></tr></thead><tbody>'
    for chapter in report.chapters:
        rows = [row for row in report.rows if row.claim.chapter == chapter]
        link = f'<a href="#chapter-{chapter}">{escape(CHAPTERS.get(chapter, ""))}</a>'
        yield _counts(f"{chapter}&ensp;{link}", rows)
    yield '</tbody><tbody class="total">' + _counts("All", report.rows)
    yield "</tbody></table></div></section>"


def _counts(name: str, rows: list[Row]) -> str:
    counts = count(rows)
    cells = [str(counts[verdict] or "") for verdict in ClaimVerdict]
    numbers = "".join(f'<td class="n">{cell}</td>' for cell in [*cells, str(len(rows))])
    return f"<tr><th>{name}</th>{numbers}</tr>"


def _alarm(report: Report) -> Iterator[str]:
    if not report.failures:
        return
    yield '<section class="alarm"><h3>Bounds that do not hold</h3><ul>'
    yield from (f"<li>{escape(failure_text(failure))}</li>" for failure in report.failures)
    yield "</ul></section>"


def _findings(findings: Iterable[Finding]) -> Iterator[str]:
    findings = list(findings)
    if not findings:
        return
    yield '<section id="findings"><h2>Our findings</h2>'
    yield "<p>Tests support each result; the command runs them in a checkout.</p>"
    for finding in findings:
        yield f'<article id="{finding.key}"><h3>{escape(finding.title)}</h3>'
        yield f'<p class="where">{escape(finding.chapters)}</p>'
        yield from (f"<p>{_prose(paragraph)}</p>" for paragraph in finding.paragraphs)
        tests = f"{len(finding.nodes)} tests" if len(finding.nodes) > 1 else "1 test"
        yield f"<details><summary>{tests}</summary><pre>{escape(finding.command)}</pre></details>"
        yield "</article>"
    yield "</section>"


def _chapter(report: Report, chapter: int) -> Iterator[str]:
    title = escape(CHAPTERS.get(chapter, ""))
    yield f'<section id="chapter-{chapter}">'
    yield f'<h2><span class="number">{chapter}</span>{title}</h2>'
    yield '<div class="scroll" tabindex="0"><table class="claims"><thead><tr><th>Claim</th>'
    yield '<th class="n">Published</th><th class="n">Thesis plant</th><th class="n">MuJoCo</th>'
    yield "<th>Verdict</th></tr></thead>"
    for group in report.chapter_groups(chapter):
        yield from _group(group)
    yield "</table></div>"
    drawings = [d for d in report.drawings if d.picture.chapter == chapter]
    if drawings:
        yield '<div class="figures">'
        yield from map(_figure, drawings)
        yield "</div>"
    yield "</section>"


def _beyond(rows: list[comparisons.Comparison]) -> Iterator[str]:
    if not rows:
        return
    yield f'<section id="beyond"><h2>{escape(comparisons.TITLE)}</h2>'
    yield f"<p>{_prose(comparisons.EXPLANATION)}</p>"
    yield '<div class="scroll" tabindex="0"><table class="claims"><thead><tr><th>Flight</th>'
    yield '<th>Quantity</th><th class="n">Thesis plant</th><th class="n">MuJoCo</th></tr></thead>'
    for file, members in comparisons.families(rows):
        yield (
            f'<tbody><tr class="group"><th colspan="4" scope="rowgroup"><div>{escape(file)} '
            f'<span class="section">{escape(members[0].source)}</span></div></th></tr>'
        )
        for _, metrics in groupby(members, lambda one: one.address):
            yield from _compared(list(metrics))
        yield "</tbody>"
    yield "</table></div></section>"


def _compared(metrics: list[comparisons.Comparison]) -> Iterator[str]:
    """The rows of one flight, with its title in the first."""
    one = metrics[0]
    title = _prose(one.title)
    if one.without:
        title += f' <span class="section">compared with {escape(one.without)}</span>'
    head = f'<th class="what" scope="rowgroup" rowspan="{len(metrics)}">{title}</th>'
    for metric in metrics:
        cells = "".join(
            f'<td class="n">{escape(metric.plants.get(plant, "–"))}</td>' for plant in PLANTS
        )
        yield f'<tr class="case">{head}<td>{escape(comparisons.quantity(metric))}</td>{cells}</tr>'
        head = ""


def _group(group: Group) -> Iterator[str]:
    single = len(group.rows) == 1
    yield "<tbody>"
    if not single:
        why = f'<span class="why">{_prose(group.shared_why)}</span>' if group.shared_why else ""
        text = _prose(group.statement.text)
        yield (
            f'<tr class="group"><th colspan="5" scope="rowgroup"><div>{text} '
            f'<span class="section">{escape(group.sources)}</span>{why}</div></th></tr>'
        )
    for row in group.rows:
        head = _prose(row.claim.case)
        if single:
            section = f'<span class="section">{escape(row.claim.section)}</span>'
            head = f"{_prose(group.statement.text)} {section}"
        why = why_of(row) if not group.shared_why else ""
        note = f'<span class="why">{_prose(why)}</span>' if why else ""
        kind = "" if single else ' class="case"'
        yield (
            f'<tr{kind}><th class="what" scope="row">{head}</th>'
            f'<td class="n">{_number(published_text(row), row)}</td>{_measured(row)}'
            f'<td class="verdict">{_mark(row.verdict)}{note}</td></tr>'
        )
    yield "</tbody>"


def _measured(row: Row) -> str:
    if row.analysis is not None:
        text = _number(measured_text(row.claim, row.analysis), row)
        return f'<td class="n" colspan="2">{text} <span class="unit">(computed)</span></td>'
    return "".join(_plant(row, row.cell(plant)) for plant in PLANTS)


def _plant(row: Row, cell: Cell | None) -> str:
    if cell is None:
        return '<td class="n unit">–</td>'
    differs = len({one.verdict for one in row.cells}) > 1 and cell.verdict is row.verdict
    text = _number(measured_text(row.claim, cell), row)
    return f'<td class="n{" off" if differs else ""}">{text}</td>'


def _number(text: str, row: Row) -> str:
    unit = row.claim.unit
    if unit and text.endswith(f" {unit}"):
        number = text.removesuffix(f" {unit}")
        return f'{escape(number)}&nbsp;<span class="unit">{escape(unit)}</span>'
    return escape(text)


def _figure(drawing: Drawing) -> str:
    picture = drawing.picture
    data = b64encode(drawing.png).decode()
    # Drawn at a higher resolution than shown, for high-density screens and print.
    pixels = (int.from_bytes(drawing.png[i : i + 4], "big") for i in (16, 20))
    width, height = (round(size * _SHOWN_DPI / DPI) for size in pixels)
    return (
        f'<figure id="figure-{picture.name}"><img alt="{escape(picture.caption)}" '
        f'width="{width}" height="{height}" '
        f'src="data:image/png;base64,{data}"><figcaption>{_prose(picture.caption)}'
        "</figcaption></figure>"
    )


def _mark(verdict: ClaimVerdict) -> str:
    return f'<span class="mark {_CLASSES[verdict]}">{escape(verdict.value)}</span>'


def _prose(text: str) -> str:
    """Text with `code` between backticks."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))
