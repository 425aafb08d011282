"""The report as one self-contained HTML page, with style, script and figures inside."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Final

from tiltsim.report import comparisons
from tiltsim.report.content import TITLE, Report, failure_text
from tiltsim.report.drawing import DPI, Drawing
from tiltsim.report.findings import Finding
from tiltsim.report.flights import PLANTS
from tiltsim.report.html_claims import chapter_claims
from tiltsim.report.html_summary import citation, controls, header, summary
from tiltsim.report.html_text import anchor, png_data, prose, thumbnail, thumbnail_styles
from tiltsim.report.made import Made

_SHOWN_DPI: Final = 108


def page(report: Report, made: Made) -> str:
    """The whole page."""
    beside = Path(__file__).parent
    style = (beside / "html_page.css").read_text(encoding="utf-8")
    script = (beside / "html_page.js").read_text(encoding="utf-8")
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>tiltsim: {escape(TITLE.lower())}</title>",
            f"<style>\n{style}{thumbnail_styles(report.drawings)}\n</style>",
            "</head>",
            "<body>",
            *header(report, made),
            "<main>",
            *summary(report),
            *_alarm(report),
            *_findings(report),
            *controls(report),
            *(line for chapter in report.chapters for line in _chapter(report, chapter)),
            *_beyond(report.comparisons),
            *citation(made),
            "</main>",
            f"<footer>{escape(made.sentence)}</footer>",
            f"<script>\n{script}</script>",
            "</body>",
            "</html>",
            "",
        ]
    )


def _alarm(report: Report) -> Iterator[str]:
    if not report.failures:
        return
    yield '<section class="alarm"><h3>Bounds that do not hold</h3><ul>'
    yield from (f"<li>{escape(failure_text(failure))}</li>" for failure in report.failures)
    yield "</ul></section>"


def _findings(report: Report) -> Iterator[str]:
    if not report.findings:
        return
    yield '<section id="findings"><h2>Our findings</h2>'
    yield "<p>Tests support each result; the command runs them in a checkout.</p>"
    for finding in report.findings:
        yield from _finding(finding, report)
    yield "</section>"


def _finding(finding: Finding, report: Report) -> Iterator[str]:
    yield f'<article class="finding" id="{finding.key}">'
    shown = [d for d in report.drawings if d.picture.name in finding.pictures]
    if shown:
        yield f'<p class="thumbs">{"".join(map(thumbnail, shown))}</p>'
    yield f"<h3>{escape(finding.title)} {anchor(finding.key)}</h3>"
    yield f'<p class="where">{escape(finding.chapters)}</p>'
    *text, proof = finding.paragraphs
    yield from (f"<p>{prose(paragraph)}</p>" for paragraph in text)
    yield f'<p class="proof"><b>Why.</b> {prose(proof)}</p>'
    settled = [row.statement.id for row in report.rows if row.claim.settled_by == finding.key]
    if settled:
        links = ", ".join(f'<a href="#{name}">{name}</a>' for name in dict.fromkeys(settled))
        yield f'<p class="where">Settles {links}.</p>'
    counts = {"test": len(finding.nodes), "flight": len(finding.flights)}
    named = [f"{count} {name}{'s' * (count > 1)}" for name, count in counts.items() if count]
    named += ["1 sweep"] * bool(finding.sweep)
    commands = escape("\n".join([*finding.flown, finding.command]))
    summary = ", ".join(named)
    yield f"<details><summary>{summary}</summary><pre>{commands}</pre></details></article>"


def _chapter(report: Report, chapter: int) -> Iterator[str]:
    yield f'<section class="chapter" id="chapter-{chapter}" data-chapter="{chapter}">'
    yield from chapter_claims(report, chapter)
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
    yield f"<p>{prose(comparisons.EXPLANATION)}</p>"
    yield '<div class="scroll" tabindex="0"><table class="beyond"><thead><tr><th>Flight</th>'
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
    title = prose(one.title)
    if one.without:
        title += f' <span class="section">compared with {escape(one.without)}</span>'
    head = f'<th class="what" scope="rowgroup" rowspan="{len(metrics)}">{title}</th>'
    for metric in metrics:
        cells = "".join(
            f'<td class="n">{escape(metric.plants.get(plant, "–"))}</td>' for plant in PLANTS
        )
        yield f'<tr class="case">{head}<td>{escape(comparisons.quantity(metric))}</td>{cells}</tr>'
        head = ""


def _figure(drawing: Drawing) -> str:
    picture = drawing.picture
    # Drawn at a higher resolution than shown, for high-density screens and print.
    pixels = (int.from_bytes(drawing.png[i : i + 4], "big") for i in (16, 20))
    width, height = (round(size * _SHOWN_DPI / DPI) for size in pixels)
    return (
        f'<figure id="figure-{picture.name}"><img alt="{escape(picture.caption)}" '
        f'width="{width}" height="{height}" '
        f'src="{png_data(drawing.png)}"><figcaption>{prose(picture.caption)}'
        "</figcaption></figure>"
    )
