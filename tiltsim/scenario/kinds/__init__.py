"""Kinds of vehicles: each file here declares one, with the tables of its vehicle, gaits and laws.

All files of this folder are found by themselves; no other file names what they declare.
"""

import sys
from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from typing import Final, TypeVar, get_args

from tiltsim.scenario.table import Table

T = TypeVar("T", bound=Table)

KINDS: Final = tuple(
    import_module(f"{__name__}.{file.name}").__name__ for file in iter_modules(__path__)
)
"""The modules of the folder, in the order of their names."""


def tables_of(base: type[T], key: str, modules: Iterable[str]) -> dict[str, type[T]]:
    """Tables by the names that one of their keys may have, in the order of their definition.

    Args:
        base: Class of the tables.
        key: The key whose values are the names.
        modules: Names of the modules that define them.
    """
    return {
        name: table
        for module in modules
        for table in vars(sys.modules[module]).values()
        if isinstance(table, type) and issubclass(table, base) and table.__module__ == module
        for name in get_args(table.model_fields[key].annotation if key in table.model_fields else 0)
    }
