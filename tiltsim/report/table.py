"""The rows of the report as records: for the files ``rows.csv`` and ``rows.json``."""

import csv
import io
import json

from tiltsim.report.content import (
    Report,
    criterion_text,
    flights_of,
    measured_text,
    published_text,
    why_of,
)
from tiltsim.report.flights import PLANTS


def records(report: Report) -> list[dict[str, str | int | list[str]]]:
    """One record per row, in the order of the page."""
    rows = [
        row
        for chapter in report.chapters
        for group in report.chapter_groups(chapter)
        for row in group.rows
    ]
    found: list[dict[str, str | int | list[str]]] = []
    for row in rows:
        claim = row.claim
        shown = {plant: row.cell(plant) for plant in PLANTS} | {"computed": row.analysis}
        found.append(
            {
                "id": claim.id,
                "statement_id": row.statement.id,
                "chapter": claim.chapter,
                "place": claim.source,
                "statement": row.statement.text,
                "case": claim.case,
                "thesis": row.statement.thesis,
                "criterion": criterion_text(claim),
                "published": published_text(row),
                **{
                    name: measured_text(claim, cell) if cell else "" for name, cell in shown.items()
                },
                "verdict": row.verdict.value,
                "why": why_of(row),
                "error": claim.error,
                "ours": [origin.name.lower() for origin in row.origins],
                "thresholds": list(claim.thresholds),
                "flights": list(flights_of(claim)),
            }
        )
    return found


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
