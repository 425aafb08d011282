"""Limits on the content of files, checked before any work is done with them."""

from pathlib import Path
from typing import Final

from tiltsim.errors import InputError

MAX_FILE_SIZE: Final = 4 * 2**20
"""Bytes of a text file."""

MAX_DEPTH: Final = 64
"""Tables and lists in one another, and steps of a dotted key."""

MAX_VALUES: Final = 200_000
"""Values of a document; entries of lists count one by one."""

MAX_ROWS: Final = 10_000
"""Rows of a table of a reference or a gait."""


def read_text(path: Path) -> str:
    """The text of a file in UTF-8. Raises `InputError` if it cannot be read or is too large."""
    try:
        size = path.stat().st_size
        if size > MAX_FILE_SIZE:
            raise InputError(f"{path}: {size} bytes; at most {MAX_FILE_SIZE}")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start}: {error.reason})") from error


def check_limits(document: object, address: str) -> None:
    """Raise `InputError` for a document that is too deep or too long, or has huge integers.

    Args:
        document: Plain tables, lists and values.
        address: Its name in the message.
    """
    level, depth, values = [document], 0, 0
    while level:
        if depth > MAX_DEPTH:
            raise InputError(f"{address}: tables and lists nest more than {MAX_DEPTH} deep")
        if any(type(value) is int and abs(value) >= 2**63 for value in level):
            raise InputError(f"{address}: a whole number has more than 64 bits")
        inner: list[object] = []
        for value in level:
            inner += value.values() if isinstance(value, dict) else ()
            inner += value if isinstance(value, list | tuple) else ()
        values += len(inner)
        if values > MAX_VALUES:
            raise InputError(f"{address}: more than {MAX_VALUES} values")
        level, depth = inner, depth + 1
