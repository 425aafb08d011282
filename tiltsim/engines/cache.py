"""Where compiled control steps are kept between runs."""

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
    """The folder for code compiled from exactly these sources with exactly these versions."""
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
"""Called with a name before its code is compiled, which takes seconds, for a screen to say so."""


def announce_native_code(name: str) -> None:
    """Say that native code of this name will be loaded or, where there is none yet, compiled."""
    if before_compiling and not native_code_is_cached(name):
        for tell in before_compiling:
            tell(name)


def mark_native_code_compiled(name: str) -> None:
    """Remember that native code of this name is on disk now, if it can be kept."""
    if native_code_is_cacheable():
        _mark(name).touch()


def _mark(name: str) -> Path:
    """An empty file: numba's own files do not tell which law they hold."""
    return native_code_folder() / f"{name}.compiled"


def native_code_is_cacheable() -> bool:
    """Whether compiled code can be written for the next run."""
    folder = native_code_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
