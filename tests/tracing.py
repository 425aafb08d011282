"""Coverage without its cost where it sees nothing new.

Its tracer makes flights in Python five times slower, importing, compiling and drawing twice.
Pausing it can only lower the coverage that is reported, never raise it.
"""

from __future__ import annotations

import difflib
import email
import sys
import tomllib
import warnings
from collections import Counter
from contextlib import suppress
from functools import wraps
from importlib.machinery import SourceFileLoader

OURS = {"tiltsim", "tiltsim_controllers", "tests"}
BEGINNING = 0.01  # s of every flight, traced in full
EVERY = 16  # call after that
ROWS = 3  # of every test


def untraced(function):
    """The function, hidden from tracers."""

    @wraps(function)
    def paused(*arguments, **keywords):
        # In one frame: a tracer keeps a stack of the frames that it has seen entered.
        tracer = sys.gettrace()
        sys.settrace(None)
        try:
            return function(*arguments, **keywords)
        finally:
            sys.settrace(tracer)

    return paused


def seldom_traced(function, begins=lambda *_: False):
    """The function with a sample of its calls traced, and the calls for which ``begins`` is true.

    Args:
        function: Called over and over, as a step of a flight.
        begins: A function of the same arguments.
    """
    calls, quick = 0, untraced(function)

    @wraps(function)
    def sampled(*arguments):
        nonlocal calls
        calls += 1
        seen = calls % EVERY == 0 or begins(*arguments)
        return (function if seen else quick)(*arguments)

    return sampled


def trace_seldom():
    """Have a tracer see samples of flights, and no long work of other packages."""
    _import_others_untraced()
    import sympy
    import tomli_w
    from _pytest.assertion import rewrite
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tiltsim.engines import programs, sample_evaluation
    from tiltsim.linear.motion import EquationMotion, MujocoMotion
    from tiltsim.plants.equations_plant import EquationsPlant
    from tiltsim.plants.mujoco_plant import MujocoPlant
    from tiltsim.plants.user_controller import UserControlledPlant

    def begins(plant, _steps):
        return plant.time < BEGINNING

    for plant in (MujocoPlant, EquationsPlant, UserControlledPlant):
        plant.advance = seldom_traced(plant.advance, begins)
    for motion in (EquationMotion, MujocoMotion):
        motion.flown = seldom_traced(motion.flown)
    elsewhere = {
        programs: ["program_of"],
        sample_evaluation: ["program_of"],
        difflib: ["get_close_matches"],
        email: ["message_from_string"],  # of a distribution's metadata
        tomllib: ["load", "loads"],
        tomli_w: ["dump", "dumps"],
        Figure: ["add_subplot", "draw", "legend", "savefig"],
        Axes: ["legend", "plot"],
        rewrite: ["rewrite_asserts"],
        sympy: ["diff", "expand", "simplify"],
        sympy.MatrixBase: ["det"],
    }
    with warnings.catch_warnings(), suppress(ImportError):
        warnings.filterwarnings("ignore", module="glfw")  # complains without a screen
        from dm_control import mjcf

        elsewhere |= {mjcf: ["from_xml_string"], mjcf.RootElement: ["to_xml_string"]}
    for owner, names in elsewhere.items():
        for name in names:
            setattr(owner, name, untraced(getattr(owner, name)))


def trace_few_rows(items):
    """Have a tracer see three rows of every test with many, and every eighth of the others.

    The control laws and their analysis are traced in all of them.
    """
    rows = Counter()
    for item in items:
        test = item.nodeid.partition("[")[0]
        rows[test] += 1
        if rows[test] > ROWS and rows[test] % 8 and not test.startswith("tests/controllers/"):
            item.obj = untraced(item.obj)


def _import_others_untraced():
    load = SourceFileLoader.exec_module
    load_untraced = untraced(load)

    def exec_module(loader, module):
        ours = module.__name__.partition(".")[0] in OURS
        (load if ours else load_untraced)(loader, module)

    SourceFileLoader.exec_module = exec_module
