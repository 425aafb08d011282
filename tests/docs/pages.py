"""The Markdown of README, docs and notebooks: code blocks, links and anchors."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("mjcf/*.md"), *ROOT.glob("docs/**/*.md")])

FENCED = re.compile(r"^```(\S*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)

LINK = re.compile(r"\]\(([^)\s]+)\)|<[^>]*?(?:href|src)=\"([^\"]+)\"")


class Block(NamedTuple):
    """A fenced block of code."""

    line: int  # of its first line of code
    language: str  # "" for output
    code: str


def markdown(page: Path) -> str:
    """The text of a page; the text of a notebook is in its Markdown cells."""
    text = page.read_text(encoding="utf-8")
    if page.suffix != ".ipynb":
        return text
    cells = json.loads(text)["cells"]
    return "\n\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")


def blocks(page: str | Path) -> list[Block]:
    """The fenced blocks of a page, which is relative to the root of the repository."""
    text = markdown(ROOT / page)
    return [
        Block(text.count("\n", 0, found.start()) + 2, found[1], found[2])
        for found in FENCED.finditer(text)
    ]


def code(page: str | Path, language: str) -> list[str]:
    """The code of a page's blocks in one language."""
    return [block.code for block in blocks(page) if block.language == language]


def links(page: Path) -> list[str]:
    """The targets of a page's links and pictures, outside of code."""
    text = re.sub(r"`[^`\n]*`", "", FENCED.sub("", markdown(page)))
    return [target for pair in LINK.findall(text) for target in pair if target]


def anchors(page: Path) -> set[str]:
    """Targets that links can name after ``#``: headings as GitHub spells them, and explicit ids."""
    text = FENCED.sub("", markdown(page))
    found: set[str] = set()
    for heading in re.findall(r"^#{1,6} +(.*?) *#*$", text, re.MULTILINE):
        shown = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = slug = re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-")
        number = 0
        while name in found:
            number += 1
            name = f"{slug}-{number}"
        found.add(name)
    return found | {*re.findall(r"<a (?:id|name)=\"([^\"]+)\"", text)}
