"""Files whose Python code leaves a mark when it is executed."""

from __future__ import annotations

import json

MARKS = """
with open({mark!r}, "w"):
    pass
"""
LAWS = """
import tiltsim


@tiltsim.law
def numpy(observed):
    return tiltsim.Command(thrusts=[2.0] * 4)


def python(observation):
    return tiltsim.Command(thrusts=[2.0] * 4)
"""
SCENARIO = """
simulation = {{ duration = 0.02, timestep = 0.002, engine = "python" }}
vehicle = {{ model = "quadrotor" }}
controller = {{ law = "{law}", function = {function} }}
"""
SWEEP = """
scenario = "python.toml"
[[axis]]
type = "list"
key = "initial.position[0]"
values = [0.0, 0.1]
"""


def plant(folder, mark):
    """Write ``law.py``, ``numpy.toml`` and ``python.toml`` that fly it, and ``sweep.toml``."""
    (folder / "law.py").write_text(MARKS.format(mark=str(mark)) + LAWS)
    for law in ("numpy", "python"):
        (folder / f"{law}.toml").write_text(scenario(law, f"law.py:{law}"))
    (folder / "sweep.toml").write_text(SWEEP)


def scenario(law, function):
    """A short scenario with a law, ``numpy`` or ``python``, from a file."""
    return SCENARIO.format(law=law, function=json.dumps(function))


def gains(vehicles, name, of, table):
    """Tuned gains, as JSON: the table that the law ``name`` has, tuned for the table ``of``."""
    found = {vehicle: {name: {"of": of, "table": table}} for vehicle in vehicles}
    made = {"made": {"date": "", "commit": ""}, "seed": 1, "flights": 1, "gains": found}
    return json.dumps(made)
