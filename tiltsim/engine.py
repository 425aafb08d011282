"""Engines: how the control step runs inside MuJoCo.

The same scalar source runs either as Python floats (nothing to compile, best for one short flight)
or as a native callback (`tiltsim.native`). MuJoCo's control callback is global to the process, so
an engine is installed for the length of a ``with`` block and checks that a model is ours before
it touches it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import nan
from struct import Struct
from typing import Any, Literal, Protocol

import mujoco

from controllers.records import slotted, unflatten
from tiltsim.loop import CONTROL_PERIOD, EVALUATIONS, HEADER_SIZE, Loop, Sizes

EngineName = Literal["python", "native"]

Callback = Callable[[mujoco.MjModel, mujoco.MjData], None]


class Engine(Protocol):
    """Evaluates the control step of one model whenever MuJoCo asks for controls."""

    name: EngineName

    def callback(self) -> Any:
        """What MuJoCo calls: the whole step, or between the samples of a held law the rest of it.

        Under a held law the controls stay as sampled but for what follows the state by itself, as
        thrust follows the rotor speed.
        """


class PythonEngine:
    """Runs the scalar source as Python floats."""

    name: EngineName = "python"

    def __init__(self, loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
        controls, refresh = loop.controls, loop.refresh
        # Parameters never change during a flight: read once what native code reads at every call.
        values = data.userdata[HEADER_SIZE:].tolist()
        parameters = slotted(unflatten(loop.parameters, values))
        table = tuple(values[loop.record_size :])
        # Views of MuJoCo's own memory; looking them up anew would cost a tenth of the callback.
        vectors = data.qpos, data.qvel, data.act, data.ctrl
        qpos, qvel, act, ctrl = (memoryview(vector) for vector in vectors)
        header = data.userdata[:HEADER_SIZE]
        write_controls = Struct(f"{len(ctrl)}d").pack_into

        def sample(_model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data:
                return  # some other model of this process is being stepped
            try:
                positions, velocities = qpos.tolist(), qvel.tolist()
                values = controls(data.time, positions, velocities, act.tolist(), parameters, table)
                write_controls(ctrl, 0, *values)
            except (ArithmeticError, ValueError):
                # Where floats raise (sin of infinity), native code has NaN; MuJoCo reports both.
                write_controls(ctrl, 0, *(nan,) * len(ctrl))

        def between_samples() -> tuple[float, ...]:
            if loop.hold is None:
                return refresh(ctrl.tolist(), act.tolist())
            try:
                state = data.time, qpos.tolist(), qvel.tolist(), act.tolist()
                return loop.hold(*state, ctrl.tolist(), parameters)
            except (ArithmeticError, ValueError):
                return (nan,) * len(ctrl)

        def hold(model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data:
                return
            period, evaluations, _ = header.tolist()
            if evaluations == 0.0:
                sample(model, called)
            else:
                write_controls(ctrl, 0, *between_samples())
            header[EVALUATIONS] = evaluations + 1.0 if evaluations + 1.0 < period else 0.0

        self._callback = hold if header[CONTROL_PERIOD] > 0.0 else sample

    def callback(self) -> Callback:
        """See `Engine.callback`."""
        return self._callback


def check_model(loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise ValueError unless model and data are those of a flight of this loop."""
    sizes = Sizes(model.nq, model.nv, model.na, model.nu)
    head = HEADER_SIZE + loop.record_size
    signed = model.nuserdata >= head and data.userdata[HEADER_SIZE] == loop.signature
    if sizes != loop.sizes or not signed:
        raise ValueError(
            f"not a flight of the {loop.model}: {sizes}, expected {loop.sizes} with the "
            "parameters in userdata"
        )


def make_engine(name: EngineName, loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> Engine:
    """Build an engine for a model whose parameters already lie in ``data.userdata``."""
    if name == "python":
        return PythonEngine(loop, model, data)
    from tiltsim.native import NativeEngine

    return NativeEngine(loop, model, data)


@contextmanager
def control_callback(callback: Any) -> Iterator[None]:
    """Install MuJoCo's control callback for the length of a ``with`` block.

    Under a native one MuJoCo's timers stand still: nothing reads them, and to read the clock takes
    a tenth of a step.
    """
    native = hasattr(callback, "argtypes")  # a C function, as ctypes shows them
    previous, clock = mujoco.get_mjcb_control(), mujoco.get_mjcb_time()
    if native:
        from tiltsim.native import compile_stopped_clock

        mujoco.set_mjcb_time(compile_stopped_clock().ctypes)
    mujoco.set_mjcb_control(callback)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(previous)
        mujoco.set_mjcb_time(clock)
