"""Exceptions with one-line messages."""

from __future__ import annotations

from collections.abc import Iterable


class TiltsimError(Exception):
    """Base of all errors that tiltsim raises deliberately."""


class InputError(TiltsimError):
    """Invalid input of the user; the message is one line to show.

    ``missing`` are the dotted keys that a document lacks.
    """

    def __init__(self, message: str, missing: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.missing = frozenset(missing)
