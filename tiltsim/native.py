"""The native engine: the scalar control step compiled as MuJoCo's control callback.

Numba compiles the registered scalar functions from their own source. The callback touches
MuJoCo's state only through the public ``mj_getState`` and ``mj_setState``, so nothing depends on
the layout of MuJoCo's structs. It records samples, too, so that a flight of any length runs
without returning to Python and without holding its lock. Compiled code is kept on disk, keyed by
the sources and versions it was made from, and loads in a fraction of the time that compiling takes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from math import copysign, isfinite, nan
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

from controllers.records import flatten, record_dtype, record_size
from controllers.references import ReferenceParameters
from controllers.scalar import scalar, scalar_functions
from tiltsim.cache import (
    native_code_can_be_kept,
    native_code_folder,
    native_code_was_compiled,
)
from tiltsim.engine import EngineName, check_model
from tiltsim.limits import SINGULAR, WITHIN
from tiltsim.loop import (
    CONTROL_PERIOD,
    EVALUATIONS,
    HEADER_SIZE,
    RECORDER,
    ControlSetup,
    Floats,
    Loop,
)
from tiltsim.thesis_plant import stepper_of

_State = mujoco.mjtState
INPUTS: Final = int(
    _State.mjSTATE_TIME
    | _State.mjSTATE_QPOS
    | _State.mjSTATE_QVEL
    | _State.mjSTATE_ACT
    | _State.mjSTATE_USERDATA
)
CONTROLS: Final = int(_State.mjSTATE_CTRL)
USERDATA: Final = int(_State.mjSTATE_USERDATA)

CAPACITY: Final = 2048
"""Floats in the callback's buffer: a flight's time, state, parameters and table must fit."""

SCRATCH: Final = 256
"""Floats beyond them, for controls."""

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
    """Address of `CAPACITY` and `SCRATCH` floats on the callback's own stack."""

    def generate(context: Any, builder: Any, signature: Any, _arguments: Any) -> Any:
        with builder.goto_entry_block():
            buffer = builder.alloca(ir.DoubleType(), CAPACITY + SCRATCH)
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
def _read_inputs(model, data, address, head, signed, signature):  # type: ignore[no-untyped-def]
    """Fill the buffer with the state of a flight; its size, or 0 where the model is not ours."""
    size = _state_size(model, INPUTS)
    if size < head or size > CAPACITY:
        return 0
    _get_state(model, data, address, INPUTS)
    return size if carray(_floats_at(address), (CAPACITY,))[signed] == signature else 0


class RecorderHead(NamedTuple):
    """What the memory of a recorder begins with; `SIDES` floats and the samples follow."""

    left: float  # evaluations to go before the next sample
    interval: float  # evaluations between samples
    last_interval: float  # evaluations between the last two samples
    samples: float  # taken so far
    capacity: float  # samples that there is room for
    lost: float  # 1 from the first sample on that ends the flight
    follows_position: float  # whether the horizontal position counts
    reference: ReferenceParameters


SIDES: Final = 8
"""How many numbers a law may have watched."""

_RECORDER: Final = record_dtype(RecorderHead)
_RECORDER_SIZE: Final = record_size(RecorderHead)


@register_jitable(error_model="numpy")
def _sample_is_due(recorder):  # type: ignore[no-untyped-def]
    """Count an evaluation."""
    head = carray(_bytes_at(recorder), (1,), _RECORDER)
    left = head[0].left
    head[0].left = left - 1.0
    return left == 0.0


@register_jitable(error_model="numpy")
def _record(recorder, time, values, watched, limit_exceeded, table):  # type: ignore[no-untyped-def]
    """Keep a sample and judge it as `tiltsim.simulation.Watch` does."""
    head = carray(_bytes_at(recorder), (1,), _RECORDER)
    samples = int(head[0].samples)
    capacity = int(head[0].capacity)
    if samples >= capacity or head[0].lost != 0.0:
        return
    width = 1 + len(values)
    rest = carray(_floats_at(recorder + 8 * _RECORDER_SIZE), (SIDES + capacity * width,))
    start = SIDES + samples * width
    rest[start] = time
    finite = True
    for index in range(len(values)):
        rest[start + 1 + index] = values[index]
        finite = finite and isfinite(values[index])
    lost = not finite
    if finite:
        reference, follows_position = head[0].reference, head[0].follows_position
        lost = limit_exceeded(time, values, reference, table, follows_position) != WITHIN
    for index in range(len(watched)):
        side = 0.0 if abs(watched[index]) < SINGULAR else copysign(1.0, watched[index])
        if side == 0.0 or side != rest[index]:
            lost = True
    if lost:
        head[0].lost = 1.0
    head[0].samples = samples + 1.0
    interval = head[0].interval if samples + 2 < capacity else head[0].last_interval
    head[0].left = interval - 1.0


@register_jitable(error_model="numpy")
def _recording_is_over(recorder):  # type: ignore[no-untyped-def]
    head = carray(_bytes_at(recorder), (1,), _RECORDER)
    return head[0].lost != 0.0 or head[0].samples == head[0].capacity


class Recorder:
    """Memory for the samples of one flight, to which the callback writes by itself.

    The callback takes a sample before every so many steps, the first after a full interval. Once
    there is no room for more, or a sample shows that the flight is lost, it asks for controls that
    are no numbers: MuJoCo warns of them and a batch stops there.

    Parameters
    ----------
    loop
        What flies.
    samples
        How many to take.
    interval, last_interval
        Evaluations of the control step between samples, and between the last two.
    reference, follows_position
        For the limits; see `tiltsim.kinds.Kind`.
    watched
        The numbers that the loop watches as they are now: each must keep its sign.
    """

    def __init__(
        self,
        loop: Loop,
        samples: int,
        interval: int,
        last_interval: int,
        reference: ReferenceParameters,
        follows_position: bool,
        watched: Sequence[float],
    ) -> None:
        self._width = len(loop.sample_fields)
        self._memory = np.zeros(_RECORDER_SIZE + SIDES + samples * self._width)
        self._head = self._memory[:_RECORDER_SIZE].view(_RECORDER)
        first = interval if samples > 1 else last_interval
        head = RecorderHead(
            *(first, interval, last_interval, 0.0, samples, 0.0, follows_position, reference)
        )
        self._memory[:_RECORDER_SIZE] = list(flatten(head))
        if len(watched) > SIDES:
            raise ValueError(f"{loop.model}: {len(watched)} numbers watched, at most {SIDES}")
        for index, value in enumerate(watched):
            self._memory[_RECORDER_SIZE + index] = copysign(1.0, value)

    @property
    def address(self) -> float:
        """For the `Header` in `userdata`; exact, since addresses are below 2^53."""
        return float(self._memory.ctypes.data)

    @property
    def samples(self) -> Floats:
        """The samples taken so far, shape (N, len(loop.sample_fields))."""
        taken = int(self._head["samples"][0])
        start = _RECORDER_SIZE + SIDES
        return self._memory[start : start + taken * self._width].reshape(taken, self._width)

    @property
    def lost(self) -> bool:
        """Whether the last sample ends the flight."""
        return bool(self._head["lost"][0])

    @property
    def full(self) -> bool:
        """Whether all samples have been taken."""
        return bool(self._head["samples"][0] == self._head["capacity"][0])


class Callbacks(NamedTuple):
    """What is compiled of a loop; keep it as long as MuJoCo may call it."""

    control: Any


@scalar
def watch_nothing(values: Any, parameters: Any) -> tuple[float]:
    """For loops that leave watching to Python."""
    return (1.0,)


def _register_scalar_functions() -> None:
    """Let compiled code call every scalar function known so far."""
    for function in scalar_functions()[len(_registered) :]:
        register_jitable(error_model="numpy")(function)
        _registered.append(function)


_registered: list[Any] = []


@cache
def compile_callbacks(loop: Loop) -> Callbacks:
    """Compile a loop's control step as a C callback, or load it from the cache on disk.

    The cache knows the callback by the values it closes over, so these must pickle to the same
    bytes in every process: module-level functions, numbers and dtypes do.
    """
    controls, hold, signature = loop.controls, loop.held, loop.signature
    observe, watch = loop.observe, loop.watch or watch_nothing
    _register_scalar_functions()
    limit_exceeded = loop.kind.limit_exceeded
    nq, nv, na, nu = loop.sizes
    qpos, qvel, act, header = 1, 1 + nq, 1 + nq + nv, 1 + nq + nv + na
    period, evaluated, recording = header + CONTROL_PERIOD, header + EVALUATIONS, header + RECORDER
    userdata = header + HEADER_SIZE
    head = userdata + loop.record_size
    layout = record_dtype(loop.parameters)

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def control(model, data):  # type: ignore[no-untyped-def]
        address = _stack_buffer()
        size = _read_inputs(model, data, address, head, userdata, signature)
        if size == 0:
            return
        buffer = carray(_floats_at(address), (CAPACITY,))
        scratch = carray(_floats_at(address + 8 * CAPACITY), (SCRATCH,))
        positions = to_fixed_tuple(buffer[qpos:qvel], nq)
        velocities = to_fixed_tuple(buffer[qvel:act], nv)
        activations = to_fixed_tuple(buffer[act:header], na)
        parameters = carray(_bytes_at(address + 8 * userdata), (1,), layout)[0]
        if buffer[evaluated] == 0.0:
            values = controls(
                buffer[0], positions, velocities, activations, parameters, buffer[head:size]
            )
        else:
            _get_state(model, data, address + 8 * CAPACITY, CONTROLS)
            held = to_fixed_tuple(scratch[0:nu], nu)
            values = hold(buffer[0], positions, velocities, activations, held, parameters)
        for index in range(nu):
            scratch[index] = values[index]
        if buffer[period] != 0.0:
            count = buffer[evaluated] + 1.0
            buffer[evaluated] = count if count < buffer[period] else 0.0
            _set_state(model, data, address + 8 * header, USERDATA)
        if buffer[recording] != 0.0:
            recorder = int(buffer[recording])
            if _sample_is_due(recorder):
                seen = observe(positions, velocities, activations, values)
                watched, table = watch(seen, parameters), buffer[head:size]
                _record(recorder, buffer[0], seen, watched, limit_exceeded, table)
            if _recording_is_over(recorder):
                for index in range(nu):
                    scratch[index] = nan
        _set_state(model, data, address + 8 * CAPACITY, CONTROLS)

    native_code_was_compiled(loop.native_name("mujoco"))
    return Callbacks(control)


class NativeEngine:
    """Runs the scalar source as a compiled callback."""

    name: EngineName = "native"

    def __init__(self, loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
        if loop.sizes.ctrl > SCRATCH:
            raise ValueError(f"{loop.model}: {loop.sizes.ctrl} controls, at most {SCRATCH}")
        self._callbacks = compile_callbacks(loop)

    def callback(self) -> Any:
        """See `tiltsim.engine.Engine.callback`."""
        return self._callbacks.control.ctypes


@cache
def compile_stepper(loop: Loop) -> tuple[Any, Any]:
    """Compile the thesis plant's solver for a loop, or load it from the cache on disk.

    Returns ``(advance, record)``. The first takes and returns what
    `tiltsim.thesis_plant.stepper_of` says, but for the state, which is an array. The second takes
    in front of that the address of a `Recorder` and a number of samples; it stops where recording
    is over. Neither holds Python's lock.
    """
    _register_scalar_functions()
    assert loop.equations is not None
    inputs, observe = loop.equations.inputs, loop.equations.observe
    watch = loop.watch or watch_nothing
    limit_exceeded = loop.kind.limit_exceeded
    stepper = register_jitable(error_model="numpy")(stepper_of(loop.equations))

    @njit(nogil=True, **_OPTIONS)
    def advance(  # type: ignore[no-untyped-def]
        step_index, state, held, timestep, steps, control_steps, parameters, table, disturbance
    ):
        values, held = stepper(
            *(step_index, list(state), held, timestep, steps),
            *(control_steps, parameters, table, disturbance),
        )
        return np.array(values), held

    @njit(nogil=True, **_OPTIONS)
    def record(  # type: ignore[no-untyped-def]
        recorder,
        samples,
        step_index,
        state,
        held,
        timestep,
        steps,
        control_steps,
        parameters,
        table,
        disturbance,
    ):
        values = list(state)
        for _ in range(samples):
            values, held = stepper(
                *(step_index, values, held, timestep, steps),
                *(control_steps, parameters, table, disturbance),
            )
            step_index += steps
            time = step_index * timestep
            force = held
            if control_steps == 0 or step_index % control_steps == 0:
                force = inputs(time, values, parameters, table)
            seen = observe(time, values, force, parameters, table)
            watched = watch(seen, parameters)
            _record(recorder, time, seen, watched, limit_exceeded, table)
            if _recording_is_over(recorder):
                break
        return np.array(values), held

    return advance, record


def native_record(loop: Loop, userdata: Floats) -> tuple[Any, Floats]:
    """The parameter record and the table of a flight as compiled code reads them."""
    head = loop.record_size
    return userdata[:head].view(record_dtype(loop.parameters))[0], userdata[head:]


@cache
def _compile_rows(function: Callable[..., tuple[float, ...]]) -> Any:
    _register_scalar_functions()

    @njit(nogil=True, **_OPTIONS)
    def rows(time, states, parameters, table):  # type: ignore[no-untyped-def]
        width = len(function(time[0], states[0], parameters, table))
        values = np.empty((len(time), width))
        for index in range(len(time)):
            row = function(time[index], states[index], parameters, table)
            for column in range(width):
                values[index, column] = row[column]
        return values

    return rows


def evaluate_natively(
    function: Callable[..., tuple[float, ...]], time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """See `tiltsim.rows.evaluate_rows`, which takes at least one row to here."""
    head = record_size(type(setup.parameters))
    parameters = setup.userdata[:head].view(record_dtype(type(setup.parameters)))[0]
    time, states = np.ascontiguousarray(time), np.ascontiguousarray(states)
    table = np.array(setup.table)
    values: Floats = _compile_rows(function)(time, states, parameters, table)
    return values


@cache
def compile_floor() -> tuple[Any, Any]:
    """Callbacks for measurements: one that does nothing, one that reads state, writes controls."""

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def empty(model, data):  # type: ignore[no-untyped-def]
        pass

    @cfunc(types.void(types.intp, types.intp), **_OPTIONS)
    def state(model, data):  # type: ignore[no-untyped-def]
        address = _stack_buffer()
        if _state_size(model, INPUTS) > CAPACITY:
            return
        _get_state(model, data, address, CONTROLS)
        _set_state(model, data, address, CONTROLS)
        _get_state(model, data, address, INPUTS)

    return empty, state
