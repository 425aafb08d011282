"""Kinds of vehicles: each file here declares one, with the tables of its vehicle, gaits and laws.

All files of this folder are discovered at import; no other file names their declarations.
"""

import sys
from collections.abc import Iterable, Mapping
from functools import reduce
from importlib import import_module
from operator import or_
from pkgutil import iter_modules
from typing import Annotated, Any, Final, TypeVar, get_args

from pydantic import Discriminator, Tag

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


def union_of(tables: Mapping[str, type[Table]], key: str, default: str) -> Any:
    """Tables as one type, by the values of a key, which may be left out for a default."""
    tags = {table: name for name, table in reversed([*tables.items()])}

    def tag(value: Any) -> str:
        given = value.get(key, default) if isinstance(value, dict) else getattr(value, key, default)
        name = given if isinstance(given, str) else ""
        return tags[tables[name]] if name in tables else name

    tagged = (Annotated[table, Tag(tags[table])] for table in dict.fromkeys(tables.values()))
    return Annotated[reduce(or_, tagged), Discriminator(tag)]
