"""Statements that still lack the thesis's words and a criterion; empty when all are written."""

from __future__ import annotations

from typing import Final

from tiltsim.report.statement import CHAPTER, Statement, slug

DRAFT: Final = "To be written."


def draft(source: str, text: str) -> Statement:
    """A statement of which only the source and our sentence are written."""
    chapter = CHAPTER.match(source)
    assert chapter is not None
    name = slug(text)[:50].strip("-")
    return Statement(
        id=f"ch{chapter[1]}-{name}", source=source, text=text, thesis=text, criterion=DRAFT
    )
