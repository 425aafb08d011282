"""The keys of a file for people: some of them on the terminal, or all as a Markdown page."""

import re
from collections.abc import Iterable, Sequence
from textwrap import fill, indent
from typing import Final

from tiltsim.commands.key_tables import Key, KeyTable, head_of
from tiltsim.commands.text import markdown_table
from tiltsim.errors import InputError
from tiltsim.scenario.messages import did_you_mean

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

NOT_IN_ANCHOR: Final = re.compile(r"[^\w-]")  # characters that the anchor of a heading leaves out
FEW: Final = 2  # most tables of one address that are printed in full; more are listed


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
    parts += _key_grid(key for key in document.keys if key.name not in chapters)
    for name, place in chapters.items():
        parts += ["", f"## `{head_of(place)}`", *(["", meanings[name]] if place[0].tags else [])]
        parts += [
            line for table in others if table.places[0][0].name == name for line in _section(table)
        ]
    return "\n".join(parts) + "\n"


def description(tables: Sequence[KeyTable], address: str) -> str:
    """The tables, or the keys, with an address, for the terminal.

    Raises `InputError`, with the closest address, if there are none.
    """
    plain = address.replace("[", "").replace("]", "")
    found = [table for table in tables if plain and plain in table.addresses()]
    if len(found) > FEW:
        lines = [f"{_narrow(table)}\n{_body(_plain(table.meaning))}" for table in found]
        return "\n".join([*lines, "\ntiltsim schema ADDRESS prints the keys of one of these"])
    if found:
        return "\n\n".join(map(_text, found))
    above, _, name = plain.rpartition(".")
    keys = [
        f"{_narrow(table) or 'before all tables'}\n{_key_text(key)}"
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


def _section(table: KeyTable) -> list[str]:
    """Lines of the page about one table."""
    place = table.places[0]
    title = ["", f"### {_title(table)}"] if len(place) > 1 or place[0].tags else []
    toml = ["```toml", *table.toml.splitlines(), "```"]
    return [*title, "", _plain(table.meaning), "", *toml, "", *_key_grid(table.keys)]


def _title(table: KeyTable) -> str:
    """The heads of a table, with its kinds and the kinds of the table that contains it."""
    heads = dict.fromkeys(f"`{head_of(place)}`" for place in table.places)
    kinds = [f"`{tag}`" for tag in table.places[0][-1].tags]
    owners = dict.fromkeys(f"`{t}`" for place in table.places for s in place[:-1] for t in s.tags)
    parts = (", ".join(heads), ": " if kinds else "", ", ".join(kinds))
    return "".join(parts) + (f" of {', '.join(owners)}" if owners else "")


def _narrow(table: KeyTable) -> str:
    """The addresses of a table that tell it from others."""
    return ", ".join(name for name in table.addresses() if name.count(".") == table.depth)


def _key_grid(keys: Iterable[Key]) -> list[str]:
    return markdown_table(("key", "value and default", "meaning and example"), map(_row, keys))


def _row(key: Key) -> tuple[str, str, str]:
    unit = f" [{key.unit}]" if key.unit else ""
    required = key.default == "required"
    default = "<br>required" if required else f"<br>default `{key.default}`" if key.default else ""
    example = f"<br>`{key.name} = {key.example}`" if key.example else ""
    return f"`{key.name}`", key.values + unit + default, key.meaning + example


def _text(table: KeyTable) -> str:
    """A table, its keys and an example for the terminal."""
    parts = [_title(table).replace("`", ""), fill(_plain(table.meaning), 88), ""]
    parts += [*map(_key_text, table.keys), "\nfor example:\n"]
    return "\n".join([*parts, indent(table.toml.rstrip(), "  ")])


def _key_text(key: Key) -> str:
    unit = "dimensionless" if key.unit == "-" else key.unit
    default = key.default and (
        key.default if key.default == "required" else f"default {key.default}"
    )
    facts = "; ".join(filter(None, (key.values, unit, default)))
    return f"  {key.name}: {facts}\n{_body(key.meaning)}"


def _body(text: str) -> str:
    return fill(text, 88, initial_indent=" " * 6, subsequent_indent=" " * 6)


def _plain(docstring: str) -> str:
    """A docstring's paragraphs as one, with single backquotes."""
    return " ".join(docstring.split()).replace("``", "`")


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
