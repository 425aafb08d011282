"""The list of errors of the thesis, each with printed formula, proof and mended formula.

An entry counts if a row with the verdict refuted or misprint names it
(`tiltsim.report.claim_rows.errors`); its proof runs when the report is made.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tiltsim.report.measures.slips import deviation

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


ERRORS: Final = {
    key: PublishedError(key=key, **table)
    for key, table in tomllib.loads(
        (Path(__file__).parent / "errors.toml").read_text(encoding="utf-8")
    ).items()
}
"""All entries by key: first the one of most consequence, then in the order of the text."""
