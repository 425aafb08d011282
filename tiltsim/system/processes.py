"""Work for several processes, results as they come."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


class ProcessDiedError(RuntimeError):
    """A process ended before it could answer, as the system ends those that take all memory."""


def in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[tuple[Item, Future[Result]]]:
    """Do ``work`` for all items on at most ``jobs`` processes; yield each that is finished.

    A process that dies is replaced and takes down only the item it was at work on, whose future
    holds a `ProcessDiedError`. Leaving the loop, an interrupt among other ways, ends all processes
    at once.

    Each process has a pipe of its own and there are no locks, for with those of the standard
    library's pools one that is ended while it answers leaves the others, or this one, waiting.
    """
    waiting, processes = list(reversed(items)), list[BaseProcess]()
    busy: dict[Connection, tuple[BaseProcess, Item]] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                process, connection = _begin(work)
                processes.append(process)
                busy[connection] = process, _give(connection, waiting.pop())
            for ready in wait([*busy]):
                assert isinstance(ready, Connection)
                process, item = busy.pop(ready)
                future: Future[Result] = _answer(ready, process)
                # Its next item first, so that it need not wait for what is done with this one.
                if waiting and process.is_alive():
                    busy[ready] = process, _give(ready, waiting.pop())
                else:
                    ready.close()
                yield item, future
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()


def _begin(work: Callable[[Item], Result]) -> tuple[BaseProcess, Connection]:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, work), daemon=True)
    with _interrupts_held():
        process.start()
    there.close()  # the process has it alone, so that its end is told here
    return process, here


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Interrupts wait for the end of the block, and never reach a process begun within it.

    One that is still importing would meet an interrupt with a traceback.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # else the first process would start it, and lift the mask
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _give(connection: Connection, item: Item) -> Item:
    with suppress(OSError):  # it has died, which its answer will tell
        connection.send(item)
    return item


def _answer(connection: Connection, process: BaseProcess) -> Future[Result]:
    future: Future[Result] = Future()
    try:
        result, error = connection.recv()
    except (EOFError, OSError):
        process.join()
        error = ProcessDiedError(f"a process died with exit code {process.exitcode}")
    except Exception as unreadable:
        error = unreadable
    if error is None:
        future.set_result(result)
    else:
        future.set_exception(error)
    return future


def _serve(connection: Connection, work: Callable[[Item], Result]) -> None:
    """What a process does: leave interrupts to the parent, answer, and end when it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    while True:
        try:
            item = connection.recv()
        except EOFError:  # there are no more
            return
        try:
            answer = pickle.dumps((work(item), None))
        except Exception as error:
            answer = pickle.dumps((None, error))
        connection.send_bytes(answer)


def _end_with(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)
