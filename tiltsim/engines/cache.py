"""The folder of compiled code, and which control steps it holds."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Final

import tiltsim_controllers
from tiltsim.folders import FLYING


def core_sources() -> list[Path]:
    """The sources that a flight depends on."""
    package = Path(__file__).parents[1]
    own = [file for name in FLYING for file in (package / name).rglob("*.py")]
    return sorted([*Path(tiltsim_controllers.__file__).parent.rglob("*.py"), *own])


@cache
def native_code_folder() -> Path:
    """The folder of code compiled from exactly these sources with exactly these versions."""
    versions = [version(name) for name in ("numba", "llvmlite", "numpy", "mujoco")]
    digest = hashlib.sha256(repr([*versions, platform.platform()]).encode())
    for source in core_sources():
        digest.update(source.read_bytes())
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "tiltsim" / digest.hexdigest()[:16]


def native_code_is_cached(name: str) -> bool:
    """Whether native code of this name would be loaded rather than compiled."""
    return _mark(name).exists()


before_compiling: Final[list[Callable[[str], None]]] = []
"""Called with a name before its code is compiled, so that a display can announce the delay."""


def announce_native_code(name: str) -> None:
    """Announce that native code of this name will be compiled, unless it is cached."""
    if before_compiling and not native_code_is_cached(name):
        for announce in before_compiling:
            announce(name)


def mark_native_code_compiled(name: str) -> None:
    """Mark native code of this name as cached, if the folder is writable."""
    if native_code_is_cacheable():
        _mark(name).touch()


def _mark(name: str) -> Path:
    """An empty file: the names of numba's own files do not identify a loop."""
    return native_code_folder() / f"{name}.compiled"


def native_code_is_cacheable() -> bool:
    """Whether the folder of compiled code is writable."""
    folder = native_code_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
