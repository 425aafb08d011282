"""Engines: the control step as Python on floats, or as machine code in MuJoCo's control callback.

Machine code reads MuJoCo's state in place (`tiltsim.engines.machine_code`). It also records
samples, so that a flight of any length runs without returning to Python and without holding its
lock.
"""

import ctypes
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache, lru_cache, partial
from math import nan
from struct import Struct
from typing import Any, Final

import mujoco

from tiltsim.closed_loop.assembly import Assembly, ProgramKey, program_key
from tiltsim.closed_loop.userdata import CONTROL_PERIOD, EVALUATIONS, HEADER_SIZE, RECORDER
from tiltsim.engines.base import Callback, EngineName, check_model, vectors_of
from tiltsim.engines.glue import CALLBACK, EMPTY, filled
from tiltsim.engines.glue import RECORDER as RECORDER_TEXT
from tiltsim.engines.machine_code import MachineCode, mjdata_layout
from tiltsim.engines.programs import KEPT, LoopPrograms, control_program, setup_of
from tiltsim.system.files import one_thread_at_a_time
from tiltsim.system.hooks import mujoco_hooks
from tiltsim_controllers.code.llvm_text import llvm_functions
from tiltsim_controllers.code.python_source import python_function


def control_step(assembly: Assembly, user: list[float], name: str) -> Callable[..., Any]:
    """A function ``(header, *vectors, ctrl)`` of a loop, with parameters and knots bound.

    The vectors are `tiltsim.engines.base.Vectors`; the name is one of
    `tiltsim.engines.programs.LoopPrograms.functions_in_mujoco`. Expressions of parameters and
    knots alone are evaluated once.
    """
    key = program_key(assembly)
    if assembly.traced:
        return python_function(control_program(key, name), name, fixed={"user": user})
    return LoopPrograms(key).functions_in_mujoco()[name].plain(setup_of(assembly.loop, user))


def python_callback(assembly: Assembly, data: mujoco.MjData) -> Callback:
    """The control step on Python's floats; see `make_callback`."""
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

    return evaluate


def control_callback(callback: Any) -> AbstractContextManager[None]:
    """Install MuJoCo's control callback, or none, for the length of a ``with`` block.

    Threads take turns; see `tiltsim.system.hooks`. A native callback also stops MuJoCo's timers:
    nothing uses them, and reading the clock takes a tenth of a step.
    """
    clock = None
    if hasattr(callback, "argtypes"):  # a C function, as ctypes shows them
        clock = compile_stopped_clock()
    return mujoco_hooks(callback, clock)


_POINTER: Final = ctypes.c_void_p


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def compile_control(key: ProgramKey) -> Any:
    """The control callback of a loop; keep it as long as MuJoCo may call it."""
    loop = key.loop
    width = len(loop.sample_fields)
    glue = filled(
        CALLBACK + RECORDER_TEXT,
        **mjdata_layout()._asdict(),
        head=HEADER_SIZE + loop.record_size,
        header_size=HEADER_SIZE,
        signature=loop.signature,
        evaluations=EVALUATIONS,
        control_period=CONTROL_PERIOD,
        recorder=RECORDER,
        controls=loop.sizes.ctrl,
        vehicle_size=loop.sizes.qpos,
        nan=nan,
        width=width,
    )
    programs = {name: control_program(key, name) for name in ("controls", "hold", "sample")}
    code = MachineCode(llvm_functions(programs) + glue)
    return code.function("callback", None, _POINTER, _POINTER)


@cache
def _empty() -> MachineCode:
    return MachineCode(EMPTY)


@one_thread_at_a_time
@cache
def compile_empty() -> Any:
    """A callback that does nothing, for measurements."""
    return _empty().function("empty", None, _POINTER, _POINTER)


@one_thread_at_a_time
@cache
def compile_stopped_clock() -> Any:
    """A clock for MuJoCo's timers that always reads zero."""
    return _empty().function("clock", ctypes.c_double)


def make_callback(
    engine: EngineName, assembly: Assembly, model: mujoco.MjModel, data: mujoco.MjData
) -> Any:
    """The control callback of an engine: a Python function, or a C function as `ctypes` shows it.

    It evaluates the whole step or, between the samples of a held controller, only those controls
    that follow the state, as thrusts follow the rotor speeds.

    Args:
        engine: The engine.
        assembly: The flight.
        model, data: A model for its loop and its data, which has the parameters in ``userdata``.

    Raises:
        ValueError: If model and data do not belong to a flight of its loop.
    """
    check_model(assembly.loop, model, data)
    if engine == "python":
        return python_callback(assembly, data)
    return compile_control(program_key(assembly))
