"""The tables and keys that a JSON Schema describes, in words: on the terminal, or as Markdown."""

import json
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import pi
from typing import Any, Final, NamedTuple

from tiltsim.commands.text import markdown_table
from tiltsim.errors import InputError
from tiltsim.scenario.messages import did_you_mean
from tiltsim.scenario.schema import TAG_KEYS, Node

PLURAL: Final = re.compile(r"^(number|whole number|list|table)")

NO_LIMIT: Final = 1e6  # bounds from here on only keep arithmetic from overflowing, and are left out

INTRODUCTION: Final = """\
# Scenario file

Every key of a scenario file, with its unit, default and allowed values. `tiltsim schema gait.walk`
prints one table on the terminal; `tiltsim schema > scenario.schema.json` writes the JSON Schema
with which editors complete and check the file. `tiltsim schema --markdown` prints this page.

A key that is left out has its default. Units are SI, angles are in radians; [-] marks numbers
without a unit. [Concepts](concepts.md) explains words, axes and signs. Numbers beyond a billion,
and coordinates beyond a million meters, are refused. Chapters (ch.) are chapters of the thesis.

`--set simulation.duration=20` on the command line and `{"simulation.duration": 20}` in Python
change a key without editing the file; entries of lists are counted from 0:
`--set 'gait.angles[0]=0.2'`.
"""
WORD: Final = re.compile(r"[\w-]+")
NOT_IN_ANCHOR: Final = re.compile(r"[^\w-]")  # characters that the anchor of a heading leaves out
BOUNDED: Final = re.compile(r"^number(, | (?=[<>]))")  # a number, as its bounds tell
EVIDENT: Final = ('"', "true", "number", "whole")  # starts of values that need no example
FEW: Final = 2  # most tables of one address that are printed in full; more are listed


class Step(NamedTuple):
    """A part of a table's place in the file, such as ``gait`` with the tags of one of its types."""

    name: str
    tags: tuple[str, ...] = ()
    is_list: bool = False  # a list of tables
    is_named: bool = False  # tables whose names are the user's

    @property
    def written(self) -> str:
        """As written in the head of the table."""
        return f"{self.name}.your-name" if self.is_named else self.name


Place = tuple[Step, ...]  # where a table is in the file; empty for the file itself


@dataclass(frozen=True)
class Key:
    """A key of a table. Values are written as in TOML."""

    name: str
    values: str  # type and allowed values
    unit: str  # "-" if it has numbers without a unit; empty if it has none
    default: str  # "required", or empty if there is none
    meaning: str
    example: str = field(compare=False)  # empty for tables, which have their own


@dataclass(frozen=True)
class KeyTable:
    """A table of the file, which may stand in several places."""

    name: str  # in the schema; empty for the file itself
    places: tuple[Place, ...]
    meaning: str
    keys: tuple[Key, ...]
    toml: str  # a scenario with this table and the keys that it requires

    def addresses(self) -> list[str]:
        """Every name by which people ask for it: ``gait``, ``gait.walk``, ``gait.run``, ..."""
        names = []
        for place in self.places:
            parts = [(step.name, *(f"{step.name}.{tag}" for tag in step.tags)) for step in place]
            names += [".".join(part) for part in product(*parts)]
        return names


def key_tables(schema: dict[str, Any]) -> list[KeyTable]:
    """The tables of a schema, each after the one that contains it; the document itself first."""
    tables: dict[str, KeyTable] = {}

    def visit(table: Node, place: Place, above: str) -> None:
        if table.name in tables:
            known = tables[table.name]
            tables[table.name] = replace(known, places=(*known.places, place))
        else:
            toml = above + _toml(table, place, table.value.get("examples", [{}])[0])
            required, meaning = table.value.get("required", ()), table.value.get("description", "")
            keys = [_key(name, node, name in required) for name, node in table.properties.items()]
            keys.sort(key=lambda key: (key.name not in TAG_KEYS, key.default != "required"))
            tables[table.name] = KeyTable(table.name, (place,), meaning, tuple(keys), toml)
        for key, node in table.properties.items():
            if table.name == "Variant" and key in schema["properties"]:
                continue  # a variant may have every key of the document
            members = node.all_tables
            for member in members:
                tags = tuple(member.kinds) if len(members) > 1 else ()
                is_list = node.value.get("type") == "array"
                step = Step(key, tags, is_list, "patternProperties" in node.value)
                visit(member, (*place, step), _needed_by(key, table, place))

    visit(Node(schema, schema["$defs"]), (), "")
    return list(tables.values())


def _key(name: str, node: Node, required: bool) -> Key:
    meaning, unit = node.meaning_and_unit
    if not node.has_numbers:
        meaning, unit = node.value.get("description", ""), ""
    default = node.value.get("default")
    shown = "" if isinstance(default, dict) else _written(default)
    return Key(
        name,
        _values(node),
        unit,
        "required" if required else shown,
        meaning,
        _written(_example(node)),
    )


def _example(node: Node) -> Any:
    """A value to show: as declared, else not the default, else the default; None for tables."""
    default, choices = node.value.get("default"), node.choices
    if "examples" in node.value:
        return node.value["examples"][0]
    if isinstance(default, bool):
        return not default
    if node.all_tables and not choices:
        return None
    return next((choice for choice in choices if choice != default), default)


def _needed_by(key: str, table: Node, place: Place) -> str:
    """The part of a scenario that a table needs above it: its owner's kind, or else an example."""
    tagged = bool(place) and bool(place[-1].tags)
    example = {} if tagged else table.value.get("examples", [{}])[0]
    toml = _toml(table, place, example, without=key)
    return f"{toml}\n" if toml.count("\n") > 1 else ""


def head_of(place: Place) -> str:
    """The line that begins a table in TOML."""
    name = ".".join(step.written for step in place)
    return f"[[{name}]]" if place[-1].is_list else f"[{name}]"


def _toml(table: Node, place: Place, example: dict[str, Any], without: str = "") -> str:
    """A table as it is written, with the keys that it requires and the keys of an example."""
    if not place:
        return ""
    shown = {*table.value.get("required", ()), *example} - {without}
    values = {key: _example(node) for key, node in table.properties.items()} | example
    lines = [f"{key} = {_written(values[key])}" for key in values if key in shown]
    lines.sort(key=lambda line: not line.startswith(TAG_KEYS))
    return "\n".join([head_of(place), *lines]) + "\n"


def _written(value: Any) -> str:
    """A value as in TOML; empty for None."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_written(item)}" for key, item in value.items()) + " }"
    if isinstance(value, float):
        return str(float(f"{value:.6g}"))
    return "" if value is None else json.dumps(value)


def _values(node: Node) -> str:
    """Type and allowed values of a key in words."""
    names = [f'"{choice}"' for choice in node.choices if node.options == [node]]
    if names:
        return ", ".join(names if len(names) <= 12 else [*names[:2], "..."])
    if node.options != [node]:
        return ", or ".join(dict.fromkeys(filter(None, map(_values, node.options))))
    kind = node.value.get("type", "any value")
    if kind == "array":
        count = f"{len(node.entries)} " if "prefixItems" in node.value else ""
        return f"list of {count}" + PLURAL.sub(r"\1s", _values(node.entries[0]), count=1)
    number = {"number": "number", "integer": "whole number"}.get(kind)
    words = {"boolean": "true, false", "string": "text", "null": "", "object": "table"}
    return number + _bounds(node.value) if number else words.get(kind, kind)


def _bounds(value: dict[str, Any]) -> str:
    """The bounds of a number, such as `` > 0, <= 1``."""
    signs = (
        ("minimum", ">="),
        ("exclusiveMinimum", ">"),
        ("maximum", "<="),
        ("exclusiveMaximum", "<"),
    )
    limits = [
        f"{sign} {_limit(value[key])}"
        for key, sign in signs
        if abs(value.get(key, NO_LIMIT)) < NO_LIMIT
    ]
    if {"minimum", "maximum"} <= value.keys() and len(limits) == 2:
        return f", {_limit(value['minimum'])} to {_limit(value['maximum'])}"
    return " " + ", ".join(limits) if limits else ""


def _limit(bound: float) -> str:
    """A bound, as a fraction of pi where it is one."""
    for part in (1, 2, 4):
        if abs(bound) == pi / part:
            return ("-" if bound < 0 else "") + ("pi" if part == 1 else f"pi/{part}")
    return f"{bound:g}"


def page(tables: Sequence[KeyTable]) -> str:
    """All tables as Markdown."""
    document, *others = tables
    chapters = {table.places[0][0].name: table.places[0][:1] for table in others}
    meanings = {key.name: _sentence(key.meaning) for key in document.keys}
    overview = [
        (f"[`{head_of(place)}`](#{NOT_IN_ANCHOR.sub('', head_of(place))})", meanings[name])
        for name, place in chapters.items()
    ]
    parts = [INTRODUCTION, *markdown_table(("table", "meaning"), overview)]
    parts += ["", "## Keys before all tables", ""]
    parts += [_item(key) for key in document.keys if key.name not in chapters]
    for name, place in chapters.items():
        parts += ["", f"## `{head_of(place)}`"]
        own = [table for table in others if table.places[0][0].name == name]
        counts = Counter(key for table in own for key in table.keys)
        shared = [key for key, count in counts.items() if count > 1]
        if shared:
            parts += ["", "Keys that several of the following tables have:", ""]
            parts += map(_item, shared)
        above = {*document.keys, *shared}
        parts += [line for table in own for line in _section(table, above)]
    return "\n".join(parts) + "\n"


def description(tables: Sequence[KeyTable], address: str) -> str:
    """The tables, or the keys, with an address, for the terminal.

    Raises `InputError`, with the closest address, if there are none.
    """
    plain = address.replace("[", "").replace("]", "")
    found = [table for table in tables if plain and plain in table.addresses()]
    if len(found) > FEW:
        lines = [f"- {_narrow(table)}: {_plain(table.meaning)}" for table in found]
        return "\n".join([*lines, "\ntiltsim schema ADDRESS prints the keys of one of these"])
    if found:
        return "\n".join(line for table in found for line in _section(table)).strip()
    above, _, name = plain.rpartition(".")
    keys = [
        f"{_narrow(table) or 'before all tables'}\n{_item(key)}"
        for table in tables
        if above in table.addresses()
        for key in table.keys
        if key.name == name
    ]
    if not keys:
        known = [name for table in tables for name in table.addresses() if name]
        hint = did_you_mean(plain, known) + "tiltsim schema --markdown prints them all"
        raise InputError(f"{address or repr(address)}: no such table or key; {hint}")
    return "\n".join(keys)


def _section(table: KeyTable, above: Collection[Key] = ()) -> list[str]:
    """Lines about one table, with only the names of keys that stand above."""
    place = table.places[0]
    title = ["", f"### {_title(table)}"] if len(place) > 1 or place[0].tags else []
    toml = ["```toml", *table.toml.splitlines(), "```"]
    known = [key for key in table.keys if key in above]
    own = [key for key in table.keys if key not in known and not _is_only_kind(key)]
    others = ", ".join(f"`{key.name}`" for key in known)
    items = [*map(_item, own), *([f"- Also {others}."] if others else [])]
    return [*title, "", _meaning(table), "", *toml, "", *items]


def _is_only_kind(key: Key) -> bool:
    """Whether a key says which kind the table is, and leaves no choice."""
    return key.name in TAG_KEYS and "," not in key.values


def _meaning(table: KeyTable) -> str:
    """The description of a table and of its kind, without the one whose words the other has."""
    texts = [_plain(table.meaning).rstrip(".")]
    texts += [key.meaning for key in table.keys if _is_only_kind(key)]
    words = [set(WORD.findall(text.lower())) for text in texts]
    kept = [
        text
        for number, text in enumerate(texts)
        if not any(words[number] < other for other in words) and words[number] not in words[:number]
    ]
    return _sentence("; ".join(kept))


def _title(table: KeyTable) -> str:
    """The heads of a table, with its kinds and the kinds of the table that contains it."""
    heads = dict.fromkeys(f"`{head_of(place)}`" for place in table.places)
    kinds = [f"`{tag}`" for tag in table.places[0][-1].tags]
    owners = dict.fromkeys(f"`{t}`" for place in table.places for s in place[:-1] for t in s.tags)
    parts = (", ".join(heads), ": " if kinds else "", ", ".join(kinds))
    return "".join(parts) + (f" of {', '.join(owners)}" if owners else "")


def _narrow(table: KeyTable) -> str:
    """The addresses of a table that tell it from others: all tags are in them."""
    most = max(name.count(".") for name in table.addresses())
    return ", ".join(name for name in table.addresses() if name.count(".") == most)


def _item(key: Key) -> str:
    """A key as an item of a list, with an example where it says more than the values."""
    unit = f" [{key.unit}]" if key.unit else ""
    required = key.default == "required"
    default = ", required" if required else f", default `{key.default}`" if key.default else ""
    plain = key.example and key.example != key.default and not key.values.startswith(EVIDENT)
    example = f"; example `{key.example}`" if plain else ""
    values = BOUNDED.sub("", key.values).replace("list of 3 ", "3 ")
    return f"- `{key.name}` ({values}{unit}{default}): {key.meaning}{example}"


def _plain(docstring: str) -> str:
    """A docstring's paragraphs as one, with single backquotes."""
    return " ".join(docstring.split()).replace("``", "`")


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
