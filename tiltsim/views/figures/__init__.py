"""Figures in print quality, one module per subject, in one style.

Every function returns an independent matplotlib `Figure`. The modules are imported on first use,
so that commands name them at no cost.
"""

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    """A module of figures."""
    if name.startswith("_"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")
