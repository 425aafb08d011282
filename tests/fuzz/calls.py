"""Calls of the public Python names, with arguments of every kind."""

from __future__ import annotations

import inspect
from functools import cache

import numpy as np

import tiltsim
from tests.arguments import ADDRESS, Speechless, Unreadable, hover
from tests.flights import flight
from tests.fuzz.documents import STRANGE

TABLES = {"simulation": {"duration": 0.004, "timestep": 0.002, "engine": "python"}}
THESIS = {"simulation": {**TABLES["simulation"], "plant": "thesis"}}
GAIT = {"time": [0.0, 1.0], **{f"alpha_{i}": [0.1, 0.2] for i in range(1, 5)}}

RECORDS = (
    *("Airframe", "Command", "End", "Flight", "Observation", "LawController", "Observed"),
    *("InputError", "TiltsimError", "law", "xp"),
)
"""Public names that nobody calls with unchecked arguments."""


ODD = (
    *STRANGE,
    *(None, -1, 10**400, 1j, int, object(), Speechless(), Unreadable(), b"bytes", ..., {1: 2}),
    *(np.zeros(3), np.ones((2, 2), int), np.array("text"), np.array([1, None]), np.float64("nan")),
    *(np.datetime64("2020-01-01"), np.array([10**400]), range(3), {1, 2}, (1, "a"), lambda: 1 / 0),
)
"""Values that an argument rarely takes."""


@cache
def likely():
    """Values of arguments by name."""
    scenario = tiltsim.parse_scenario(TABLES)
    sources = [ADDRESS, TABLES, THESIS, scenario, {}]
    return {
        "scenario": sources,
        "source": sources,
        "document": [TABLES, THESIS],
        "scenarios": [[TABLES], [scenario, TABLES], []],
        "path": ["none", ".", "a.mp4"],
        "flight": [flight("fixed")],
        "flights": [flight("fixed"), [flight("fixed"), flight("trot")]],
        "overrides": [{"vehicle.mass": 0.5}, {"gait.period": 10**400}],
        "changes": [{"vehicle.mass": 0.5}, {"gait.period": 10**400}],
        "controller": [hover, "none.py:law"],
        "reference": [lambda time: (time, 0.0, 0.0), {"time": [0, 1], "x": [0, 1]}],
        "gait": [GAIT, lambda _time: (0.1, 0.2, 0.3, 0.4)],
        "observer": [print, lambda _sample: None],
        "progress": [None, lambda *_: None],
        "panels": ["margin", ["attitude", "position"]],
        "size": [(3, 3), "80mm x 60mm"],
        "steps": [1, 2],
        "action": [np.zeros(8)],
        "axes": [("roll", "pitch")],
        "near": [None],
        "parameters": [{}, {"vehicle": {"mass": 0.5}}],
        "url": ["x", "rerun+http://"],
        "threads": [1],
        "jobs": [1],
        "out": [None],
        "cls": [],
    }


def _argument(random, name):
    values = likely().get(name, ())
    # Mistakes of functions that only listen are the caller's own.
    odd = [v for v in ODD if not (name in {"progress", "observer"} and callable(v))]
    return random.choice(values if values and random.random() < 0.6 else odd)


def _arguments(random, function):
    """Arguments of a call: those without a default, and some of the others."""
    given = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        if parameter.default is parameter.empty or random.random() < 0.3:
            given[name] = _argument(random, name)
    return given


def _functions():
    """Public functions by name, and methods of their results."""
    import tiltsim.env

    found = {name: getattr(tiltsim, name) for name in tiltsim.__all__ if name not in RECORDS}
    made = flight("fixed")
    simulation = tiltsim.Simulation(TABLES)
    environment = tiltsim.env.TiltrotorEnv(TABLES | {"simulation": {"duration": 0.1}})
    found |= {
        "Simulation.step": simulation.step,
        "Scenario.replace": tiltsim.parse_scenario(TABLES).replace,
        "Flight.plot": made.plot,
        "Flight.column": made.__getitem__,
        "TiltrotorEnv": tiltsim.env.TiltrotorEnv,
        "TiltrotorEnv.step": environment.step,
        "Vectorized.fly": tiltsim.vectorized(THESIS).fly,
    }
    return found


functions = cache(_functions)


def python_call(random, _folder):
    """A call of a public function or method."""
    name, function = random.choice(sorted(functions().items()))
    given = {key: value for key, value in _arguments(random, function).items() if key != "_time"}
    if name in {"Scenario", "TiltrotorEnv.step"} and random.random() < 0.5:
        given = {key: _argument(random, key) for key in [*given][:1]}
    if name == "view":  # else a window opens
        given["flights"] = random.choice(ODD)
    if "trusted" in given and name == "sweep":
        given["trusted"] = False
    if name == "sweep":
        given["out"] = random.choice((None, 3, [], "\0"))
    if name == "video":
        given["path"] = random.choice((3, "a.avi", "none/a.mp4"))

    def call():
        try:
            result = function(**given)
            if name == "fly":
                list(result)
        except ValueError:
            if name != "TiltrotorEnv.step":  # as documented
                raise

    return call
