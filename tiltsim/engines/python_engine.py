"""The Python engine: the traced control step as Python on floats."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from struct import Struct
from typing import Any

import mujoco

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.choices import ProgramKey, program_key
from tiltsim.closed_loop.userdata import (
    CONTROL_PERIOD,
    EVALUATIONS,
    EVALUATIONS_PER_STEP,
    HEADER_SIZE,
    TIMESTEP,
    evaluation_time,
)
from tiltsim.engines.base import Callback, Engine, EngineName, check_model
from tiltsim.engines.programs import LoopPrograms
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.records import unflatten
from tiltsim_controllers.mathematics.scalar import Values, Vector


@one_thread_at_a_time
@cache
def _program(key: ProgramKey, name: str) -> Program:
    return LoopPrograms(key).in_mujoco(name)[name]


def _control_step(assembly: Assembly, user: list[float], name: str) -> Callable[..., Values]:
    """A control step ``(header, qpos, qvel, act, ctrl) -> ctrl``, with parameters and knots bound.

    What depends on these alone is evaluated once.
    """
    loop = assembly.loop
    if assembly.traced:
        return python_function(_program(program_key(assembly), name), name, fixed={"user": user})
    parameters = unflatten(loop.parameters, user)
    knots = tuple(user[loop.record_size :])

    def time_of(header: list[float]) -> float:
        numbers = header[EVALUATIONS], header[EVALUATIONS_PER_STEP], header[TIMESTEP]
        return evaluation_time(*numbers)

    def controls(header: list[float], *state: Vector) -> Values:
        return loop.sampling.controls(time_of(header), *state[:3], parameters, knots)

    def hold(header: list[float], *state: Vector) -> Values:
        return loop.sampling.hold(time_of(header), *state, parameters)

    return controls if name == "controls" else hold


class PythonEngine(Engine):
    """Runs the control step on Python floats."""

    name: EngineName = "python"

    def __init__(self, assembly: Assembly, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(assembly.loop, model, data)
        user = data.userdata[HEADER_SIZE:].tolist()
        controls = _control_step(assembly, user, "controls")
        # Views of MuJoCo's memory; a look-up at every call would take a tenth of the callback.
        vectors = data.qpos, data.qvel, data.act, data.ctrl
        qpos, qvel, act, ctrl = (memoryview(vector) for vector in vectors)
        header: Any = memoryview(data.userdata[:HEADER_SIZE])
        period = header[CONTROL_PERIOD]
        hold = _control_step(assembly, user, "hold") if period else controls
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
