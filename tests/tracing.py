"""Coverage without its cost where it sees nothing new.

Its tracer makes flights in Python five times slower, and compiling or drawing half as slow again.
Pausing it can only lower the coverage that is reported, never raise it.
"""

from __future__ import annotations

import sys
from functools import wraps

BEGINNING = 0.05  # s of every flight, traced in full
EVERY = 16  # call after that


def untraced(function):
    """The same function, which no tracer sees."""

    @wraps(function)
    def paused(*arguments, **keywords):
        # In one and the same frame: a tracer keeps a stack of those that it has seen entered.
        tracer = sys.gettrace()
        sys.settrace(None)
        try:
            return function(*arguments, **keywords)
        finally:
            sys.settrace(tracer)

    return paused


def seldom_traced(function, begins=lambda *_: False):
    """The same function, of whose calls a tracer sees a sample, and those where ``begins`` says so.

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


def trace_seldom(patch):
    """Have a tracer see samples of flights, and nothing of what other packages compute at length.

    Args:
        patch: What replaces the functions, a `pytest.MonkeyPatch`.
    """
    import sympy
    from dm_control import mjcf
    from matplotlib.figure import Figure
    from numba.core import compiler

    from tiltsim.plants.mujoco_plant import MujocoPlant
    from tiltsim.plants.thesis_plant import ThesisPlant
    from tiltsim.plants.user_controller import UserControlledPlant

    def begins(plant, _steps):
        return plant.time < BEGINNING

    for plant in (MujocoPlant, ThesisPlant, UserControlledPlant):
        patch.setattr(plant, "advance", seldom_traced(plant.advance, begins))
    elsewhere = {
        compiler: ["compile_extra"],
        Figure: ["draw", "savefig"],
        mjcf: ["from_path"],
        mjcf.RootElement: ["to_xml_string"],
        sympy: ["diff", "expand", "simplify"],
        sympy.MatrixBase: ["det"],
    }
    for owner, names in elsewhere.items():
        for name in names:
            patch.setattr(owner, name, untraced(getattr(owner, name)))
