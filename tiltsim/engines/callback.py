"""Install a control callback in MuJoCo for the length of a block."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco


@contextmanager
def control_callback(callback: Any) -> Iterator[None]:
    """Install MuJoCo's control callback for the length of a ``with`` block.

    A native callback also stops MuJoCo's timers: nothing uses them, and reading the clock takes a
    tenth of a step.
    """
    native = hasattr(callback, "argtypes")  # a C function, as ctypes shows them
    previous, clock = mujoco.get_mjcb_control(), mujoco.get_mjcb_time()
    if native:
        from tiltsim.engines.native_engine import compile_stopped_clock

        mujoco.set_mjcb_time(compile_stopped_clock().ctypes)
    mujoco.set_mjcb_control(callback)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(previous)
        mujoco.set_mjcb_time(clock)
