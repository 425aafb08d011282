"""Exceptions with one-line messages."""

from __future__ import annotations


class TiltsimError(Exception):
    """Base of all errors that tiltsim raises deliberately."""


class InputError(TiltsimError):
    """Invalid input of the user; the message is one line to show."""
