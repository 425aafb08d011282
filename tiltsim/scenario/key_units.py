"""Labels and units of the keys of scenario files, from the descriptions in the schema."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, Final

from tiltsim.scenario.messages import UNIT
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.quantity import SUBSCRIPTS, Quantity, in_words

_WITHOUT_NAME: Final = ("simulation", "vehicle", "controller", "sensors")
"""Tables whose keys speak for themselves."""

_ENTRIES: Final = {
    **dict.fromkeys(("position", "velocity", "wind", "inertia"), ("x", "y", "z")),
    "attitude": ("roll", "pitch", "yaw"),
    "angles": tuple(f"α{SUBSCRIPTS[rotor]}" for rotor in (1, 2, 3, 4)),
}
"""What the entries of a list are called, by the last part of its key."""


@cache
def quantity_of_key(key: str) -> Quantity:
    """What figures call a key, such as ``gait.period``, and its unit; also for unknown keys."""
    name, bracket, index = key.partition("[")
    table, dot, rest = name.partition(".")
    label = in_words(rest if dot and table in _WITHOUT_NAME else name)
    if bracket:
        entries = dict(enumerate(_ENTRIES.get(name.rpartition(".")[2], ())))
        label += " " + entries.get(int(index.rstrip("]")), f"[{index}")
    whole = Scenario.model_json_schema()
    nodes = [whole]
    for part in name.split("."):
        nodes = [child for node in nodes for child in _children(node, part, whole)]
    found = (UNIT.fullmatch(node.get("description", "")) for node in nodes)
    units = [match[2] for match in found if match is not None]
    return Quantity(label, units[0].replace("-", "") if units else "")


def _children(node: dict[str, Any], name: str, whole: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The property of this name in a node or in one of its alternatives."""
    if "$ref" in node:
        yield from _children(whole["$defs"][node["$ref"].rpartition("/")[2]], name, whole)
    for kind in ("anyOf", "oneOf", "allOf"):
        for alternative in node.get(kind, ()):
            yield from _children(alternative, name, whole)
    if name in node.get("properties", {}):
        yield node["properties"][name]
