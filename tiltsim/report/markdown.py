"""The report as Markdown for the repository: reproducible, without figures or machine details."""

from __future__ import annotations

from collections.abc import Iterator

from tiltsim.report import comparisons
from tiltsim.report.claim import ClaimVerdict
from tiltsim.report.claim_rows import Row, count
from tiltsim.report.content import (
    CHAPTERS,
    MEANINGS,
    METHOD,
    SUBJECT,
    TITLE,
    Group,
    Report,
    flown_text,
    measured_text,
    published_text,
    why_of,
)
from tiltsim.report.flights import PLANTS
from tiltsim.system.text import printable_markdown


def markdown(report: Report) -> str:
    """The whole report; equal results give equal text."""
    return "\n".join(_lines(report)).rstrip() + "\n"


def _lines(report: Report) -> Iterator[str]:
    yield f"# {TITLE}"
    yield from ("", SUBJECT, "")
    yield "Written by `tiltsim report --markdown FILE`; its HTML page also has figures."
    yield ""
    for paragraph in METHOD:
        yield from (paragraph, "")
    yield from _summary(report)
    if report.findings:
        yield from ("", "## Our findings", "")
        for finding in report.findings:
            yield f"### {finding.title}"
            yield from ("", f"*{finding.chapters}*", "")
            for paragraph in finding.paragraphs:
                yield from (paragraph, "")
            yield from ("```sh", finding.command, "```", "")
    for chapter in report.chapters:
        yield from ("", f"## Chapter {chapter}. {CHAPTERS.get(chapter, '')}", "")
        yield "| Claim | Published | Thesis plant | MuJoCo | Verdict |"
        yield "| --- | ---: | ---: | ---: | --- |"
        for group in report.chapter_groups(chapter):
            yield from _group(group)
    if report.comparisons:
        yield from ("", f"## {comparisons.TITLE}", "", comparisons.EXPLANATION, "")
        yield "| Flight | Quantity | Thesis plant | MuJoCo |"
        yield "| --- | --- | ---: | ---: |"
        for file, members in comparisons.families(report.comparisons):
            yield _cells([f"**{file}** ({members[0].source})", "", "", ""])
            yield from map(_comparison, members)


def _comparison(one: comparisons.Comparison) -> str:
    other = f" (compared with `{one.without}`)" if one.without else ""
    shown = [one.plants.get(plant, "") for plant in PLANTS]
    return _cells([one.title + other, comparisons.quantity(one), *shown])


def _summary(report: Report) -> Iterator[str]:
    yield "| Chapter | " + " | ".join(verdict.value for verdict in ClaimVerdict) + " | claims |"
    yield "| --- |" + " ---: |" * (len(ClaimVerdict) + 1)
    for chapter in report.chapters:
        rows = [row for row in report.rows if row.claim.chapter == chapter]
        yield _counts(f"{chapter}. {CHAPTERS.get(chapter, '')}", rows)
    yield _counts("all", report.rows)
    yield ""
    yield from (f"- **{verdict.value}**: {meaning}" for verdict, meaning in MEANINGS.items())
    yield ""
    yield f"Flown: {flown_text(report)}."


def _counts(name: str, rows: list[Row]) -> str:
    counts = count(rows)
    cells = [str(counts[verdict] or "") for verdict in ClaimVerdict]
    return f"| {name} | {' | '.join(cells)} | {len(rows)} |"


def _group(group: Group) -> Iterator[str]:
    single = len(group.rows) == 1
    if not single:
        note = f"\n{group.shared_why}" if group.shared_why else ""
        yield _cells([f"**{group.statement.text}** ({group.sources}){note}", "", "", "", ""])
    for row in group.rows:
        claim = row.claim
        head = f"**{claim.statement.text}** ({claim.section})" if single else row.claim.case
        verdict = row.verdict.value
        if why_of(row) and not group.shared_why:
            verdict += f": {why_of(row)}"
        yield _cells([head, published_text(row), *_measured(row), verdict])


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
