"""Words that a reader of the field stumbles over do not return."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
AVOIDED = re.compile(r"\b(told|wanted|unhurried|befalls|misfit|likeness)\b", re.IGNORECASE)
SUFFIXES = {".py", ".md", ".toml", ".xml", ".ipynb", ".yml"}
FOLDERS = ("controllers", "tiltsim", "scenarios", "mjcf", "docs", "examples", "tests")


def test_no_file_has_a_word_that_is_avoided() -> None:
    files = [f for folder in FOLDERS for f in (ROOT / folder).rglob("*") if f.suffix in SUFFIXES]
    assert len(files) > 500
    found = [
        f"{file.relative_to(ROOT)}:{number}: {line.strip()}"
        for file in [*files, *ROOT.glob("*.md")]
        if file != Path(__file__)
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
        if AVOIDED.search(line)
    ]
    assert not found, "\n".join(found)
