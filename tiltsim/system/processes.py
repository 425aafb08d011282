"""Distributing work over several processes."""

import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from tiltsim.system.environment import variables_for_processes
from tiltsim.system.interrupts import defer_interrupts

Item = TypeVar("Item")
Result = TypeVar("Result")


class ProcessDiedError(RuntimeError):
    """A process ended before it could answer, for example because the system ran out of memory."""


def in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[tuple[Item, Future[Result]]]:
    """Call ``work`` for all items on at most ``jobs`` processes; yield each as it finishes.

    A process that dies is replaced; only the future of its item holds a `ProcessDiedError`. Leaving
    the loop, for example by an interrupt, ends all processes immediately.

    Each process has its own pipe, without locks: a process of the standard library's pools that is
    killed while it answers keeps a lock, for which the others, or this one, then wait forever.
    """
    waiting, processes = list(reversed(items)), list[BaseProcess]()
    busy: dict[Connection, tuple[BaseProcess, Item]] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                with defer_interrupts():  # a process that is not sent its work prints a traceback
                    process, connection = begin(work)
                    processes.append(process)
                busy[connection] = process, give(connection, waiting.pop())
            for ready in wait([*busy]):
                assert isinstance(ready, Connection)
                process, item = busy.pop(ready)
                future: Future[Result] = answer(ready, process)
                # Send the next item first, so that the process does not wait for the loop's body.
                if waiting and process.is_alive():
                    busy[ready] = process, give(ready, waiting.pop())
                else:
                    ready.close()
                yield item, future
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()


def in_order(found: Iterable[tuple[int, Result]]) -> Iterator[Result]:
    """Results whose places come in any order, each as soon as all those before it are there."""
    done: dict[int, Result] = {}
    following = 0
    for place, result in found:
        done[place] = result
        while following in done:
            yield done.pop(following)
            following += 1


def begin(work: Callable[[Item], Result]) -> tuple[BaseProcess, Connection]:
    """Start a process that calls ``work`` for each item that it is sent; it ends with its pipe."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, work), daemon=True)
    with _environment(), _interrupts_blocked():
        process.start()
    there.close()  # only the process holds it now, so its death closes the pipe
    return process, here


@contextmanager
def _environment() -> Iterator[None]:
    """Start processes with `variables_for_processes`: else they find the folder's signal.py."""
    added = variables_for_processes()
    os.environ |= added
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block SIGINT in the block and its processes, whose imports would print a traceback."""
    if sys.platform == "win32":
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # else the first process would start it, and unblock SIGINT
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def give(connection: Connection, item: Item) -> Item:
    """Send an item to a process of `begin`; returns it."""
    with suppress(OSError):  # if it has died, reading its answer reports it
        connection.send(item)
    return item


def answer(connection: Connection, process: BaseProcess) -> Future[Any]:
    """Wait for the result of the next item; `ProcessDiedError` if the process has ended."""
    future: Future[Any] = Future()
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
    """Body of a process: ignore interrupts, answer requests, and end with the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    with suppress(EOFError, OSError):  # there are no more items, or their sender has died
        while True:
            item = connection.recv()
            try:
                message = pickle.dumps((work(item), None))
            except Exception as error:
                message = pickle.dumps((None, error))
            connection.send_bytes(message)


def _end_with(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)
