"""The report as Markdown for the repository: reproducible, short, without machine details.

It has the summary, the findings, and the rows that are not reproduced; the page has them all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from tiltsim.report.claim import ClaimVerdict
from tiltsim.report.claim_rows import Row, count, count_statements
from tiltsim.report.content import (
    CHAPTERS,
    MEANINGS,
    METHOD,
    SUBJECT,
    TITLE,
    Group,
    Report,
    flown_text,
    lead_text,
    measured_text,
    published_text,
    why_of,
)
from tiltsim.report.flights import PLANTS
from tiltsim.report.statement import Origin
from tiltsim.system.text import printable_markdown


def markdown(report: Report) -> str:
    """The whole summary; equal results give equal text."""
    return "\n".join(_lines(report)).rstrip() + "\n"


def _lines(report: Report) -> Iterator[str]:
    yield f"# {TITLE}"
    yield from ("", SUBJECT, "", lead_text(report.rows), "")
    yield (
        "Written by `tiltsim report --markdown FILE`. Its page, `report/report.html`, has all rows "
        "with criterion, scenario, command, figure and test of each, and the flights beyond the "
        "thesis; below are the rows that are not reproduced. The ids are the page's."
    )
    yield ""
    for paragraph in METHOD:
        yield from (paragraph, "")
    yield from _summary(report)
    if report.findings:
        yield from ("", "## Our findings", "")
        for finding in report.findings:
            yield f"### {finding.title}"
            yield from ("", f"*{finding.chapters}*", "")
            *text, proof = finding.paragraphs
            for paragraph in (*text, f"**Why.** {proof}"):
                yield from (paragraph, "")
            yield from ("```sh", finding.command, "```", "")
    for chapter in report.chapters:
        groups = [_not_reproduced(group) for group in report.chapter_groups(chapter)]
        if not any(group.rows for group in groups):
            continue
        yield from ("", f"## Chapter {chapter}. {CHAPTERS.get(chapter, '')}", "")
        yield "| Row | Published | Thesis plant | MuJoCo | Verdict |"
        yield "| --- | ---: | ---: | ---: | --- |"
        for group in groups:
            if group.rows:
                yield from _group(group)


def _not_reproduced(group: Group) -> Group:
    kept = [row for row in group.rows if row.verdict is not ClaimVerdict.REPRODUCED]
    return replace(group, rows=kept)


def _summary(report: Report) -> Iterator[str]:
    heads = [verdict.value for verdict in ClaimVerdict]
    yield f"| Chapter | on the thesis alone | {' | '.join(heads)} | rows | statements |"
    yield "| --- |" + " ---: |" * (len(heads) + 3)
    for chapter in report.chapters:
        rows = [row for row in report.rows if row.claim.chapter == chapter]
        yield _counts(f"{chapter}. {CHAPTERS.get(chapter, '')}", rows)
    yield _counts("all", report.rows)
    yield ""
    yield "- **on the thesis alone**: reproduced, and nothing in the test is ours"
    yield from (f"- **{verdict.value}**: {meaning}" for verdict, meaning in MEANINGS.items())
    yield ""
    yield "A tag says what of a row's test does not come from the thesis:"
    yield ""
    yield from (f"- *{origin.value}*: {origin.meaning}" for origin in Origin)
    yield ""
    yield f"Flown: {flown_text(report)}."


def _counts(name: str, rows: list[Row]) -> str:
    counts = count(rows)
    alone = sum(row.on_the_thesis_alone for row in rows)
    cells = [alone, *(counts[verdict] or "" for verdict in ClaimVerdict)]
    cells += [len(rows), sum(count_statements(rows).values())]
    return f"| {name} | {' | '.join(map(str, cells))} |"


def _group(group: Group) -> Iterator[str]:
    statement = group.statement
    text = f"**{statement.text}** ({group.sources}; `{statement.id}`)"
    notes = [f"Criterion: {statement.criterion.rstrip('.')}.", statement.note, group.shared_why]
    yield _cells(["\n".join(filter(None, (text, *notes))), "", "", "", ""])
    fits = [row for row in group.rows if row.verdict is ClaimVerdict.FITTED]
    for row in group.rows:
        if row not in fits or len(fits) < 3:
            yield _row(row, group)
    if len(fits) >= 3:
        yield _cells([f"{len(fits)} cases", "", "", "", ClaimVerdict.FITTED.value])


def _row(row: Row, group: Group) -> str:
    verdict = row.verdict.value
    if row.origins:
        verdict += f" (*{', '.join(origin.value for origin in row.origins)}*)"
    if why_of(row) and not group.shared_why:
        verdict += f": {why_of(row)}"
    return _cells([row.claim.case or "all of it", published_text(row), *_measured(row), verdict])


def _measured(row: Row) -> list[str]:
    if row.analysis is not None:
        text = measured_text(row.claim, row.analysis)
        return [f"{text} (computed)", ""]
    cells = [row.cell(plant) for plant in PLANTS]
    return ["" if cell is None else measured_text(row.claim, cell) for cell in cells]


def _cells(cells: list[str]) -> str:
    return "| " + " | ".join(map(_cell, cells)) + " |"


def _cell(text: str) -> str:
    """Text in a cell of a table, whose lines are separated there."""
    lines = (printable_markdown(line) for line in text.split("\n"))
    return "<br>".join(lines).replace("|", "\\|")
