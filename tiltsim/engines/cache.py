"""The folder of compiled code, and which control steps it holds."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

import tiltsim_controllers
from tiltsim.folders import FLYING


def core_sources() -> list[Path]:
    """The sources that a flight depends on."""
    package = Path(__file__).parents[1]
    own = [file for name in FLYING for file in (package / name).rglob("*.py")]
    return sorted([*Path(tiltsim_controllers.__file__).parent.rglob("*.py"), *own])


def is_core_code(function: Callable[..., Any]) -> bool:
    """Whether a function is of the packages that name the `native_code_folder` by their sources."""
    return function.__module__.startswith(("tiltsim.", "tiltsim_controllers."))


@cache
def native_code_folder() -> Path:
    """The folder of code compiled from exactly these sources with exactly these versions.

    The sources' places count, too: numba finds code by the path of its source.
    """
    import hashlib  # like the next two, costs start-up time
    import platform
    from importlib.metadata import version

    versions = [version(name) for name in ("numba", "llvmlite", "numpy", "mujoco")]
    machine = platform.python_version(), platform.platform()
    digest = hashlib.sha256(repr([*versions, *machine]).encode())
    for source in core_sources():
        digest.update(os.fsencode(source) + source.read_bytes())
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "tiltsim" / digest.hexdigest()[:16]


def native_code_is_cached(name: str) -> bool:
    """Whether native code of this name would be loaded rather than compiled."""
    return native_code_is_cacheable() and _mark(name).exists()


before_compiling: Final[list[Callable[[str], None]]] = []
"""Called with a name before its code is compiled, so that a display can announce the delay."""


def announce_native_code(name: str) -> None:
    """Announce that native code of this name will be compiled, unless it is cached."""
    if before_compiling and not native_code_is_cached(name):
        for announce in before_compiling:
            announce(name)


def mark_native_code_compiled(name: str) -> None:
    """Mark native code of this name as cached, if all of it could be saved."""
    if native_code_is_cacheable() and not failed_saves:
        with suppress(OSError):
            _mark(name).touch()


failed_saves: Final[list[OSError]] = []
"""Errors of saving compiled code, as on a full disk; it is then compiled by every process."""


def _mark(name: str) -> Path:
    """An empty file: the names of numba's own files do not identify a loop."""
    return native_code_folder() / f"{name}.compiled"


def native_code_is_cacheable() -> bool:
    """Whether compiled code may be kept and loaded: its folder is writable, and by nobody else.

    Whoever can write there decides what a flight executes.
    """
    folder = native_code_folder()
    try:
        return _is_private(folder.parent) and _is_private(folder) and os.access(folder, os.W_OK)
    except OSError:
        return False


def _is_private(folder: Path) -> bool:
    """Whether a folder is this user's alone; it is created so, whatever the umask."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    if os.name == "nt":
        return True
    found = folder.stat()
    if found.st_uid != os.getuid():
        return False
    if found.st_mode & 0o077:
        folder.chmod(0o700)
    return True
