"""Errors of traced code, which name the line that is wrong."""

import linecache
import sys
from pathlib import Path
from typing import Final, NoReturn


class TraceError(Exception):
    """Code that cannot run on symbolic numbers; the message names file, line and remedy.

    It is no TypeError, which NumPy would replace with its own.
    """


_OWN: Final = str(Path(__file__).parent)


def user_line() -> tuple[str, int]:
    """File and line of the innermost frame outside this package and NumPy."""
    frame = sys._getframe(1)
    while frame.f_back:
        name = frame.f_code.co_filename
        if not (name.startswith(_OWN) or "/numpy/" in name):
            break
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def refuse(fault: str, remedy: str) -> NoReturn:
    """Raise `TraceError` with the user's line, its fault and the remedy."""
    file, line = user_line()
    text = linecache.getline(file, line).strip()
    raise TraceError(f"{file}:{line}: `{text}`: {fault}; {remedy}") from None
