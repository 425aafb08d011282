"""The native engine: the scalar control step compiled as MuJoCo's control callback.

Numba compiles the registered scalar functions from their own source. The callback reads MuJoCo's
state where it lies (`tiltsim.mjdata_layout`). It records samples, too, so that a flight of any
length runs without returning to Python and without holding its lock. Compiled code is kept on disk,
keyed by the sources and versions it was made from, and loads in a fraction of the time that
compiling takes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import copysign, isfinite, nan
from pathlib import Path
from threading import Lock
from typing import Any, Final, NamedTuple

import mujoco
import numba
import numba.core.config
import numpy as np
from numba import carray, cfunc, njit, types
from numba.core.caching import IndexDataCacheFile
from numba.extending import intrinsic, register_jitable
from numba.np.unsafe.ndarray import to_fixed_tuple

from controllers.records import flatten, record_dtype, record_size
from controllers.references import ReferenceParameters
from controllers.scalar import scalar, scalar_functions
from tiltsim.cache import (
    native_code_can_be_kept,
    native_code_folder,
    native_code_is_needed,
    native_code_was_compiled,
)
from tiltsim.engine import EngineName, check_model
from tiltsim.limits import SINGULAR, WITHIN
from tiltsim.locks import locked
from tiltsim.loop import (
    CONTROL_PERIOD,
    EVALUATIONS,
    HEADER_SIZE,
    RECORDER,
    ControlSetup,
    Floats,
    Loop,
)
from tiltsim.mjdata_layout import mjdata_layout
from tiltsim.thesis_plant import stepper_of

# Division by zero gives infinity or NaN, as in C; MuJoCo then reports a bad control.
_OPTIONS: Final = {"error_model": "numpy", "cache": native_code_can_be_kept()}
# What only compiled code calls needs no ways in from Python and C: a sixth less to compile.
_INNER: Final = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
numba.core.config.CACHE_DIR = str(native_code_folder())


def _alone(save: Callable[..., None]) -> Callable[..., None]:
    """Numba reads an index, adds to it and writes it as if there were no other process.

    Of two that compile at once, both could take the same name, and each load the other's code.
    """

    def save_alone(index: Any, key: Any, data: Any) -> None:
        with locked(Path(f"{index._index_path}.lock"), wait=True):
            save(index, key, data)

    return save_alone


IndexDataCacheFile.save = _alone(IndexDataCacheFile.save)


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


@intrinsic
def _addresses_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to addresses."""
    return types.CPointer(types.intp)(address), _cast


@intrinsic
def _integers_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to C integers."""
    return types.CPointer(types.int32)(address), _cast


@register_jitable(**_INNER)
def _array(place, size):  # type: ignore[no-untyped-def]
    """The array of floats whose address lies at a place in mjData."""
    return carray(_floats_at(_addresses_at(place)[0]), (size,))


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


@register_jitable(**_INNER)
def _sample_is_due(recorder):  # type: ignore[no-untyped-def]
    """Count an evaluation."""
    head = carray(_bytes_at(recorder), (1,), _RECORDER)
    left = head[0].left
    head[0].left = left - 1.0
    return left == 0.0


@register_jitable(**_INNER)
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


@register_jitable(**_INNER)
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
    with _registering:  # batches build plants in threads
        for function in scalar_functions()[len(_registered) :]:
            # Kept one by one, too: laws share most of them. A closure has no name to be kept by.
            kept = _OPTIONS["cache"] and function.__closure__ is None
            register_jitable(**_INNER, cache=kept)(function)
            _registered.append(function)


_registered: list[Any] = []
_registering = Lock()


@cache
def compile_callbacks(loop: Loop) -> Callbacks:
    """Compile a loop's control step as a C callback, or load it from the cache on disk.

    The cache knows the callback by the values it closes over, so these must pickle to the same
    bytes in every process: module-level functions, numbers and dtypes do.
    """
    native_code_is_needed(loop.native_name("mujoco"))
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
        table = userdata[head:]
        if userdata[EVALUATIONS] == 0.0:
            values = controls(time, positions, velocities, activations, parameters, table)
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
                _record(recorder, time, seen, watched, limit_exceeded, table)
            if _recording_is_over(recorder):
                for index in range(nu):
                    ctrl[index] = nan

    native_code_was_compiled(loop.native_name("mujoco"))
    return Callbacks(control)


class NativeEngine:
    """Runs the scalar source as a compiled callback."""

    name: EngineName = "native"

    def __init__(self, loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
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
    native_code_is_needed(loop.native_name("thesis"))
    _register_scalar_functions()
    assert loop.equations is not None
    inputs, observe = loop.equations.inputs, loop.equations.observe
    watch = loop.watch or watch_nothing
    limit_exceeded = loop.kind.limit_exceeded
    stepper = register_jitable(**_INNER)(stepper_of(loop.equations))

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
    record: Any = type(setup.parameters)
    head = record_size(record)
    parameters = setup.userdata[:head].view(record_dtype(record))[0]
    time, states = np.ascontiguousarray(time), np.ascontiguousarray(states)
    table = np.array(setup.table)
    values: Floats = _compile_rows(function)(time, states, parameters, table)
    return values


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
