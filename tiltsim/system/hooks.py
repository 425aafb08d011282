"""MuJoCo's hooks (control callback, clock, warnings), which all threads of a process share."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Condition, get_ident
from typing import Any, Final


@contextmanager
def mujoco_hooks(control: Any = None, clock: Any = None) -> Iterator[None]:
    """Install a control callback, or none, and a clock for the length of a ``with`` block.

    Threads whose callbacks differ take turns, in the order in which they arrive; those with the
    same one run at the same time. A block must therefore be short, and must not contain another.
    MuJoCo's compiler calls the callback, too.

    In the block MuJoCo's warnings are neither printed nor logged to a file.
    """
    thread, ticket = get_ident(), object()
    try:
        with _turns:
            # An interrupt may have kept an earlier block of this thread from leaving.
            _inside.pop(thread, None)
            _waiting.append(ticket)
            while _waiting[0] is not ticket or any(control != it for it in _inside.values()):
                _turns.wait()
            if not _inside:
                _install(control, clock)
            _inside[thread] = control
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
    if ticket in _waiting:
        _waiting.remove(ticket)
    if _waiting:
        _turns.notify_all()


def _install(control: Any, clock: Any) -> None:
    import mujoco

    if not _replaced:
        before = mujoco.get_mjcb_control(), mujoco.get_mjcb_time(), mujoco.get_mju_user_warning()
        _replaced.append(before)
    mujoco.set_mju_user_warning(_ignore)
    mujoco.set_mjcb_time(clock or _replaced[0][1])
    mujoco.set_mjcb_control(control)


def _restore() -> None:
    import mujoco

    control, clock, warning = _replaced[0]
    mujoco.set_mjcb_control(control)
    mujoco.set_mjcb_time(clock)
    mujoco.set_mju_user_warning(warning)
    _replaced.clear()


def _ignore(_warning: str) -> None:
    """Ignore a warning of MuJoCo's."""
