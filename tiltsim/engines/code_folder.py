"""The folder of compiled code."""

import os
from contextlib import suppress
from pathlib import Path


def code_folder() -> Path:
    """The folder of compiled code, in the user's folder for caches."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():  # to be ignored, as the specification of XDG_CACHE_HOME says
        base = Path.home() / ".cache"
    return base / "tiltsim" / "machine_code"


def is_usable(folder: Path) -> bool:
    """Whether compiled code may be kept and loaded: its folder is writable, and by nobody else.

    Whoever can write there decides what a flight executes.
    """
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
