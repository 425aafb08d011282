"""Interrupts from the keyboard that must neither get lost nor lose what is computed.

`terminations_interrupt` makes what ends a process otherwise, such as ``kill``, an interrupt, too.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from types import FrameType

TERMINATIONS: Final = [
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)
]
"""Signals that ask a process to end: those of ``kill`` and of a terminal that is closed."""


def terminations_interrupt() -> None:
    """Let the signals that ask the process to end raise KeyboardInterrupt, unless ignored.

    By default they end it on the spot: half-written files would stay and the flight be lost.
    """
    for number in TERMINATIONS:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)


@contextmanager
def interrupts_kept() -> Iterator[None]:
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
def interrupts_deferred() -> Iterator[None]:
    """Let the block finish: an interrupt within it is raised at its end, a second one at once.

    For what is short and must not be lost, such as writing a flight's files. In threads other than
    the main one the block runs as ever.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    found = {number: signal.getsignal(number) for number in (signal.SIGINT, *TERMINATIONS)}
    # The others are ignored, end the process on the spot, or are not Python's.
    handlers = {number: handler for number, handler in found.items() if callable(handler)}
    interrupted = False

    def defer(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        if interrupted:
            handlers[number](number, frame)
        interrupted = True

    for number in handlers:
        signal.signal(number, defer)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if interrupted:
        raise KeyboardInterrupt
