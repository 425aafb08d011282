"""MuJoCo's hooks (control callback, clock, warnings), which all threads of a process share."""

import ctypes
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Condition, get_ident
from types import FrameType
from typing import Any, Final


@dataclass(eq=False)
class _Block:
    """A ``with`` block that waits for its turn or has it."""

    control: Any
    function: FrameType | None  # whose block it is; None once it is over

    def contains_this_call(self) -> bool:
        """Whether the calling thread is still in the block; if abandoned, its function ended."""
        frame: FrameType | None = sys._getframe()
        while frame is not None and frame is not self.function:
            frame = frame.f_back
        return frame is not None


@contextmanager
def mujoco_hooks(control: Any = None, clock: Any = None) -> Iterator[None]:
    """Install a control callback, or none, and a clock for the length of a ``with`` block.

    Threads whose callbacks differ take turns, in the order in which they arrive; threads that share
    a callback run at the same time. A block must therefore be short. MuJoCo's compiler also calls
    the callback.

    In the block MuJoCo's warnings are neither printed nor logged to a file.

    Raises:
        RuntimeError: In a block of the same thread.
    """
    thread, block = get_ident(), _Block(control, sys._getframe(2))  # past contextlib's own frame
    outer = _inside.get(thread)
    if outer is not None and outer.contains_this_call():
        raise RuntimeError("a block with MuJoCo's hooks must not contain another")
    try:
        with _turns:
            # An interrupt may have kept an earlier block of this thread from leaving.
            _inside.pop(thread, None)
            _waiting.append(block)
            while _waiting[0] is not block or any(control != it.control for it in _inside.values()):
                _turns.wait()
            if not _inside:
                _install(control, clock)
            _inside[thread] = block
            _leave_queue(block)
        yield
    finally:
        block.function = None
        with _turns:
            if _inside.get(thread) is block:
                del _inside[thread]
            if not _inside and _replaced:
                _restore()
            _leave_queue(block)


_turns: Final = Condition()
_waiting: Final[deque[_Block]] = deque()
_inside: Final[dict[int, _Block]] = {}  # the blocks that threads are in, by thread
_replaced: Final[list[tuple[Any, Any, Any]]] = []
"""Callback, clock and handler of warnings as they were before the first of those blocks."""

_IGNORE: Final = ctypes.pythonapi.Py_IsInitialized
"""A C function without effect, as handler of warnings: in one in Python a handler of signals would
run and raise, and an exception that reaches MuJoCo's batch aborts the process."""


def _leave_queue(block: _Block) -> None:
    if block in _waiting:
        _waiting.remove(block)
    if _waiting:
        _turns.notify_all()


def _install(control: Any, clock: Any) -> None:
    import mujoco

    if not _replaced:
        before = mujoco.get_mjcb_control(), mujoco.get_mjcb_time(), mujoco.get_mju_user_warning()
        _replaced.append(before)
    mujoco.set_mju_user_warning(_IGNORE)
    mujoco.set_mjcb_time(clock or _replaced[0][1])
    mujoco.set_mjcb_control(control)


def _restore() -> None:
    import mujoco

    control, clock, warning = _replaced[0]
    mujoco.set_mjcb_control(control)
    mujoco.set_mjcb_time(clock)
    mujoco.set_mju_user_warning(warning)
    _replaced.clear()
