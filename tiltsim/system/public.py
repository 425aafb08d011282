"""Public names of the package, for methods that are short for a function of a later folder."""

from __future__ import annotations

import sys
from typing import Any


def public(name: str) -> Any:
    """A public name of ``tiltsim``, imported on first use.

    Scenarios and flights have methods such as `Flight.plot`, so that a notebook needs no imports.
    The functions behind them lie in folders that import scenarios and flights, and only the package
    itself knows them all.
    """
    return getattr(sys.modules["tiltsim"], name)
