"""What can go wrong, in one line each."""

from __future__ import annotations


class TiltsimError(Exception):
    """Base of all errors that tiltsim raises on purpose."""


class InputError(TiltsimError):
    """The user gave something that cannot be used; the message is the one line to show."""
