"""The Python engine: the traced control step as Python on floats."""

from collections.abc import Callable
from functools import lru_cache, partial
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
from tiltsim.engines.base import Callback, Engine, EngineName, check_model, vectors_of
from tiltsim.engines.programs import KEPT, LoopPrograms
from tiltsim.system.files import one_thread_at_a_time
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.records import unflatten
from tiltsim_controllers.mathematics.scalar import Values, Vector


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def control_program(key: ProgramKey, name: str) -> Program:
    """A program of `LoopPrograms.in_mujoco`."""
    return LoopPrograms(key).in_mujoco(name)[name]


def control_step(assembly: Assembly, user: list[float], name: str) -> Callable[..., Values]:
    """A function ``(header, *vectors, ctrl)`` of a loop, with parameters and knots bound.

    The vectors are `tiltsim.engines.base.Vectors`.

    Expressions of these alone are evaluated once.

    Args:
        assembly: The flight.
        user: Parameters and knots.
        name: See `LoopPrograms.in_mujoco`.
    """
    loop = assembly.loop
    if assembly.traced:
        program = control_program(program_key(assembly), name)
        return python_function(program, name, fixed={"user": user})
    parameters = unflatten(loop.parameters, user)
    knots = tuple(user[loop.record_size :])

    def time_of(header: list[float]) -> float:
        numbers = header[EVALUATIONS], header[EVALUATIONS_PER_STEP], header[TIMESTEP]
        return evaluation_time(*numbers)

    def controls(header: list[float], qpos: Vector, qvel: Vector, *act: Vector) -> Values:
        seen = [number for part in act[:-1] for number in part]
        return loop.sampling.controls(time_of(header), qpos, qvel, seen, parameters, knots)

    def hold(header: list[float], qpos: Vector, qvel: Vector, *act: Vector) -> Values:
        seen, ctrl = [number for part in act[:-1] for number in part], act[-1]
        return loop.sampling.hold(time_of(header), qpos, qvel, seen, ctrl, parameters)

    def observe(_header: list[float], qpos: Vector, qvel: Vector, *act: Vector) -> Values:
        seen = [number for part in act[:-1] for number in part]
        return loop.columns.observe(qpos, qvel, seen, act[-1])

    return {"controls": controls, "hold": hold, "observe": observe}[name]


class PythonEngine(Engine):
    """Runs the control step on Python floats."""

    name: EngineName = "python"

    def __init__(self, assembly: Assembly, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(assembly.loop, model, data)
        user = data.userdata[HEADER_SIZE:].tolist()
        controls = control_step(assembly, user, "controls")
        # Views of MuJoCo's memory; a look-up at every call would take a tenth of the callback.
        vectors: Any = *vectors_of(assembly.loop, data), data.ctrl
        qpos, qvel, act, others, history, ctrl = (memoryview(vector) for vector in vectors)
        header: Any = memoryview(data.userdata[:HEADER_SIZE])
        period = header[CONTROL_PERIOD]
        hold = control_step(assembly, user, "hold") if period else controls
        write_controls = partial(Struct(f"{len(ctrl)}d").pack_into, ctrl, 0)

        def evaluate(_model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data:
                return  # another model of this process
            count = header[EVALUATIONS]
            sampled = period == 0.0 or count % period == 0.0
            step = controls if sampled else hold
            held = () if sampled else ctrl.tolist()
            state = qpos.tolist(), qvel.tolist(), act.tolist(), others.tolist(), history.tolist()
            write_controls(*step(header.tolist(), *state, held))
            header[EVALUATIONS] = count + 1.0

        self._callback = evaluate

    def callback(self) -> Callback:
        return self._callback
