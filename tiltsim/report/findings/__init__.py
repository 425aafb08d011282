"""Our own findings, each with its proof, what shows it, and the tests that support it.

The texts, in the TOML files of this folder, contain no measured number: `numbers` has functions
that compute them when the report is made.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Final

from tiltsim.report.findings.finding import Finding
from tiltsim.report.findings.numbers import NUMBERS

__all__ = ["FINDINGS", "Finding"]


def _read(name: str) -> list[Finding]:
    """The findings of a file: a table each, named by its key, with the fields of `Finding`."""
    tables = tomllib.loads((Path(__file__).parent / name).read_text(encoding="utf-8"))
    return [
        Finding(key=key, numbers=NUMBERS.get(key, dict), **table) for key, table in tables.items()
    ]


FINDINGS: Final[tuple[Finding, ...]] = (
    *_read("singularities.toml"),
    *_read("flights.toml"),
    *_read("tilt_car.toml"),
)
"""All findings, in the order of the report."""
