"""Exceptions with one-line messages, and the exit codes of every command."""

from collections.abc import Iterable
from typing import Final

DONE: Final = 0
EXPECTATION_FAILED: Final = 1
INVALID_INPUT: Final = 2
VEHICLE_LOST: Final = 3
INTERRUPTED: Final = 130
TERMINATED: Final = 143


class TiltsimError(Exception):
    """Base of all errors that tiltsim raises deliberately; the message is one line."""

    def __init__(self, message: object = "") -> None:
        """Join the lines of a message, which may quote an error of another library."""
        super().__init__(" ".join(map(str.strip, str(message).splitlines())))


class InputError(TiltsimError):
    """Invalid input of the user; the message is one line to show.

    ``missing`` are the dotted keys that a document lacks.
    """

    def __init__(self, message: str, missing: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.missing = frozenset(missing)
