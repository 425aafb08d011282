"""Figures of a page are lines that its commands print: the block of output after a shell block.

``python -m tests.docs.test_printed docs/interaction.md`` puts the present figures in their place.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
import tempfile
from decimal import Decimal
from functools import cache
from pathlib import Path

import pytest

from tests.docs.pages import ROOT
from tests.docs.shell import commands
from tiltsim.cli import main
from tiltsim.errors import DONE

PAGES = ("docs/autopilot.md", "docs/interaction.md", "docs/stability.md")
PRINTED = re.compile(r"^```sh\n((?:(?!^```).*\n)*)^```\n\n?^```\n((?:(?!^```).*\n)+)^```$", re.M)
NUMBER = re.compile(r"(?<![\w.#])-?\d+(?:\.\d+)?(?:e[-+]\d+)?")


@cache
def commands_with_output():
    """The commands that are run here, to their end."""
    found = [each[1] for page in PAGES for each in PRINTED.finditer(page_text(page))]
    with tempfile.TemporaryDirectory() as folder:
        return {tuple(each) for code in found for each in commands(code, Path(folder))}


def page_text(page):
    """The text of a page."""
    return (ROOT / page).read_text(encoding="utf-8")


def lines_of(code):
    """The lines that a shell block's commands of tiltsim print."""
    text = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(text):
        for program, *arguments in commands(code, Path(folder)):
            if program == "tiltsim":
                assert main(arguments) == DONE, arguments
    return text.getvalue().splitlines()


def words(line):
    """A line without its numbers and its alignment."""
    return " ".join(NUMBER.sub("0", line).split())


def present(shown, printed):
    """The lines of a page with the numbers that are printed now, rounded alike.

    Raises:
        AssertionError: If a line is not printed, after the lines before it.
    """
    lines, left = [], iter(printed)
    for line in shown:
        start, cut, _ = line.partition(" ...")
        same = (each for each in left if words(each)[: len(words(start))] == words(start))
        found = next((each for each in same if cut or words(each) == words(start)), None)
        assert found is not None, f"{line!r} is not printed there"
        numbers = iter(NUMBER.findall(found))

        def rounded(number):
            exact = float(next(numbers))  # noqa: B023 - called at once
            _, digits, exponent = Decimal(number[0]).as_tuple()
            if "e" in number[0]:
                return f"{exact:.{len(digits) - 1}e}"
            return f"{round(exact, -exponent) + 0.0:.{-exponent}f}"

        lines.append(NUMBER.sub(rounded, start) + line[len(start) :])
    return lines


def as_printed(page):
    """The text of a page, before and after its figures are renewed."""
    text = page_text(page)

    def renewed(found):
        shown = found[2].splitlines()
        block = "\n".join(present(shown, lines_of(found[1])))
        return found[0].replace(found[2], block + "\n")

    return text, PRINTED.sub(renewed, text)


def test_another_number_and_another_line_are_noticed():
    printed = ["  final_swing   0.62459 rad", "", "x  1.5e-05  more"]
    assert present(["final_swing 0.61 rad"], printed) == ["final_swing 0.62 rad"]
    assert present(["x 1.4e-05 ..."], printed) == ["x 1.5e-05 ..."]
    with pytest.raises(AssertionError, match="is not printed"):
        present(["x 1.5e-05 more", "final_swing 0.62 rad"], printed)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_figures_are_printed_by_the_commands_above_them(page):
    text, now = as_printed(page)
    assert PRINTED.search(text)
    assert text.splitlines() == now.splitlines()


if __name__ == "__main__":
    for name in sys.argv[1:]:
        (ROOT / name).write_text(as_printed(name)[1], encoding="utf-8")
