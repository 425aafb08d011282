"""How long a control step takes, in Python and compiled."""

from __future__ import annotations

from math import nan
from time import perf_counter
from typing import Final

import mujoco

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import CONTROL_PERIOD as PERIOD_IN_USERDATA
from tiltsim.closed_loop.userdata import Header
from tiltsim.engines.callback import control_callback
from tiltsim.engines.native_engine import compile_empty
from tiltsim.engines.python_engine import control_step
from tiltsim.laws.assembling import assemble
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.scenario.scenario import Scenario

CALLS: Final = 200
"""Control steps that are timed together."""

ROUNDS: Final = 40
"""Timings of compiled code, of which the least counts."""


def time_per_call(assembly: Assembly) -> float:
    """Seconds that one control step takes on the Python engine, the least of a few rounds."""
    loop, setup = assembly.loop, assembly.setup
    if assembly.scenario.controller.is_external:
        return nan
    qpos, qvel = loop.kind.initial_motion(assembly)
    act = tuple(map(float, loop.dynamics.initial_activations(assembly, setup)))
    header = [*Header(assembly.scenario.simulation.timestep)]
    none: list[float] = []
    vectors = [*map(float, qpos)], [*map(float, qvel)], [*act], none
    step = control_step(assembly, setup.userdata.tolist(), "controls")
    rounds = []
    for _ in range(3):
        start = perf_counter()
        for _ in range(CALLS):
            step(header, *vectors)
        rounds.append((perf_counter() - start) / CALLS)
    return min(rounds)


def compiled_time_per_call(scenario: Scenario) -> float:
    """Seconds that one control step takes in compiled code; NaN where it does not fly in MuJoCo.

    The difference, the least of a few rounds each, of MuJoCo's forward dynamics with the control
    step and with a callback that does nothing.
    """
    if scenario.controller.is_external or scenario.simulation.plant != "mujoco":
        return nan
    plant = MujocoPlant(assemble(scenario), engine="native")
    plant.data.userdata[PERIOD_IN_USERDATA] = 0.0  # the control step at every evaluation
    callbacks = plant.callback, compile_empty()
    rounds = []
    for _ in range(ROUNDS):  # by turns, as the speed of a machine changes
        for callback in callbacks:
            with control_callback(callback):
                start = perf_counter()
                for _ in range(CALLS):
                    mujoco.mj_forward(plant.model, plant.data)
                rounds.append((perf_counter() - start) / CALLS)
    return max(0.0, min(rounds[::2]) - min(rounds[1::2]))
