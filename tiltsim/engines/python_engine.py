"""The Python engine: the traced control step as Python on floats."""

from collections.abc import Callable
from functools import lru_cache, partial
from struct import Struct
from typing import Any

import mujoco

from tiltsim.closed_loop.assembly import Assembly, ProgramKey, program_key
from tiltsim.closed_loop.userdata import CONTROL_PERIOD, EVALUATIONS, HEADER_SIZE
from tiltsim.engines.base import Callback, Engine, EngineName, check_model, vectors_of
from tiltsim.engines.programs import KEPT, LoopPrograms, setup_of
from tiltsim.system.files import one_thread_at_a_time
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.code.python_source import python_function


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def control_program(key: ProgramKey, name: str) -> Program:
    """A program of `LoopPrograms.in_mujoco`."""
    return LoopPrograms(key).in_mujoco(name)[name]


def control_step(assembly: Assembly, user: list[float], name: str) -> Callable[..., Any]:
    """A function ``(header, *vectors, ctrl)`` of a loop, with parameters and knots bound.

    The vectors are `tiltsim.engines.base.Vectors`.

    Expressions of these alone are evaluated once.

    Args:
        assembly: The flight.
        user: Parameters and knots.
        name: See `LoopPrograms.in_mujoco`.
    """
    key = program_key(assembly)
    if assembly.traced:
        return python_function(control_program(key, name), name, fixed={"user": user})
    return LoopPrograms(key).functions_in_mujoco()[name].plain(setup_of(assembly.loop, user))


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
