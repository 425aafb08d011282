"""A finding: what it says, why it is true, and what would fail if it were false."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A result beyond the thesis."""

    key: str
    title: str
    chapters: str
    text: Sequence[str]
    """Paragraphs with ``{names}`` of ``numbers``; text between backticks is code."""
    proof: str
    """Why it is true, or where that is derived; also with ``{names}``."""
    tests: Mapping[str, Sequence[str]]
    """Names of tests by their file in the folder of the tests."""
    flights: Sequence[str] = ()
    """Addresses in the scenario library that show it."""
    sweep: str = ""
    """Name of a sweep of the library that shows it."""
    pictures: Sequence[str] = ()
    """Names of pictures of the report that show it."""
    numbers: Callable[[], dict[str, str]] = dict

    @property
    def paragraphs(self) -> list[str]:
        """The text, then the proof, with their numbers."""
        numbers = self.numbers()
        return [paragraph.format(**numbers) for paragraph in (*self.text, self.proof)]

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
