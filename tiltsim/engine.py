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
from tiltsim.loop import Loop, Sizes

EngineName = Literal["python", "native"]

Callback = Callable[[mujoco.MjModel, mujoco.MjData], None]


class Engine(Protocol):
    """Evaluates the control step of one model, at every integrator stage or when asked."""

    name: EngineName

    def continuous(self) -> Any:
        """The callback that evaluates the whole step at every call."""

    def held(self) -> Any:
        """The callback that only lets the thrust follow the rotor speeds, other controls held."""

    def sample(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Evaluate the whole step once, into ``data.ctrl``."""


class PythonEngine:
    """Runs the scalar source as Python floats."""

    name: EngineName = "python"

    def __init__(self, loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
        controls, refresh = loop.controls, loop.refresh
        # Parameters never change during a flight: read once what native code reads at every call.
        values = data.userdata.tolist()
        parameters = slotted(unflatten(loop.parameters, values))
        table = tuple(values[loop.record_size :])
        # Views of MuJoCo's own memory; looking them up anew would cost a tenth of the callback.
        qpos, qvel, act, ctrl = data.qpos, data.qvel, data.act, data.ctrl
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
                ctrl[:] = nan

        def hold(_model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is data:
                write_controls(ctrl, 0, *refresh(ctrl.tolist(), act.tolist()))

        def hold_with_state(_model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data or loop.hold is None:
                return
            try:
                state = data.time, qpos.tolist(), qvel.tolist(), act.tolist()
                write_controls(ctrl, 0, *loop.hold(*state, ctrl.tolist(), parameters))
            except (ArithmeticError, ValueError):
                ctrl[:] = nan

        self._sample, self._hold = sample, hold if loop.hold is None else hold_with_state

    def continuous(self) -> Callback:
        """See `Engine.continuous`."""
        return self._sample

    def held(self) -> Callback:
        """See `Engine.held`."""
        return self._hold

    def sample(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """See `Engine.sample`."""
        self._sample(model, data)


def check_model(loop: Loop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise ValueError unless model and data are those of a flight of this loop."""
    sizes = Sizes(model.nq, model.nv, model.na, model.nu)
    signed = model.nuserdata >= loop.record_size and data.userdata[0] == loop.signature
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
    """Install MuJoCo's control callback for the length of a ``with`` block."""
    previous = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(callback)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(previous)
