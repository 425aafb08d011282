"""The measures of claims: functions that rows name in the files of `tiltsim.report.claims`.

One module per subject. A measure returns a number, several numbers or a bool, computed within about
a second. One without a flight takes the row's ``args``; one of flights takes their metrics first, a
list in the order of the row. A flight that terminates early has ``diverged`` true in its metrics
and may lack others.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any


@cache
def measures() -> dict[str, Callable[..., Any]]:
    """All measures by name. Raises `ValueError` if two have the same."""
    found: dict[str, Callable[..., Any]] = {}
    for info in iter_modules(__path__):
        module = import_module(f"{__name__}.{info.name}")
        for name, value in vars(module).items():
            own = callable(value) and getattr(value, "__module__", "") == module.__name__
            if own and found.setdefault(name, value) is not value:
                raise ValueError(f"two measures have the name {name!r}")
    return found
