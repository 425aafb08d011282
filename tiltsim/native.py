"""The native engine: the scalar control step compiled as MuJoCo's control callback.

Numba compiles the registered scalar functions from their own source. The callback touches
MuJoCo's state only through the public ``mj_getState`` and ``mj_setState``, so nothing depends on
the layout of MuJoCo's structs. Compiled code is kept on disk, keyed by the sources and versions it
was made from, and loads in a fraction of the time that compiling takes.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any, Final

import llvmlite.binding
import mujoco
import numba
import numba.core.config
import numpy as np
from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic, register_jitable

from controllers.records import record_dtype, record_size
from controllers.scalar import scalar_functions
from tiltsim import thesis_plant
from tiltsim.cache import native_code_can_be_kept, native_code_folder
from tiltsim.control import (
    TILTROTOR_SIZES,
    ControlParameters,
    rotor_thrust_controls,
    tiltrotor_controls,
)
from tiltsim.engine import SIGNATURE, EngineName, check_model

_State = mujoco.mjtState
INPUTS: Final = int(
    _State.mjSTATE_TIME
    | _State.mjSTATE_QPOS
    | _State.mjSTATE_QVEL
    | _State.mjSTATE_ACT
    | _State.mjSTATE_USERDATA
)
CONTROLS: Final = int(_State.mjSTATE_CTRL)

NQ, NV, NA, NU = TILTROTOR_SIZES
QPOS: Final = 1  # offsets in the vector that mj_getState fills; time comes first
QVEL: Final = QPOS + NQ
ACT: Final = QVEL + NV
USERDATA: Final = ACT + NA
SIZE: Final = USERDATA + record_size(ControlParameters)
PARAMETERS: Final = numba.from_dtype(record_dtype(ControlParameters))


# Division by zero gives infinity or NaN, as in C; MuJoCo then reports a bad control.
_OPTIONS: Final = {"error_model": "numpy", "cache": native_code_can_be_kept()}
numba.core.config.CACHE_DIR = str(native_code_folder())

for _function in scalar_functions():
    register_jitable(error_model="numpy")(_function)


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
    """Address of `SIZE` floats on the callback's own stack."""

    def generate(context: Any, builder: Any, signature: Any, _arguments: Any) -> Any:
        with builder.goto_entry_block():
            buffer = builder.alloca(ir.DoubleType(), SIZE)
        return builder.ptrtoint(buffer, context.get_value_type(signature.return_type))

    return types.intp(), generate


def _cast(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))


@intrinsic
def _floats_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to floats."""
    return types.CPointer(types.float64)(address), _cast


@intrinsic
def _parameters_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to the parameter record."""
    return types.CPointer(PARAMETERS)(address), _cast


@cfunc(types.void(types.intp, types.intp), **_OPTIONS)
def _continuous(model, data):  # type: ignore[no-untyped-def]
    if _state_size(model, INPUTS) != SIZE:
        return
    address = _stack_buffer()
    buffer = carray(_floats_at(address), (SIZE,))
    _get_state(model, data, address, INPUTS)
    if buffer[USERDATA] != SIGNATURE:
        return
    parameters = carray(_parameters_at(address + 8 * USERDATA), (1,))[0]
    b = buffer
    controls = tiltrotor_controls(
        b[0],
        (b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11]),
        (b[12], b[13], b[14], b[15], b[16], b[17], b[18], b[19], b[20], b[21]),
        (b[22], b[23], b[24], b[25]),
        parameters,
    )
    for index in range(NU):
        buffer[index] = controls[index]
    _set_state(model, data, address, CONTROLS)


@cfunc(types.void(types.intp, types.intp), **_OPTIONS)
def _held(model, data):  # type: ignore[no-untyped-def]
    if _state_size(model, INPUTS) != SIZE:
        return
    address = _stack_buffer()
    buffer = carray(_floats_at(address), (SIZE,))
    _get_state(model, data, address, INPUTS)
    if buffer[USERDATA] != SIGNATURE:
        return
    thrusts = rotor_thrust_controls((buffer[22], buffer[23], buffer[24], buffer[25]))
    _get_state(model, data, address, CONTROLS)
    for index in range(4):
        buffer[4 + index] = thrusts[index]
    _set_state(model, data, address, CONTROLS)


class NativeEngine:
    """Runs the scalar source as compiled callbacks."""

    name: EngineName = "native"

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(model, data)

    def continuous(self) -> Any:
        """See `tiltsim.engine.Engine.continuous`."""
        return _continuous.ctypes

    def held(self) -> Any:
        """See `tiltsim.engine.Engine.held`."""
        return _held.ctypes

    def sample(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """See `tiltsim.engine.Engine.sample`."""
        _continuous.ctypes(model._address, data._address)


@njit(**_OPTIONS)
def _advance(step_index, values, timestep, steps, control_steps, records):  # type: ignore[no-untyped-def]
    state = list(values)
    state = thesis_plant.advance(step_index, state, timestep, steps, control_steps, records[0].law)
    return np.array(state)


def advance_thesis_plant(
    step_index: int,
    state: list[float],
    timestep: float,
    steps: int,
    control_steps: int,
    parameters: np.ndarray[Any, Any],
) -> list[float]:
    """`tiltsim.thesis_plant.advance`, compiled; ``parameters`` are the floats of the record."""
    records = parameters.view(record_dtype(ControlParameters))
    values = np.array(state)
    result = _advance(step_index, values, timestep, steps, control_steps, records)
    return list(result.tolist())
