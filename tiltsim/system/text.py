"""Text from files, names and messages, made safe to show."""

from __future__ import annotations

import re
import unicodedata
from html import escape


def printable(text: object) -> str:
    """Text with line breaks, terminal sequences and other invisible characters escaped.

    So whatever a file puts into it is one line, cannot control a terminal, cannot turn the writing
    direction, and is allowed in XML. Apply it where text reaches a terminal or a file.
    """
    return "".join(
        c if c.isprintable() or unicodedata.category(c) == "Zs" else _escaped(c) for c in str(text)
    )


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode()


def printable_html(text: object) -> str:
    """`printable` text for HTML, attributes included."""
    return escape(printable(text))


def printable_markdown(text: object) -> str:
    """`printable` text for Markdown, where it begins no HTML tag; ``<=`` stays as it is."""
    return re.sub(r"<(?=[A-Za-z/!?])", "&lt;", printable(text))
