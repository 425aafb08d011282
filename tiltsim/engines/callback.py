"""Install an engine's control callback in MuJoCo."""

from contextlib import AbstractContextManager
from typing import Any

from tiltsim.system.hooks import mujoco_hooks


def control_callback(callback: Any) -> AbstractContextManager[None]:
    """Install MuJoCo's control callback, or none, for the length of a ``with`` block.

    Threads take turns; see `tiltsim.system.hooks`. A native callback also stops MuJoCo's timers:
    nothing uses them, and reading the clock takes a tenth of a step.
    """
    clock = None
    if hasattr(callback, "argtypes"):  # a C function, as ctypes shows them
        from tiltsim.engines.native_engine import compile_stopped_clock

        clock = compile_stopped_clock()
    return mujoco_hooks(callback, clock)
