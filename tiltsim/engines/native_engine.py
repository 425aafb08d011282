"""The native engine: the scalar control step compiled as MuJoCo's control callback.

Numba compiles the registered scalar functions from their own source. The callback reads MuJoCo's
state where it lies (`tiltsim.engines.mjdata_layout`). It records samples, too, so that a flight of
any length runs without returning to Python and without holding its lock. Compiled code is kept on
disk, keyed by the sources and versions it was made from, and loads in a fraction of the time that
compiling takes.
"""

from __future__ import annotations

from functools import cache
from math import nan
from typing import Any, NamedTuple

import mujoco
import numba
import numba.core.config
from numba import carray, cfunc, types
from numba.core.caching import IndexDataCacheFile
from numba.np.unsafe.ndarray import to_fixed_tuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.closed_loop.userdata import CONTROL_PERIOD, EVALUATIONS, HEADER_SIZE, RECORDER
from tiltsim.engines.base import EngineName, check_model
from tiltsim.engines.cache import (
    announce_native_code,
    mark_native_code_compiled,
    native_code_folder,
)
from tiltsim.engines.mjdata_layout import mjdata_layout
from tiltsim.engines.native_memory import _addresses_at, _array, _bytes_at, _floats_at, _integers_at
from tiltsim.engines.numba_setup import _OPTIONS, _alone, _register_scalar_functions, watch_nothing
from tiltsim.engines.recorder import _record, _recording_is_over, _sample_is_due
from tiltsim_controllers.mathematics.records import record_dtype

numba.core.config.CACHE_DIR = str(native_code_folder())


IndexDataCacheFile.save = _alone(IndexDataCacheFile.save)


class Callbacks(NamedTuple):
    """What is compiled of a loop; keep it as long as MuJoCo may call it."""

    control: Any


@cache
def compile_callbacks(loop: ClosedLoop) -> Callbacks:
    """Compile a loop's control step as a C callback, or load it from the cache on disk.

    The cache knows the callback by the values it closes over, so these must pickle to the same
    bytes in every process: module-level functions, numbers and dtypes do.
    """
    announce_native_code(loop.native_name("mujoco"))
    controls, hold, signature = loop.controls, loop.held, loop.signature
    observe, watch = loop.observe, loop.watch or watch_nothing
    _register_scalar_functions()
    limit_exceeded = loop.kind.limit_exceeded
    nq, nv, na, nu = loop.sizes
    at = mjdata_layout()
    head = HEADER_SIZE + loop.record_size
    layout = record_dtype(loop.parameters)

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def control(model, data):  # type: ignore[no-untyped-def]
        size = _integers_at(model + at.model_userdata_size)[0]
        if size < head:
            return  # some other model of this process is being stepped
        userdata = _array(data + at.userdata, size)
        if userdata[HEADER_SIZE] != signature:
            return
        time = _floats_at(data + at.time)[0]
        positions = to_fixed_tuple(_array(data + at.qpos, nq), nq)
        velocities = to_fixed_tuple(_array(data + at.qvel, nv), nv)
        activations = to_fixed_tuple(_array(data + at.act, na), na)
        ctrl = _array(data + at.ctrl, nu)
        record = _addresses_at(data + at.userdata)[0] + 8 * HEADER_SIZE
        parameters = carray(_bytes_at(record), (1,), layout)[0]
        knots = userdata[head:]
        if userdata[EVALUATIONS] == 0.0:
            values = controls(time, positions, velocities, activations, parameters, knots)
        else:
            held = to_fixed_tuple(ctrl, nu)
            values = hold(time, positions, velocities, activations, held, parameters)
        for index in range(nu):
            ctrl[index] = values[index]
        if userdata[CONTROL_PERIOD] != 0.0:
            count = userdata[EVALUATIONS] + 1.0
            userdata[EVALUATIONS] = count if count < userdata[CONTROL_PERIOD] else 0.0
        if userdata[RECORDER] != 0.0:
            recorder = int(userdata[RECORDER])
            if _sample_is_due(recorder):
                seen = observe(positions, velocities, activations, values)
                watched = watch(seen, parameters)
                _record(recorder, time, seen, watched, limit_exceeded, knots)
            if _recording_is_over(recorder):
                for index in range(nu):
                    ctrl[index] = nan

    mark_native_code_compiled(loop.native_name("mujoco"))
    return Callbacks(control)


class NativeEngine:
    """Runs the scalar source as a compiled callback."""

    name: EngineName = "native"

    def __init__(self, loop: ClosedLoop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
        self._callbacks = compile_callbacks(loop)

    def callback(self) -> Any:
        """See `tiltsim.engines.base.Engine.callback`."""
        return self._callbacks.control.ctypes


@cache
def compile_empty() -> Any:
    """A callback that does nothing, for measurements."""

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def empty(model, data):  # type: ignore[no-untyped-def]
        pass

    return empty


@cache
def compile_stopped_clock() -> Any:
    """A clock for MuJoCo's timers that stands still."""

    @cfunc(types.float64(), **_OPTIONS)
    def clock():  # type: ignore[no-untyped-def]
        return 0.0

    return clock
