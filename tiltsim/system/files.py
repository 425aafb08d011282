"""Flights on disk: metrics.json, flight.parquet and scenario.toml in one folder.

A flight reads back from flight.parquet alone: the samples are among its columns, the rest is in
the schema's metadata.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tiltsim.errors import InputError


def prepare_folder(folder: Path) -> None:
    """Create a folder for results before the flight. Raises `InputError` where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be created: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"--out {folder}: not writable")


def prepare_file(option: str, file: Path, endings: Sequence[str] = ()) -> None:
    """See that a file can be written before the work for it begins.

    Raises `InputError`, naming the command line's ``option``, where it cannot, or its name does not
    end in one of the ``endings``, where there are some (lower case, with their dots).
    """
    if endings and file.suffix.lower() not in endings:
        raise InputError(
            f"{option} {file}: unknown format {file.suffix!r}; choose {', '.join(endings)}"
        )
    folder = file.absolute().parent
    if not folder.is_dir():
        raise InputError(f"{option} {file}: its folder does not exist")
    if file.is_dir():
        raise InputError(f"{option} {file}: is a folder")
    if not os.access(file if file.exists() else folder, os.W_OK):
        raise InputError(f"{option} {file}: not writable")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block succeeds."""
    # An ordinary file, unlike one of tempfile's, gets the permissions that the user asked for.
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
