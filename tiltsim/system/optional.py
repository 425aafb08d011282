"""Packages that tiltsim uses where they are installed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from tiltsim.errors import InputError


def optional_package(name: str, purpose: str, distribution: str = "") -> Any:
    """A package by name. Raises `InputError` if it is not installed.

    ``purpose`` begins the message; ``distribution`` is the name for pip, if it differs.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InputError(
            f"{purpose} needs {name}, which is not installed: pip install {distribution or name}"
        ) from error
