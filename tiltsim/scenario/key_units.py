"""Labels and units of the keys of scenario files, from the descriptions in the schema."""

import re
from functools import cache
from typing import Final

from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.schema import schema_of
from tiltsim.system.text import SUBSCRIPTS, Quantity, in_words

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
    nodes = [schema_of(Scenario)]
    for part in name.split("."):
        tables = [table for node in nodes for table in node.all_tables]
        nodes = [table.properties[part] for table in tables if part in table.properties]
    units = [unit for _, unit in (node.meaning_and_unit for node in nodes) if unit]
    return Quantity(label, units[0].replace("-", "") if units else "")
