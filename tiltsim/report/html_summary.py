"""The head of the page: what was shown, counts, how to read it and how to cite it."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from tiltsim.report import comparisons
from tiltsim.report.claim import ClaimVerdict
from tiltsim.report.claim_rows import Row, count, count_statements
from tiltsim.report.content import (
    CHAPTERS,
    MEANINGS,
    METHOD,
    SUBJECT,
    TITLE,
    Report,
    flown_text,
    lead_text,
)
from tiltsim.report.html_text import CLASSES, mark, tag
from tiltsim.report.made import Made
from tiltsim.report.statement import Origin


def header(report: Report, made: Made) -> Iterator[str]:
    """Title, subject, what made it, contents."""
    yield f"<header><h1>{escape(TITLE)}</h1>"
    yield f'<p class="lead">{escape(SUBJECT)}</p>'
    yield f'<p class="made">{escape(made.sentence)}</p>'
    yield '<nav aria-label="Contents"><ol><li><a href="#summary">Summary</a></li>'
    if report.findings:
        yield '<li><a href="#findings">Our findings</a></li>'
    for chapter in report.chapters:
        title = f"{chapter} {CHAPTERS.get(chapter, '')}"
        yield f'<li><a href="#chapter-{chapter}">{escape(title)}</a></li>'
    if report.comparisons:
        yield f'<li><a href="#beyond">{escape(comparisons.TITLE)}</a></li>'
    yield '<li><a href="#cite">Cite</a></li></ol></nav></header>'


def summary(report: Report) -> Iterator[str]:
    """Counts, the meaning of verdicts and tags, method."""
    counts, total = count(report.rows), len(report.rows)
    yield '<section id="summary"><h2>Summary</h2>'
    yield f'<p class="first">{escape(lead_text(report.rows))}</p>'
    yield f'<div class="bar" role="img" aria-label="{total} rows by verdict">'
    alone = sum(row.on_the_thesis_alone for row in report.rows)
    yield f'<i class="reproduced" style="flex:{alone}"></i>'
    rest = counts[ClaimVerdict.REPRODUCED] - alone
    if rest:
        yield f'<i class="reproduced ours" style="flex:{rest}"></i>'
    for verdict in list(ClaimVerdict)[1:]:
        if counts[verdict]:
            yield f'<i class="{CLASSES[verdict]}" style="flex:{counts[verdict]}"></i>'
    yield '</div><ul class="key">'
    for verdict, meaning in MEANINGS.items():
        yield f'<li>{mark(verdict)} <span class="meaning">{escape(meaning)}</span></li>'
    yield "</ul><p>A tag on a row says what of its test does not come from the thesis:</p>"
    yield '<ul class="key">'
    for origin in Origin:
        yield f'<li>{tag(origin)} <span class="meaning">{escape(origin.meaning)}</span></li>'
    yield "</ul>"
    yield from (f"<p>{escape(paragraph)}</p>" for paragraph in METHOD)
    yield from _table(report)
    yield f"<p>Flown: {escape(flown_text(report))}.</p></section>"


def _table(report: Report) -> Iterator[str]:
    yield '<table class="counts"><thead><tr><th>Chapter</th><th class="n">thesis alone</th>'
    for verdict in ClaimVerdict:
        name = f'<span class="mark {CLASSES[verdict]}"><b>{verdict.value}</b></span>'
        yield f'<th class="n">{name}</th>'
    yield '<th class="n">rows</th><th class="n">state&shy;ments</th></tr></thead><tbody>'
    for chapter in report.chapters:
        rows = [row for row in report.rows if row.claim.chapter == chapter]
        title = escape(CHAPTERS.get(chapter, ""))
        yield _counts(f'<a href="#chapter-{chapter}">{chapter} <b>{title}</b></a>', rows)
    yield '</tbody><tbody class="total">' + _counts("All", report.rows)
    yield "</tbody></table>"


def _counts(name: str, rows: list[Row]) -> str:
    counts = count(rows)
    statements = sum(count_statements(rows).values())
    alone = sum(row.on_the_thesis_alone for row in rows)
    cells = [alone, *(counts[verdict] or "" for verdict in ClaimVerdict), len(rows), statements]
    numbers = "".join(f'<td class="n">{cell}</td>' for cell in cells)
    return f"<tr><th>{name}</th>{numbers}</tr>"


def controls(report: Report) -> Iterator[str]:
    """The filter, shown where JavaScript runs."""
    yield '<form id="filter" hidden role="search"><fieldset><legend>Verdicts</legend>'
    for verdict in ClaimVerdict:
        name = CLASSES[verdict]
        yield (
            f'<label class="mark {name}"><input type="checkbox" name="verdict" value="{name}" '
            f"checked>{escape(verdict.value)}</label>"
        )
    yield "</fieldset>"
    origins = [(origin.name.lower(), origin.value) for origin in Origin]
    yield from _choice("origin", [("", "any origin"), ("thesis", "thesis alone"), *origins])
    chapters = [(str(n), f"ch. {n}") for n in report.chapters]
    yield from _choice("chapter", [("", "all chapters"), *chapters])
    yield from _choice("order", [("", "in order of the text"), ("failures", "failures first")])
    yield '<input type="search" name="words" placeholder="search rows" aria-label="search rows">'
    yield '<output name="found"></output><button type="reset">reset</button></form>'


def _choice(name: str, values: list[tuple[str, str]]) -> Iterator[str]:
    yield f'<select name="{name}" aria-label="{name}">'
    yield from (f'<option value="{value}">{escape(text)}</option>' for value, text in values)
    yield "</select>"


def citation(made: Made) -> Iterator[str]:
    """How to cite the report and its rows."""
    yield '<section id="cite"><h2>Cite</h2>'
    yield (
        "<p>Every statement and every row has an id, linked by the sign # beside it. The id stays "
        "the same in later reports; verdicts and numbers are those of the commit named here.</p>"
    )
    yield f'<pre class="bibtex">{escape(made.bibtex)}</pre></section>'
