"""Handling of SIGINT and SIGTERM, so that neither interrupts nor results are lost."""

from __future__ import annotations

import signal
import sys
import threading
from _thread import interrupt_main, start_new_thread
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import sleep
from types import FrameType
from typing import Final

Handler = Callable[[int, FrameType | None], object] | int | None
SOON: Final = 0.1  # time (s) after which a swallowed interrupt is sent again


class _Interrupt(KeyboardInterrupt):
    """An interrupt of the command line.

    Once a KeyboardInterrupt itself has passed through ``exec`` of a text, as dataclasses call it,
    CPython ends by SIGINT, whatever the exit code.
    """

    raised = False

    def __init__(self) -> None:
        """Note that there was one: compiled code may turn it into another error."""
        super().__init__()
        _Interrupt.raised = True


def was_interrupted() -> bool:
    """Whether an interrupt was raised since `terminations_as_interrupts` began."""
    return _Interrupt.raised


def _raise(_number: int, _frame: FrameType | None) -> None:
    raise _Interrupt


@contextmanager
def defer_interrupts() -> Iterator[None]:
    """Defer an interrupt to the end of the block; a second one is raised immediately.

    For short work whose result must not be lost, such as writing a flight's files. Only the main
    thread receives interrupts; in others this has no effect. A nested block passes its interrupt to
    the outer one. If SIGINT is ignored, as in a shell's background job, it still is; terminations
    are deferred nevertheless.
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


def _interrupt(handler: Handler, frame: FrameType | None) -> None:
    """Call a handler of SIGINT, or raise KeyboardInterrupt if SIGINT is ignored or the default."""
    if not callable(handler):
        raise _Interrupt
    handler(signal.SIGINT, frame)


@contextmanager
def terminations_as_interrupts() -> Iterator[Callable[[], bool]]:
    """Treat SIGTERM, as sent by schedulers and ``kill``, as an interrupt within the block.

    A second SIGTERM ends the process immediately. Interrupts that Python reports as unraisable, as
    in a destructor or while an extension module is imported, are sent again until one passes.
    Yields a function that returns whether there was a SIGTERM. In threads other than the main one
    this has no effect.
    """
    terminated = _Interrupt.raised = False
    if threading.current_thread() is not threading.main_thread():
        yield lambda: terminated
        return

    def interrupt(_number: int, frame: FrameType | None) -> None:
        nonlocal terminated
        terminated = True
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        _interrupt(_deferring[-1] if _deferring else signal.getsignal(signal.SIGINT), frame)

    def send_again(unraisable: sys.UnraisableHookArgs) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            report(unraisable)
            return
        if not callable(signal.getsignal(signal.SIGINT)):  # ignored; it was a SIGTERM
            signal.signal(signal.SIGINT, _raise)
        start_new_thread(send_soon, ())  # threading's own waits, and would be interrupted

    def send_soon() -> None:
        sleep(SOON)
        with turn:
            if not ended:
                interrupt_main()

    turn, ended = threading.Lock(), False
    report, sys.unraisablehook = sys.unraisablehook, send_again
    keyboard = signal.getsignal(signal.SIGINT)
    if keyboard is signal.default_int_handler:
        signal.signal(signal.SIGINT, _raise)
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield lambda: terminated
        with turn:  # interrupts sent before arrive here, not after the block
            ended = True
    finally:
        sys.unraisablehook = report
        signal.signal(signal.SIGTERM, before)
        signal.signal(signal.SIGINT, keyboard)
