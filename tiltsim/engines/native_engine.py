"""The native engine: the control step as machine code in MuJoCo's control callback.

The callback reads MuJoCo's state in place (`tiltsim.engines.mjdata_layout`). It also records
samples, so that a flight of any length runs without returning to Python and without holding its
lock.
"""

import ctypes
from functools import cache, lru_cache
from math import nan
from typing import Any, Final

import mujoco

from tiltsim.closed_loop.assembly import Assembly, ProgramKey, program_key
from tiltsim.closed_loop.userdata import CONTROL_PERIOD, EVALUATIONS, HEADER_SIZE, RECORDER
from tiltsim.engines.base import Engine, EngineName, check_model
from tiltsim.engines.glue import CALLBACK, EMPTY, filled
from tiltsim.engines.glue import RECORDER as RECORDER_TEXT
from tiltsim.engines.machine_code import MachineCode
from tiltsim.engines.mjdata_layout import mjdata_layout
from tiltsim.engines.programs import KEPT, LoopPrograms
from tiltsim.system.files import one_thread_at_a_time
from tiltsim_controllers.code.llvm_text import llvm_functions

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
    code = MachineCode(
        llvm_functions(LoopPrograms(key).in_mujoco("controls", "hold", "sample")) + glue
    )
    return code.function("callback", None, _POINTER, _POINTER)


class NativeEngine(Engine):
    """Runs the control step as machine code."""

    name: EngineName = "native"

    def __init__(self, assembly: Assembly, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(assembly.loop, model, data)
        self._control = compile_control(program_key(assembly))

    def callback(self) -> Any:
        return self._control


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
