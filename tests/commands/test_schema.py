"""The descriptions of keys by ``tiltsim schema``, and the page made of them."""

import re
import tomllib
from pathlib import Path
from typing import Annotated

import pytest
from pydantic import ConfigDict, TypeAdapter

from tiltsim.cli import main
from tiltsim.commands.files import scenario_schema, sweep_schema
from tiltsim.commands.key_tables import key_tables
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim.scenario.schema import TAG_KEYS, Node
from tiltsim.scenario.table import Table

SCHEMA = scenario_schema()
TABLES = key_tables(SCHEMA)
PAGE = Path(__file__).parents[2] / "docs" / "scenario.md"
DEFINITIONS = {"": SCHEMA} | SCHEMA["$defs"]
SWEEP = sweep_schema()
PROPERTIES = [
    (name, key, value)
    for name, table in {**SWEEP["$defs"], "Sweep": SWEEP, **DEFINITIONS}.items()
    for key, value in table["properties"].items()
]


@pytest.mark.parametrize(("address", "shown"), [("", "''"), ("[[]]", "[[]]"), ("gaits", "gaits")])
def test_an_address_without_a_table_is_one_line(address, shown, capsys):
    assert main(["schema", address]) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"tiltsim: {shown}: no such table or key; ")
    assert line.count("\n") == 1


def test_every_key_is_described():
    missing = [f"{name}.{key}" for name, key, value in PROPERTIES if not value.get("description")]
    assert not missing, "add Field(description=...) to these keys"


def test_every_number_has_a_unit():
    missing = [
        f"{name}.{key}"
        for name, key, value in PROPERTIES
        if (node := Node(value, {**SWEEP["$defs"], **DEFINITIONS})).has_numbers
        and not node.meaning_and_unit[1]
    ]
    assert not missing, "end these descriptions with the unit in brackets, or with [-]"


def test_page_is_current(capsys):
    assert main(["schema", "--markdown"]) == 0
    current = capsys.readouterr().out == PAGE.read_text(encoding="utf-8")
    assert current, "run tiltsim schema --markdown > docs/scenario.md"


def test_page_has_every_key_with_its_unit():
    text = PAGE.read_text(encoding="utf-8")
    assert {table.name for table in TABLES} == {*DEFINITIONS}
    for table in TABLES:
        assert {key.name for key in table.keys} == {*DEFINITIONS[table.name]["properties"]}
        before, _, after = text.partition(f"```toml\n{table.toml}```")
        section = after.partition("```toml")[0].partition("\n#")[0]
        shared = before.partition("\n## `[")[0] + before.rpartition("\n## ")[2].partition("\n#")[0]
        for key in table.keys if table.toml else ():
            if key.name in TAG_KEYS and key.values == key.example:
                words = re.findall(r"[\w-]+", key.meaning.lower())
                assert {*words} <= {*re.findall(r"[\w-]+", before.rpartition("\n#")[2].lower())}
                continue
            known = re.search(rf"\n- Also .*`{key.name}`", section)
            if known and table.name == "Variant":
                assert key.name in SCHEMA["properties"]
                continue
            item = (shared if known else section).partition(f"\n- `{key.name}` (")[2]
            item = item.partition("\n")[0]
            assert f": {key.meaning}" in item
            assert not key.unit or f" [{key.unit}]" in item


def classes(table):
    """Every table of the scenario file by the name of its class."""
    children = table.__subclasses__()
    return {table.__name__: table} | {k: v for child in children for k, v in classes(child).items()}


def test_links_of_the_page_lead_to_its_chapters():
    text = PAGE.read_text(encoding="utf-8")
    headings = {re.sub(r"[^\w-]", "", line) for line in re.findall(r"^## (.*)$", text, re.M)}
    assert {*re.findall(r"\(#(.*?)\)", text)} <= headings


def test_every_example_of_a_key_is_valid():
    named, tried = classes(Table), 0
    for name, key, value in PROPERTIES:
        field = named[name].model_fields.get(key) if name in named else None
        for example in value.get("examples", ()) if field else ():
            kind = Annotated[(field.annotation, None, *field.metadata)]
            TypeAdapter(kind, config=ConfigDict(strict=True)).validate_python(example)
            tried += 1
    assert tried > 100
    bare = [
        (t.name, k.name) for t in TABLES for k in t.keys if not (k.example or "table" in k.values)
    ]
    assert not bare, "add Field(examples=[...]) to these keys"


def test_every_example_of_a_table_is_valid():
    for table in TABLES[1:]:
        document = tomllib.loads(table.toml)
        document.pop("variant", None)
        ScenarioTables.model_validate(document)


def test_keys_of_one_table(capsys):
    assert main(["schema", "gait.walk"]) == 0
    text = capsys.readouterr().out
    assert "- `amplitude` (-pi to pi [rad], required): swing of a leg" in text
    assert '\n[gait]\ntype = "walk"\n' in text
    assert main(["schema", "[gait]"]) == 0
    kinds = capsys.readouterr().out
    assert "- gait.fixed: " in kinds
    assert "- gait.trot_instant, gait.trot_continuous: " in kinds
    assert "amplitude" not in kinds
    assert main(["schema", "gait.amplitude"]) == 0
    assert capsys.readouterr().out.count("- `amplitude` (") == 3
    assert main(["schema", "title"]) == 0
    assert "`title` (text" in capsys.readouterr().out
    assert main(["schema", "gait.wlk"]) == 2
    assert "did you mean gait.walk?" in capsys.readouterr().err
