"""Labels and units of the keys of scenario files, from the descriptions in the schema."""

from functools import cache
from typing import Final

from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.schema import schema_of
from tiltsim.system.text import SUBSCRIPTS, Quantity, in_words

_WITHOUT_NAME: Final = ("simulation", "vehicle", "controller", "sensors")
"""Tables whose keys speak for themselves."""

_ENTRIES: Final = {
    **dict.fromkeys(("position", "velocity", "wind", "inertia"), ("x", "y", "z")),
    "attitude": ("roll", "pitch", "yaw"),
    "angles": tuple(f"α{SUBSCRIPTS[rotor]}" for rotor in (1, 2, 3, 4)),
}
"""Names of the entries of a list, by the last part of its key."""


@cache
def quantity_of_key(key: str) -> Quantity:
    """Name of a key in figures, such as ``gait.period``, and its unit; also for unknown keys."""
    name, bracket, index = key.partition("[")
    table, dot, rest = name.partition(".")
    label = in_words(rest if dot and table in _WITHOUT_NAME else name)
    if bracket:
        entries = dict(enumerate(_ENTRIES.get(name.rpartition(".")[2], ())))
        label += " " + entries.get(int(index.rstrip("]")), f"[{index}")
    nodes = [schema_of(Scenario)]
    for part in name.split("."):
        tables = [table for node in nodes for table in node.tables]
        nodes = [table.properties[part] for table in tables if part in table.properties]
    units = [unit for _, unit in (node.meaning_and_unit for node in nodes) if unit]
    return Quantity(label, units[0].replace("-", "") if units else "")
