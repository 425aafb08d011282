"""The native engine: the scalar control step compiled as MuJoCo's control callback.

Numba compiles the registered scalar functions from their own source. The callback touches
MuJoCo's state only through the public ``mj_getState`` and ``mj_setState``, so nothing depends on
the layout of MuJoCo's structs. Compiled code is kept on disk, keyed by the sources and versions it
was made from, and loads in a fraction of the time that compiling takes.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import llvmlite.binding
import mujoco
import numba
import numba.core.config
import numpy as np
from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic, register_jitable
from numba.np.unsafe.ndarray import to_fixed_tuple

from controllers.records import record_dtype
from controllers.scalar import scalar_functions
from tiltsim.cache import native_code_can_be_kept, native_code_folder
from tiltsim.engine import EngineName, check_model
from tiltsim.loop import Equations, Floats, Loop
from tiltsim.thesis_plant import make_stepper

_State = mujoco.mjtState
INPUTS: Final = int(
    _State.mjSTATE_TIME
    | _State.mjSTATE_QPOS
    | _State.mjSTATE_QVEL
    | _State.mjSTATE_ACT
    | _State.mjSTATE_USERDATA
)
CONTROLS: Final = int(_State.mjSTATE_CTRL)

CAPACITY: Final = 2048
"""Floats in the callback's buffer: a flight's time, state, parameters and table must fit."""

# Division by zero gives infinity or NaN, as in C; MuJoCo then reports a bad control.
_OPTIONS: Final = {"error_model": "numpy", "cache": native_code_can_be_kept()}
numba.core.config.CACHE_DIR = str(native_code_folder())


def _external(name: str, signature: Any) -> Any:
    """A C function of MuJoCo, from the library that the mujoco package has loaded."""
    folder = Path(mujoco.__file__).parent
    library = next(
        path
        for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll")
        for path in sorted(folder.glob(pattern))
    )
    address = ctypes.cast(getattr(ctypes.CDLL(str(library)), name), ctypes.c_void_p).value
    llvmlite.binding.add_symbol(f"tiltsim_{name}", address)
    return types.ExternalFunction(f"tiltsim_{name}", signature)


# Pointers travel as integers of their size; the state signature is a C int.
_state_size = _external("mj_stateSize", types.int32(types.intp, types.int32))
_get_state = _external("mj_getState", types.void(types.intp, types.intp, types.intp, types.int32))
_set_state = _external("mj_setState", types.void(types.intp, types.intp, types.intp, types.int32))


@intrinsic
def _stack_buffer(_typing: Any) -> Any:
    """Address of `CAPACITY` floats on the callback's own stack."""

    def generate(context: Any, builder: Any, signature: Any, _arguments: Any) -> Any:
        with builder.goto_entry_block():
            buffer = builder.alloca(ir.DoubleType(), CAPACITY)
        return builder.ptrtoint(buffer, context.get_value_type(signature.return_type))

    return types.intp(), generate


def _cast(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))


@intrinsic
def _floats_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to floats."""
    return types.CPointer(types.float64)(address), _cast


@intrinsic
def _bytes_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to anything."""
    return types.voidptr(address), _cast


@register_jitable(error_model="numpy")
def _read_inputs(model, data, address, head, userdata, signature):  # type: ignore[no-untyped-def]
    """Fill the buffer with the state of a flight; its size, or 0 where the model is not ours."""
    size = _state_size(model, INPUTS)
    if size < head or size > CAPACITY:
        return 0
    _get_state(model, data, address, INPUTS)
    return size if carray(_floats_at(address), (CAPACITY,))[userdata] == signature else 0


@register_jitable(error_model="numpy")
def _write_controls(model, data, address, values):  # type: ignore[no-untyped-def]
    buffer = carray(_floats_at(address), (CAPACITY,))
    for index in range(len(values)):
        buffer[index] = values[index]
    _set_state(model, data, address, CONTROLS)


class Callbacks(NamedTuple):
    """The compiled control callbacks of a loop; keep them as long as MuJoCo may call them."""

    continuous: Any
    held: Any


def _register_scalar_functions() -> None:
    """Let compiled code call every scalar function known so far."""
    for function in scalar_functions()[len(_registered) :]:
        register_jitable(error_model="numpy")(function)
        _registered.append(function)


_registered: list[Any] = []


@cache
def compile_callbacks(loop: Loop) -> Callbacks:
    """Compile a loop's control step as C callbacks, or load them from the cache on disk.

    The cache knows the callbacks by the values they close over, so these must pickle to the same
    bytes in every process: module-level functions, numbers and dtypes do.
    """
    _register_scalar_functions()
    controls, refresh, signature = loop.controls, loop.refresh, loop.signature
    nq, nv, na, nu = loop.sizes
    qpos, qvel, act, userdata = 1, 1 + nq, 1 + nq + nv, 1 + nq + nv + na
    head = userdata + loop.record_size
    layout = record_dtype(loop.parameters)

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def continuous(model, data):  # type: ignore[no-untyped-def]
        address = _stack_buffer()
        size = _read_inputs(model, data, address, head, userdata, signature)
        if size == 0:
            return
        buffer = carray(_floats_at(address), (CAPACITY,))
        values = controls(
            buffer[0],
            to_fixed_tuple(buffer[qpos:qvel], nq),
            to_fixed_tuple(buffer[qvel:act], nv),
            to_fixed_tuple(buffer[act:userdata], na),
            carray(_bytes_at(address + 8 * userdata), (1,), layout)[0],
            buffer[head:size],
        )
        _write_controls(model, data, address, values)

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def held(model, data):  # type: ignore[no-untyped-def]
        address = _stack_buffer()
        size = _read_inputs(model, data, address, head, userdata, signature)
        if size == 0:
            return
        buffer = carray(_floats_at(address), (CAPACITY,))
        activations = to_fixed_tuple(buffer[act:userdata], na)
        _get_state(model, data, address, CONTROLS)
        values = refresh(to_fixed_tuple(buffer[0:nu], nu), activations)
        _write_controls(model, data, address, values)

    hold = loop.hold
    if hold is None:
        return Callbacks(continuous, held)

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def held_with_state(model, data):  # type: ignore[no-untyped-def]
        address = _stack_buffer()
        size = _read_inputs(model, data, address, head, userdata, signature)
        if size == 0 or size + nu > CAPACITY:
            return
        buffer = carray(_floats_at(address), (CAPACITY,))
        _get_state(model, data, address + 8 * size, CONTROLS)
        values = hold(
            buffer[0],
            to_fixed_tuple(buffer[qpos:qvel], nq),
            to_fixed_tuple(buffer[qvel:act], nv),
            to_fixed_tuple(buffer[act:userdata], na),
            to_fixed_tuple(buffer[size : size + nu], nu),
            carray(_bytes_at(address + 8 * userdata), (1,), layout)[0],
        )
        _write_controls(model, data, address, values)

    return Callbacks(continuous, held_with_state)


class NativeEngine:
    """Runs the scalar source as compiled callbacks."""

    name: EngineName = "native"

    def __init__(self, loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
        self._callbacks = compile_callbacks(loop)

    def continuous(self) -> Any:
        """See `tiltsim.engine.Engine.continuous`."""
        return self._callbacks.continuous.ctypes

    def held(self) -> Any:
        """See `tiltsim.engine.Engine.held`."""
        return self._callbacks.held.ctypes

    def sample(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """See `tiltsim.engine.Engine.sample`."""
        self._callbacks.continuous.ctypes(model._address, data._address)


@cache
def compile_stepper(equations: Equations) -> Any:
    """Compile the thesis plant's solver for a law, or load it from the cache on disk.

    The compiled function takes and returns what `tiltsim.thesis_plant.make_stepper` says, but for
    the state, which is an array.
    """
    _register_scalar_functions()
    stepper = register_jitable(error_model="numpy")(make_stepper(equations.inputs, equations.rates))

    @njit(nogil=True, **_OPTIONS)
    def advance(  # type: ignore[no-untyped-def]
        step_index, state, held, timestep, steps, control_steps, parameters, table, disturbance
    ):
        values, held = stepper(
            *(step_index, list(state), held, timestep, steps),
            *(control_steps, parameters, table, disturbance),
        )
        return np.array(values), held

    return advance


def native_record(loop: Loop, userdata: Floats) -> tuple[Any, Floats]:
    """The parameter record and the table of a flight as compiled code reads them."""
    head = loop.record_size
    return userdata[:head].view(record_dtype(loop.parameters))[0], userdata[head:]
