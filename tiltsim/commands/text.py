"""Text output: aligned lines, tables, and JSON without negative zeros."""

import json
import shlex
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.system.text import alike, printable, shortened

LONGEST_REASON: Final = 300
"""Characters of a reason; messages that list the allowed values can be long."""


def number(value: float, form: str = ".6g") -> str:
    """A number as text; a value that prints as zero has no sign."""
    text = format(value, form)
    return text[1:] if text.startswith("-") and float(text) == 0.0 else text


def numbers(values: Iterable[float]) -> str:
    """Numbers as text, separated by commas."""
    return ", ".join(number(value) for value in values)


def counted(count: int, one: str, many: str) -> str:
    """A count with its noun: ``1 flight``, ``2 flights``."""
    return f"{count} {one if count == 1 else many}"


def tally(counts: Mapping[str, int]) -> str:
    """Counts by name: ``3 passed, 1 failed``."""
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def most_frequent(reasons: Sequence[str]) -> str:
    """The most frequent reason, in a line that says how many rows have it.

    Reasons that differ only in numbers count as one, and the first of them is shown.
    """
    kinds = alike(reasons)
    reason = max(kinds, key=lambda first: len(kinds[first]))
    shown = shortened(reason, LONGEST_REASON)
    return f"most frequent reason ({len(kinds[reason])} of {len(reasons)}): {shown}"


def require_flown(reasons: Sequence[str | None]) -> None:
    """Raise `InputError` if every row has a reason why it could not be flown."""
    known = [reason for reason in reasons if reason is not None]
    if known and len(known) == len(reasons):
        raise InputError(f"nothing could be flown; {most_frequent(known)}")


def print_line(text: str, *, error: bool = False) -> None:
    """Print one line; text of files and names in it cannot control the terminal."""
    print(printable(text), file=sys.stderr if error else sys.stdout, flush=True)


def warn(text: str) -> None:
    """Print a warning on standard error."""
    print_line(f"tiltsim: warning: {text}", error=True)


def viewing(path: Path) -> str:
    """A flight's folder or a recording, and the command that shows it."""
    return f"{path}; see it with tiltsim view {shlex.quote(str(path))}"


def json_text(report: Any) -> str:
    """A report as JSON. Raises ValueError for NaN and infinity."""
    return json.dumps(_unsigned_zeros(report), indent=2, allow_nan=False)


def _unsigned_zeros(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _unsigned_zeros(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_unsigned_zeros(item) for item in value]
    return value + 0.0 if isinstance(value, float) else value


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole or not at all; it ends with a line break."""
    from tiltsim.system.files import replacing

    with replacing(path) as temporary:
        temporary.write_text(text.rstrip("\n") + "\n", encoding="utf-8")


def aligned(rows: Sequence[tuple[str, str]]) -> list[str]:
    """Pairs of name and value as lines, with the values aligned."""
    width = max(len(name) for name, _ in rows)
    return [fitted(f"{name:<{width}}  {value}", width + 2) for name, value in rows]


def fitted(line: str, indent: int) -> str:
    """A line, wrapped and indented on a terminal that is too narrow for it.

    Lines in files and pipes are never wrapped, so that a program finds one item per line.
    """
    if not sys.stdout.isatty():
        return line
    width = max(shutil.get_terminal_size().columns, indent + 20)
    return fill(
        line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


Columns = Mapping[str, tuple[str | Callable[[Any], Any], str]]
"""By heading, the key of a row or a function of it, and the format of its numbers."""


def table(columns: Columns, rows: Sequence[Any]) -> str:
    """A table; columns with a format are right-aligned, and a cell without a value has a dash."""
    lines = cells(columns, rows)
    widths = [max(map(len, column)) for column in zip(*lines)]
    signs = [">" if form else "<" for _, form in columns.values()]
    return "\n".join(
        "  ".join(
            f"{cell:{sign}{width}}" for cell, sign, width in zip(line, signs, widths)
        ).rstrip()
        for line in lines
    )


def cells(columns: Columns, rows: Sequence[Any]) -> list[list[str]]:
    """The text of a table, its headings first."""
    return [[*columns], *([_cell(row, *column) for column in columns.values()] for row in rows)]


def _cell(row: Any, key: str | Callable[[Any], Any], form: str) -> str:
    value = row[key] if isinstance(key, str) else key(row)
    if value is None:
        return "-"
    return number(value, form) if form and not isinstance(value, str) else str(value)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    return [f"| {' | '.join(line)} |" for line in (header, ["---"] * len(header), *lines)]
