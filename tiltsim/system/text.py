"""Text from files, names and messages, made safe to show."""

from __future__ import annotations

import re
import unicodedata
from html import escape
from typing import Final

LONGEST_WORD: Final = 300
"""Longer than any ordinary path."""


def printable(text: object) -> str:
    """Text with line breaks, terminal sequences and other invisible characters escaped.

    So whatever a file puts into it is one line, cannot control a terminal, cannot turn the writing
    direction, and is allowed in XML. Apply it where text reaches a terminal or a file.
    """
    return "".join(
        c if c.isprintable() or unicodedata.category(c) == "Zs" else _escaped(c) for c in str(text)
    )


def valid_unicode(text: str) -> str:
    """Text with what is no Unicode escaped, such as a byte of a file name that is not UTF-8."""
    return text.encode(errors="backslashreplace").decode()


def shortened(text: str, length: int = 80) -> str:
    """Text of at most so many characters; what is cut off is shown as dots."""
    return text if len(text) <= length else text[: length - 3] + "..."


def without_long_words(text: str) -> str:
    """Text whose words, such as unknown names, have at most `LONGEST_WORD` characters."""
    return re.sub(r"\S+", lambda word: shortened(word[0], LONGEST_WORD), text)


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode()


def printable_html(text: object) -> str:
    """`printable` text for HTML, attributes included."""
    return escape(printable(text))


def printable_markdown(text: object) -> str:
    """`printable` text for Markdown, where it begins no HTML tag; ``<=`` stays as it is."""
    return re.sub(r"<(?=[A-Za-z/!?])", "&lt;", printable(text))
