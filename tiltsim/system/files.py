"""Output files and folders: checked before the work, written atomically."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tiltsim.errors import InputError


def prepare_folder(folder: Path) -> None:
    """Create a folder for results before the flight. Raises `InputError` if that is impossible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be created: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"--out {folder}: not writable")


def prepare_file(option: str, file: Path, suffixes: Sequence[str] = ()) -> None:
    """Check that a file can be written, before the work for it begins.

    Parameters
    ----------
    option
        Of the command line, for the message.
    file
        The file.
    suffixes
        Allowed suffixes, lower case with their dots; empty allows any.

    Raises
    ------
    InputError
        If the file cannot be written or its suffix is not allowed.
    """
    if suffixes and file.suffix.lower() not in suffixes:
        raise InputError(
            f"{option} {file}: unknown format {file.suffix!r}; choose {', '.join(suffixes)}"
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
    """Yield a temporary path that replaces ``path`` atomically when the block succeeds."""
    # An ordinary file, unlike tempfile's, gets the permissions of the user's umask.
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
