"""The Python engine: the traced control step as Python on floats."""

from __future__ import annotations

from functools import cache, partial
from struct import Struct
from typing import Any

import mujoco

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.choices import ProgramKey, program_key
from tiltsim.closed_loop.userdata import CONTROL_PERIOD, EVALUATIONS, HEADER_SIZE
from tiltsim.engines.base import Callback, Engine, EngineName, check_model
from tiltsim.engines.programs import LoopPrograms
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.code.python_source import python_function


@one_thread_at_a_time
@cache
def _program(key: ProgramKey, name: str) -> Program:
    return LoopPrograms(key).in_mujoco(name)[name]


class PythonEngine(Engine):
    """Runs the control step on Python floats."""

    name: EngineName = "python"

    def __init__(self, assembly: Assembly, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(assembly.loop, model, data)
        key = program_key(assembly)
        # Parameters do not change during a flight; what depends on them alone is evaluated once.
        fixed = {"user": data.userdata[HEADER_SIZE:].tolist()}
        controls = python_function(_program(key, "controls"), "controls", fixed=fixed)
        # Views of MuJoCo's memory; a look-up at every call would take a tenth of the callback.
        vectors = data.qpos, data.qvel, data.act, data.ctrl
        qpos, qvel, act, ctrl = (memoryview(vector) for vector in vectors)
        header: Any = memoryview(data.userdata[:HEADER_SIZE])
        period = header[CONTROL_PERIOD]
        hold = python_function(_program(key, "hold"), "hold", fixed=fixed) if period else controls
        write_controls = partial(Struct(f"{len(ctrl)}d").pack_into, ctrl, 0)

        def evaluate(_model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data:
                return  # another model of this process
            count = header[EVALUATIONS]
            sampled = period == 0.0 or count % period == 0.0
            step = controls if sampled else hold
            held = () if sampled else ctrl.tolist()
            state = qpos.tolist(), qvel.tolist(), act.tolist()
            write_controls(*step(header.tolist(), *state, held))
            header[EVALUATIONS] = count + 1.0

        self._callback = evaluate

    def callback(self) -> Callback:
        return self._callback
