"""Locks between processes, and between the threads of one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from threading import RLock
from typing import Final, ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

_BUILDING: Final = RLock()


def one_thread_at_a_time(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Let threads call a function, and all others decorated so, one after the other.

    For what builds and caches the parts that flights share: models, closed loops, compiled code.
    """

    @wraps(function)
    def alone(*arguments: Parameters.args, **keywords: Parameters.kwargs) -> Result:
        with _BUILDING:
            return function(*arguments, **keywords)

    return alone


@contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[None]:
    """Hold an exclusive lock during the block; it is released even if the process is killed.

    ``path`` is the lock file, which is created and not removed; the content of an existing one
    stays, and links are refused. Raises BlockingIOError if another process holds the lock, unless
    ``wait`` is true. Without ``fcntl`` this has no effect.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    with os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)) as file:
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
