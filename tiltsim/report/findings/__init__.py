"""Our own findings, each with its proof, and the list of errors of the thesis.

An error counts if a row with the verdict refuted or misprint names it
(`tiltsim.report.claim_rows.errors`); its proof runs when the report is made.
The texts, in the TOML files of this folder, contain no measured number: expressions in braces, see
`tiltsim.report.measures.evaluate`, compute them when the report is made.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from tiltsim.report.measures import evaluate
from tiltsim.report.measures.slips import deviation
from tiltsim.scenario.library import read_toml

_NUMBER: Final = re.compile(r"{([^{}]+?)(?::([^{}:]*))?}")
"""An expression in braces with the format of its value."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A result beyond the thesis."""

    key: str
    title: str
    chapters: str
    text: Sequence[str]
    """Paragraphs with numbers, ``{EXPRESSION:FORMAT}``; text between backticks is code."""
    proof: str  # why it is true, or where that is derived; also with numbers
    tests: Mapping[str, Sequence[str]]  # names of tests by their file in the folder of the tests
    flights: Sequence[str] = ()  # addresses in the scenario library that show it
    sweep: str = ""  # name of a sweep of the library that shows it
    pictures: Sequence[str] = ()  # names of pictures of the report that show it

    @property
    def paragraphs(self) -> list[str]:
        """The text, then the proof, with their numbers."""

        def number(found: re.Match[str]) -> str:
            return format(evaluate(found[1]), found[2] or "")

        return [_NUMBER.sub(number, paragraph) for paragraph in (*self.text, self.proof)]

    @property
    def nodes(self) -> list[str]:
        """Its tests, as pytest addresses them."""
        return [f"tests/{file}::{name}" for file, names in self.tests.items() for name in names]

    @property
    def flown(self) -> list[str]:
        """The commands that fly what shows it."""
        sweep = [f"tiltsim sweep '{self.sweep}'"] if self.sweep else []
        return [*(f"tiltsim run '{address}'" for address in self.flights), *sweep]

    @property
    def command(self) -> str:
        """The command that runs its tests."""
        return " \\\n  ".join(("pytest -n 0", *self.nodes))

    @property
    def summary(self) -> str:
        """How much supports it."""
        counts = {
            "test": len(self.nodes),
            "flight": len(self.flights),
            "sweep": int(bool(self.sweep)),
        }
        named = [f"{n} {name}{'s' * (n > 1)}" for name, n in counts.items() if n]
        return ", ".join(named)


def _tables(name: str) -> dict[str, Any]:
    return read_toml(Path(__file__).parent / f"{name}.toml")


FINDINGS: Final = tuple(
    Finding(key=key, **table)
    for name in ("singularities", "flights", "tilt_car")
    for key, table in _tables(name).items()
)
"""All findings, in the order of the report."""


TEST: Final = (
    "tests/report/test_errors.py::test_the_printed_formula_is_wrong_and_the_mended_one_right"
)


@dataclass(frozen=True, kw_only=True)
class PublishedError:
    """A formula, number or statement of the thesis that is wrong."""

    key: str
    title: str
    place: str
    printed: str
    mended: str
    proof: str
    changes: str  # its consequences downstream

    @property
    def off(self) -> str:
        """How far the printed and the mended formula are from the truth."""
        return (
            f"{deviation(self.key, False):.3g} as printed, {deviation(self.key, True):.1g} mended"
        )

    @property
    def command(self) -> str:
        """The command that runs the proof."""
        return f"pytest -n 0 '{TEST}[{self.key}]'"


ERRORS: Final = {key: PublishedError(key=key, **table) for key, table in _tables("errors").items()}
"""All entries by key: first the one of most consequence, then in the order of the text."""
