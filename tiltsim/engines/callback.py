"""MuJoCo's control callback, which all threads of a process share."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Condition, get_ident
from typing import Any, Final

import mujoco


@contextmanager
def control_callback(callback: Any) -> Iterator[None]:
    """Install MuJoCo's control callback for the length of a ``with`` block; None removes it.

    Threads whose callbacks differ take turns, in the order in which they arrive; those with the
    same one run at the same time. A block must therefore be short, and must not contain another.

    In the block MuJoCo's warnings are neither printed nor logged to a file; `Plant.fault` reports
    them. A native callback also stops MuJoCo's timers: nothing uses them, and reading the clock
    takes a tenth of a step.
    """
    thread, ticket = get_ident(), object()
    try:
        with _turns:
            # An interrupt may have kept an earlier block of this thread from leaving.
            _inside.pop(thread, None)
            _waiting.append(ticket)
            _turns.wait_for(
                lambda: (
                    _waiting[0] is ticket and all(callback == other for other in _inside.values())
                )
            )
            if not _inside:
                _install(callback)
            _inside[thread] = callback
            _leave_queue(ticket)
        yield
    finally:
        with _turns:
            _inside.pop(thread, None)
            if not _inside and _replaced:
                _restore()
            _leave_queue(ticket)


_turns: Final = Condition()
_waiting: Final[deque[object]] = deque()
_inside: Final[dict[int, Any]] = {}
"""Callbacks of the blocks that threads are in, by thread."""

_replaced: Final[list[tuple[Any, Any, Any]]] = []
"""Callback, clock and handler of warnings as they were before the first of those blocks."""


def _leave_queue(ticket: object) -> None:
    with suppress(ValueError):
        _waiting.remove(ticket)
    _turns.notify_all()


def _install(callback: Any) -> None:
    clock = None
    if hasattr(callback, "argtypes"):  # a C function, as ctypes shows them
        from tiltsim.engines.native_engine import compile_stopped_clock

        clock = compile_stopped_clock().ctypes
    if not _replaced:
        before = mujoco.get_mjcb_control(), mujoco.get_mjcb_time(), mujoco.get_mju_user_warning()
        _replaced.append(before)
    mujoco.set_mju_user_warning(_ignore)
    mujoco.set_mjcb_time(clock or _replaced[0][1])
    mujoco.set_mjcb_control(callback)


def _restore() -> None:
    control, clock, warning = _replaced[0]
    mujoco.set_mjcb_control(control)
    mujoco.set_mjcb_time(clock)
    mujoco.set_mju_user_warning(warning)
    _replaced.clear()


def _ignore(_warning: str) -> None:
    """Ignore a warning of MuJoCo's."""
