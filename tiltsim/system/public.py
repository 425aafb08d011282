"""Public names of tiltsim, and packages that it uses where they are installed."""

import sys
from importlib import import_module
from typing import Any

from tiltsim.errors import InputError


def public(name: str) -> Any:
    """A public name of ``tiltsim``, imported on first use.

    Scenarios and flights have methods such as `Flight.plot`, so that a notebook needs no imports.
    The functions behind them lie in folders that import scenarios and flights, and only the package
    itself knows them all.
    """
    return getattr(sys.modules["tiltsim"], name)


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
