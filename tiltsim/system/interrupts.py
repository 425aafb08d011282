"""Interrupts that must neither get lost nor lose what is computed."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import FrameType


@contextmanager
def reraise_swallowed_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt after the block where one was dropped within it.

    Where compiled code calls Python back, as LLVM does while it compiles, no exception can pass:
    Python reports it as unraisable and goes on as if there had been no interrupt. Interrupts come
    to the main thread alone; in others the block runs as ever.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = sys.unraisablehook
    dropped = False

    def keep(unraisable: Any) -> None:
        nonlocal dropped
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            dropped = True
        else:
            before(unraisable)

    sys.unraisablehook = keep
    try:
        yield
    finally:
        sys.unraisablehook = before
    if dropped:
        raise KeyboardInterrupt


@contextmanager
def defer_interrupts() -> Iterator[None]:
    """Let the block finish: an interrupt within it is raised at its end, a second one at once.

    For what is short and must not be lost, such as writing a flight's files. In threads other than
    the main one the block runs as ever. A block within another leaves its interrupt to the outer
    one. Where the keyboard is ignored, as by a shell's job in the background, it still is, but
    terminations are deferred there, too.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    outer = _deferring[-1] if _deferring else before
    interrupted = False

    def defer(_number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        if interrupted:
            _interrupt(outer, frame)
        interrupted = True

    if callable(before):
        signal.signal(signal.SIGINT, defer)
    _deferring.append(defer)
    try:
        yield
    finally:
        _deferring.remove(defer)
        if callable(before):
            signal.signal(signal.SIGINT, before)
    if interrupted:
        _interrupt(outer, None)


_deferring: list[Callable[[int, FrameType | None], None]] = []


def _interrupt(handler: Any, frame: FrameType | None) -> None:
    """Do what a handler of SIGINT does; one that ignores the keyboard is passed by."""
    if not callable(handler):
        raise KeyboardInterrupt
    handler(signal.SIGINT, frame)


@contextmanager
def terminations_as_interrupts() -> Iterator[Callable[[], bool]]:
    """Within the block SIGTERM is an interrupt, so that it, too, is cleaned up after.

    Schedulers and ``kill`` end a process so. A second one ends it at once. Yields whether there
    was one. In threads other than the main one the block runs as ever.
    """
    terminated = False
    if threading.current_thread() is not threading.main_thread():
        yield lambda: terminated
        return

    def interrupt(_number: int, frame: FrameType | None) -> None:
        nonlocal terminated
        terminated = True
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        _interrupt(_deferring[-1] if _deferring else signal.getsignal(signal.SIGINT), frame)

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield lambda: terminated
    finally:
        signal.signal(signal.SIGTERM, before)
