"""The JSON Schema of a file as a tree of tables and keys, with their kinds and units."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Final, get_args

from tiltsim.system.public import public
from tiltsim.system.text import SUBSCRIPTS, Quantity, in_words

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pydantic import BaseModel

TAG_KEYS: Final = ("type", "law", "model")  # keys whose value decides which other keys a table has
_UNIT: Final = re.compile(r"(.*) \[([^]]+)\]", re.DOTALL)  # a description that ends with a unit


@dataclass(frozen=True)
class Node:
    """A table, a key or an entry of a list."""

    value: dict[str, Any]  # its schema
    definitions: dict[str, Any]  # the tables of the document by name
    name: str = ""  # the table's name there; empty for the document and for keys

    def _at(self, value: dict[str, Any]) -> Node:
        return Node(value, self.definitions)

    @property
    def options(self) -> list[Node]:
        """Alternatives of a key, with tables in place of references; itself if it has none."""
        if "$ref" in self.value:
            name = self.value["$ref"].rpartition("/")[2]
            return [Node(self.definitions[name], self.definitions, name)]
        options = [*self.value.get("anyOf", ()), *self.value.get("oneOf", ())]
        return [node for one in options for node in self._at(one).options] or [self]

    @property
    def properties(self) -> dict[str, Node]:
        """The keys of a table."""
        return {name: self._at(key) for name, key in self.value.get("properties", {}).items()}

    @property
    def tables(self) -> list[Node]:
        """The tables among the options."""
        return [option for option in self.options if "properties" in option.value]

    @property
    def all_tables(self) -> list[Node]:
        """The tables among the options, and in their lists and named tables."""
        named = [list(one.value.get("patternProperties", {}).values()) for one in self.options]
        found = self.tables
        for option, patterns in zip(self.options, named):
            for entry in [*option.entries, *map(self._at, patterns)]:
                found += entry.all_tables
        return found

    @property
    def entries(self) -> list[Node]:
        """The entries of a list: one for each of a fixed number, else one for all."""
        items = [self.value["items"]] if "items" in self.value else []
        return [self._at(entry) for entry in self.value.get("prefixItems") or items]

    @property
    def choices(self) -> list[str]:
        """The names that a key may have as its value."""
        return [
            choice
            for one in self.options
            for choice in (
                [one.value["const"]] if "const" in one.value else one.value.get("enum", ())
            )
        ]

    @property
    def tag(self) -> str:
        """The key that discriminates a table from others; empty if there is none."""
        return next((key for key in TAG_KEYS if key in self.value.get("properties", {})), "")

    @property
    def kinds(self) -> list[str]:
        """The values of a table's tag."""
        return self.properties[self.tag].choices if self.tag else []

    @property
    def has_numbers(self) -> bool:
        """Whether a key takes numbers that may have a unit; whole numbers count or name things."""
        return any(
            one.value.get("type") == "number" or any(entry.has_numbers for entry in one.entries)
            for one in self.options
        )

    @property
    def meaning_and_unit(self) -> tuple[str, str]:
        """The description of a key without its unit, and the unit; ``-`` for a number without."""
        text = self.value.get("description", "")
        match = _UNIT.fullmatch(text)
        return (match[1], match[2]) if match else (text, "")

    def member(self, part: object) -> Node:
        """The node under one part of a location; several tables are searched by their tag."""
        tables = self.tables
        for option in self.options:
            if isinstance(part, int) and option.entries:
                return option.entries[min(part, len(option.entries) - 1)]
        for table in tables:
            if len(tables) > 1 and part in (table.kinds if table.tag else ["table"]):
                return table
            if len(tables) == 1 or not table.tag:
                key = table.properties.get(str(part))
                if key is not None or part == "table":
                    return key or table
        return self

    def at(self, location: Iterable[object]) -> Node:
        """The node under a location."""
        node = self
        for part in location:
            node = node.member(part)
        return node

    def dotted_keys(self) -> list[str]:
        """Every key in a table and the tables in it, dotted, once."""
        keys = []
        for table in self.all_tables:
            for name, key in table.properties.items():
                keys += [name, *(f"{name}.{below}" for below in key.dotted_keys())]
        return list(dict.fromkeys(keys))


@cache
def schema_of(table: type[BaseModel]) -> Node:
    """The schema of a document that is validated against a table."""
    value = table.model_json_schema()
    return Node(value, value.get("$defs", {}))


def share_keys(table: type[BaseModel], one: object, other: object) -> bool:
    """Whether two kinds, such as ``trot_instant``, have one declaration of their keys.

    Args:
        table: The base of all tables; its subclasses are searched.
        one, other: The kinds; anything but text is none.
    """
    fields = table.model_fields
    tag = next((key for key in TAG_KEYS if key in fields), None)
    kinds = get_args(fields[tag].annotation) if tag else ()
    return (one in kinds and other in kinds) or any(
        share_keys(subclass, one, other) for subclass in table.__subclasses__()
    )


_WITHOUT_NAME: Final = ("simulation", "vehicle", "controller", "sensors")
"""Tables whose keys speak for themselves."""

_ENTRIES: Final = {
    **dict.fromkeys(("position", "velocity", "offset", "wind", "inertia"), ("x", "y", "z")),
    "attitude": ("roll", "pitch", "yaw"),
    "angles": tuple(f"α{SUBSCRIPTS[rotor]}" for rotor in (1, 2, 3, 4)),
}
"""Names of the entries of a list, by the last part of its key."""


@cache
def quantity_of_key(key: str) -> Quantity:
    """Name of a key in figures, such as ``gait.period``, and its unit; also for unknown keys."""
    path, bracket, index = key.rpartition("[") if key.endswith("]") else (key, "", "")
    name = re.sub(r"\[\d+\]", "", path)
    table, dot, rest = path.partition(".")
    label = in_words(rest if dot and table in _WITHOUT_NAME else path)
    if bracket:
        entries = enumerate(_ENTRIES.get(name.rpartition(".")[2], ()))
        label += " " + {f"{i}]": entry for i, entry in entries}.get(index, f"[{index}")
    nodes = [schema_of(public("Scenario"))]
    for part in name.split("."):
        tables = [table for node in nodes for table in node.all_tables]
        nodes = [table.properties[part] for table in tables if part in table.properties]
    units = [unit for _, unit in (node.meaning_and_unit for node in nodes) if unit]
    return Quantity(label, units[0].replace("-", "") if units else "")
