"""The native engine: the scalar control step compiled as MuJoCo's control callback.

The callback reads MuJoCo's state in place (`tiltsim.engines.mjdata_layout`). It also records
samples, so that a flight of any length runs without returning to Python and without holding its
lock. Compiled code is cached on disk, keyed by the sources and versions that it was made from, and
loads in a fraction of the compilation time.
"""

from __future__ import annotations

from functools import cache
from math import nan
from typing import Any, Final

import mujoco
from numba import carray, types
from numba.np.unsafe.ndarray import to_fixed_tuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.closed_loop.userdata import (
    CONTROL_PERIOD,
    EVALUATIONS,
    EVALUATIONS_PER_STEP,
    HEADER_SIZE,
    RECORDER,
    TIMESTEP,
    evaluation_time,
)
from tiltsim.engines.base import Engine, EngineName, check_model
from tiltsim.engines.cache import announce_native_code, mark_native_code_compiled
from tiltsim.engines.compiling import compiled_callback, register_scalar_functions
from tiltsim.engines.mjdata_layout import mjdata_layout
from tiltsim.engines.native_memory import addresses_at, array_at, bytes_at, integers_at
from tiltsim.engines.recorder import record_sample, recording_is_over, sample_is_due
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.mathematics.records import record_dtype

_CONTROL_SIGNATURE: Final = types.void(types.intp, types.intp)


@one_thread_at_a_time
@cache
def compile_control(loop: ClosedLoop) -> Any:
    """Compile a loop's control step as a C callback, or load it from the cache on disk.

    The cache identifies the callback by the values it closes over, so these must pickle to the same
    bytes in every process: module-level functions, numbers and dtypes do. Keep a reference to it as
    long as MuJoCo may call it.
    """
    announce_native_code(loop.native_name("mujoco"))
    controls, hold, signature = loop.sampling.controls, loop.sampling.hold, loop.signature
    observe, watch = loop.columns.observe, loop.monitoring.sign_check_values
    register_scalar_functions()
    limit_exceeded = loop.kind.limit_exceeded
    nq, nv, na, nu = loop.dynamics.sizes
    at = mjdata_layout()
    head = HEADER_SIZE + loop.record_size
    layout = record_dtype(loop.parameters)

    @compiled_callback(_CONTROL_SIGNATURE)
    def control(model, data):  # type: ignore[no-untyped-def]
        size = integers_at(model + at.model_userdata_size)[0]
        if size < head:
            return  # another model of this process
        userdata = array_at(data + at.userdata, size)
        if userdata[HEADER_SIZE] != signature:
            return
        count, per_step = userdata[EVALUATIONS], userdata[EVALUATIONS_PER_STEP]
        userdata[EVALUATIONS] = count + 1.0
        time = evaluation_time(count, per_step, userdata[TIMESTEP])
        positions = to_fixed_tuple(array_at(data + at.qpos, nq), nq)
        velocities = to_fixed_tuple(array_at(data + at.qvel, nv), nv)
        activations = to_fixed_tuple(array_at(data + at.act, na), na)
        ctrl = array_at(data + at.ctrl, nu)
        record = addresses_at(data + at.userdata)[0] + 8 * HEADER_SIZE
        parameters = carray(bytes_at(record), (1,), layout)[0]
        knots = userdata[head:]
        period = userdata[CONTROL_PERIOD]
        if period == 0.0 or count % period == 0.0:
            values = controls(time, positions, velocities, activations, parameters, knots)
        else:
            held = to_fixed_tuple(ctrl, nu)
            values = hold(time, positions, velocities, activations, held, parameters)
        for index in range(nu):
            ctrl[index] = values[index]
        if userdata[RECORDER] != 0.0:
            recorder = int(userdata[RECORDER])
            if sample_is_due(recorder):  # at the first evaluation of a step
                start = count / per_step * userdata[TIMESTEP]
                sample = observe(positions, velocities, activations, values)
                checked = watch(start, sample, parameters, knots)
                record_sample(recorder, start, sample, checked, limit_exceeded, knots)
            if recording_is_over(recorder):
                for index in range(nu):
                    ctrl[index] = nan

    mark_native_code_compiled(loop.native_name("mujoco"))
    return control


class NativeEngine(Engine):
    """Runs the scalar source as a compiled callback."""

    name: EngineName = "native"

    def __init__(self, loop: ClosedLoop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
        self._control = compile_control(loop)

    def callback(self) -> Any:
        return self._control.ctypes


@cache
def compile_empty() -> Any:
    """A callback that does nothing, for measurements."""

    @compiled_callback(_CONTROL_SIGNATURE)
    def empty(model, data):  # type: ignore[no-untyped-def]
        pass

    return empty


@one_thread_at_a_time
@cache
def compile_stopped_clock() -> Any:
    """A clock for MuJoCo's timers that always reads zero."""

    @compiled_callback(types.float64())
    def clock():  # type: ignore[no-untyped-def]
        return 0.0

    return clock
