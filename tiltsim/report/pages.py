"""The report as one self-contained HTML page, and as Markdown for the repository.

The page has everything inside: style, script and figures. Every row is a ``details`` element, so
that without JavaScript everything can be opened and linked to; only the filter is missing. The
Markdown is reproducible, without machine details: the summary, the findings, and the rows that are
not reproduced. The templates are in the folder ``templates``.
"""

import csv
import io
import json
import re
from base64 import b64encode
from collections.abc import Iterable
from html import escape
from io import BytesIO
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from PIL import Image

from tiltsim.report import content, flights
from tiltsim.report.claim import Claim, ClaimVerdict, Origin
from tiltsim.report.claim_rows import COMPUTED, Row, count, count_statements
from tiltsim.report.content import (
    Group,
    Report,
    criterion_text,
    measured_text,
    published_text,
    why_of,
)
from tiltsim.report.flights import PLANTS
from tiltsim.report.making import Made
from tiltsim.report.pictures import Drawing
from tiltsim.scenario.library import read_toml
from tiltsim.system.text import printable_markdown

_TEMPLATES: Final = Path(__file__).parent / "templates"

THUMBNAIL: Final = (240, 150)  # largest width and height, pixels


def page(report: Report, made: Made) -> str:
    """The whole HTML page."""
    style = (_TEMPLATES / "page.css").read_text(encoding="utf-8")
    return _rendered(
        "page.html",
        report,
        made=made,
        style=Markup(style + _thumbnail_styles(report.drawings)),
        script=Markup((_TEMPLATES / "page.js").read_text(encoding="utf-8")),
        bar=_bar(report.rows),
        choices=_choices(report),
    )


def markdown(report: Report) -> str:
    """The whole summary; equal results give equal text."""
    return _rendered("page.md", report).rstrip() + "\n"


def errors_page(report: Report) -> str:
    """The list of errors as Markdown; equal results give equal text."""
    rounding = [row for row in report.rows if row.verdict is ClaimVerdict.ROUNDING]
    return _rendered("errors.md", report, rounding=rounding).rstrip() + "\n"


def _rendered(template: str, report: Report, **more: Any) -> str:
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=template.endswith(".html"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {
        "alone": lambda rows: sum(row.on_the_thesis_alone for row in rows),
        "case_rows": _case_rows,
        "cell": markdown_cell,
        "code": "`{}`".format,
        "count_rows": count,
        "files": lambda flights: dict.fromkeys(one.partition("#")[0] for one in flights),
        "groupby_in_order": lambda items, name: [
            (key, list(group)) for key, group in groupby(items, attrgetter(name))
        ],
        "number": _number,
        "png_data": _png_data,
        "prose": _prose,
        "statements": lambda rows: sum(count_statements(rows).values()),
    }
    thesis = read_toml(_TEMPLATES.parent / "thesis.toml")
    return environment.get_template(template).render(
        {**vars(content), **vars(flights)}
        | {
            "report": report,
            "thesis": thesis["thesis"],
            "thesis_bibtex": thesis["bibtex"].strip(),
            "journals": {int(number): text for number, text in thesis["chapters"].items()},
            "withdrawn": read_toml(_TEMPLATES.parent / "withdrawn.toml") if report.findings else {},
            "verdicts": list(ClaimVerdict),
            "origins": list(Origin),
        }
        | more
    )


def _bar(rows: list[Row]) -> list[tuple[str, int]]:
    """Classes and lengths of the parts of the bar over all rows."""
    alone, counts = sum(row.on_the_thesis_alone for row in rows), count(rows)
    rest = counts[ClaimVerdict.REPRODUCED] - alone
    parts = [("reproduced", alone), ("reproduced ours", rest)]
    parts += [(verdict.css, counts[verdict]) for verdict in list(ClaimVerdict)[1:]]
    return [part for part in parts if part[1]]


def _choices(report: Report) -> dict[str, list[tuple[str, str]]]:
    """Values and texts of the filter's lists."""
    origins = [(origin.name.lower(), origin.value) for origin in Origin]
    chapters = [(str(number), f"ch. {number}") for number in report.chapters]
    return {
        "origin": [("", "any origin"), ("thesis", "thesis alone"), *origins],
        "chapter": [("", "all chapters"), *chapters],
        "order": [("", "in order of the text"), ("failures", "failures first")],
    }


def _prose(text: str) -> Markup:
    """Text with `code` between backticks."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text, quote=False)))


def _number(text: str, claim: Claim) -> Markup:
    """A value with its unit, which is set smaller."""
    unit = claim.unit
    if not unit or not text.endswith(f" {unit}"):
        return Markup(escape(text))
    number = escape(text.removesuffix(f" {unit}"))
    return Markup(f'{number}&nbsp;<span class="unit">{escape(unit)}</span>')


def _png_data(png: bytes) -> str:
    """An image as an address."""
    return f"data:image/png;base64,{b64encode(png).decode()}"


def _thumbnail_styles(drawings: list[Drawing]) -> str:
    """Style rules with small versions of the figures, each in the page once."""
    rules = []
    for drawing in drawings:
        with Image.open(BytesIO(drawing.png)) as image:
            small = image.convert("RGB")
        small.thumbnail(THUMBNAIL, Image.Resampling.LANCZOS)
        packed = BytesIO()
        small.quantize(64).save(packed, format="PNG", optimize=True)
        width, height = (round(size / 2) for size in small.size)
        rules.append(
            f".thumb-{drawing.picture.name} {{ width: {width}px; height: {height}px; "
            f"background-image: url({_png_data(packed.getvalue())}); }}"
        )
    return "\n".join(rules)


def _measured(row: Row) -> list[str]:
    """The two cells of Markdown with measured values."""
    texts = {name: measured_text(row.claim, cell) for name, cell in row.cells.items()}
    if COMPUTED in texts:
        return [f"{texts[COMPUTED]} (computed)", ""]
    return [texts.get(plant, "") for plant in PLANTS]


def _case_rows(group: Group, errors: list[str]) -> list[list[str]]:
    """Rows of Markdown: one with the statement and its only case, or one above all cases."""
    fits = group.many_fits
    rows = [
        [row.claim.case, published_text(row), *_measured(row), _described(row, group, errors)]
        for row in group.rows
        if not (fits and row.verdict is ClaimVerdict.FITTED)
    ]
    if fits:
        rows.append([f"{fits} cases", "", "", "", ClaimVerdict.FITTED.value])
    if len(rows) > 1:
        return [[group.described, "", "", "", ""], *rows]
    [[case, *cells]] = rows
    return [["\n".join(filter(None, (group.described, case))), *cells]]


def _described(row: Row, group: Group, errors: list[str]) -> str:
    """The verdict of a row, our choices in it, and the reason or the error that explains it."""
    tags = f" (*{', '.join(origin.value for origin in row.origins)}*)" if row.origins else ""
    if row.claim.error:
        return f"{row.verdict.value}{tags}: [error {errors.index(row.claim.error) + 1}](errors.md)"
    why = why_of(row) if not group.shared_why else ""
    return f"{row.verdict.value}{tags}{f': {why}' if why else ''}"


def markdown_cell(text: str) -> str:
    """Text in a cell of a table, whose lines are separated there."""
    lines: Iterable[str] = (printable_markdown(line) for line in text.split("\n"))
    return "<br>".join(lines).replace("|", "\\|")


def records(report: Report) -> list[dict[str, str | int | list[str]]]:
    """One record per row, in the order of the page."""
    groups = (group for chapter in report.chapters for group in report.chapter_groups(chapter))
    return [_record(row) for group in groups for row in group.rows]


def _record(row: Row) -> dict[str, str | int | list[str]]:
    claim = row.claim
    texts = {name: measured_text(claim, cell) for name, cell in row.cells.items()}
    return {
        "id": claim.id,
        "statement_id": row.statement.id,
        "chapter": claim.chapter,
        "place": claim.source,
        "statement": row.statement.text,
        "case": claim.case,
        "thesis": row.statement.thesis,
        "criterion": criterion_text(claim),
        "published": published_text(row),
        **{name: texts.get(name, "") for name in (*PLANTS, COMPUTED)},
        "verdict": row.verdict.value,
        "why": why_of(row),
        "error": claim.error,
        "ours": [origin.name.lower() for origin in row.origins],
        "thresholds": list(claim.thresholds),
        "flights": list(claim.flights),
    }


def rows_json(report: Report) -> str:
    """All rows as a JSON list."""
    return json.dumps(records(report), indent=1, ensure_ascii=False) + "\n"


def rows_csv(report: Report) -> str:
    """All rows as CSV; lists are separated by spaces."""
    rows = [
        {key: " ".join(value) if isinstance(value, list) else value for key, value in one.items()}
        for one in records(report)
    ]
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]) if rows else ["id"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
