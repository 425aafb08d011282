"""Text from files, names and messages, made safe to show; labels and units of quantities."""

import re
import unicodedata
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

LONGEST_WORD: Final = 300  # longer than any ordinary path
_NUMBER: Final = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")

SUBSCRIPTS: Final = "₀₁₂₃₄₅₆₇₈₉"  # digits as subscripts


def printable(text: object) -> str:
    """Text with line breaks, terminal sequences and other invisible characters escaped.

    So whatever a file puts into it is one line, cannot control a terminal, cannot turn the writing
    direction, and is allowed in XML. Apply it where text reaches a terminal or a file.
    """
    return "".join(
        c if c.isprintable() or unicodedata.category(c) == "Zs" else _escaped(c) for c in str(text)
    )


def valid_unicode(text: str) -> str:
    """Text with bytes that are no Unicode escaped, as in a file name that is not UTF-8."""
    return text.encode(errors="backslashreplace").decode()


def shortened(text: str, length: int = 80) -> str:
    """Text of at most ``length`` characters; dots stand for the cut part."""
    return text if len(text) <= length else text[: length - 3] + "..."


def error_text(error: BaseException) -> str:
    """The type and the message of an error in other people's code, on one line."""
    try:
        text = " ".join(str(error).split())[:200]
    except Exception:
        text = ""
    return f"{type(error).__name__}{f': {text}' if text else ''}"


def short_repr(value: object) -> str:
    """A value in at most 60 characters of one line, even if its ``repr`` raises."""
    try:
        text = " ".join(repr(value).split())
    except Exception:
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def without_long_words(text: str) -> str:
    """Text whose words, such as unknown names, have at most `LONGEST_WORD` characters."""
    return re.sub(r"\S+", lambda word: shortened(word[0], LONGEST_WORD), text)


def alike(messages: Iterable[str]) -> dict[str, list[str]]:
    """Messages that differ in nothing but numbers, together under the first of them."""
    kinds: dict[str, list[str]] = {}
    for message in messages:
        kinds.setdefault(_NUMBER.sub("0", message), []).append(message)
    return {found[0]: found for found in kinds.values()}


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode()


def printable_html(text: object) -> str:
    """`printable` text for HTML, attributes included."""
    from html import escape  # costs start-up time

    return escape(printable(text))


def printable_markdown(text: object) -> str:
    """`printable` text for Markdown, where it begins no HTML tag; ``<=`` stays as it is."""
    return re.sub(r"<(?=[A-Za-z/!?])", "&lt;", printable(text))


def html_table(
    heading: str,
    lines: Iterable[object],
    rows: Iterable[Sequence[object]],
    columns: Sequence[str] = (),
) -> str:
    """A small table for notebooks.

    Args:
        heading: Above it, in bold.
        lines: Below the heading, one line each; empty ones are left out.
        rows: Cells of each row, as text.
        columns: Headings of the columns, if they have any.
    """
    title = [f"<b>{printable_html(heading)}</b>", *(printable_html(line) for line in lines if line)]
    head = "".join(f"<th>{printable_html(name)}</th>" for name in columns)
    body = [
        "".join(f'<td style="text-align:left">{printable_html(cell)}</td>' for cell in row)
        for row in rows
    ]
    table = "".join(f"<tr>{cells}</tr>" for cells in [head, *body] if cells)
    return f"<div>{'<br>'.join(title)}<table>{table}</table></div>"


class Quantity(NamedTuple):
    """The label of a quantity in tables and figures, and its unit; empty or 1 if dimensionless."""

    label: str
    unit: str = ""

    @property
    def text(self) -> str:
        """The label with the unit in brackets."""
        unit = self.unit.replace("^2", "²").replace("^3", "³")
        return f"{self.label} ({unit})" if unit not in {"", "1"} else self.label


def subscript(number: int) -> str:
    """A whole number, 0 or more, as a subscript."""
    return "".join(SUBSCRIPTS[int(digit)] for digit in str(number))


_ACRONYMS: Final = frozenset(("imu", "gps"))


def in_words(name: str) -> str:
    """A name of code, such as ``gait.bias_angle``, in words."""
    words = name.replace("_", " ").replace(".", " ").split()
    return " ".join(word.upper() if word in _ACRONYMS else word for word in words)
