"""Locks between processes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[None]:
    """Keep other processes out of this block; the lock ends with the process, however that ends.

    ``path`` is a file that stands for what must not be shared, and stays. Raises BlockingIOError
    where another process has the lock and this one is not to ``wait``.
    """
    try:
        import fcntl
    except ImportError:  # not on this system: take care yourself
        yield
        return
    with path.open("w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
