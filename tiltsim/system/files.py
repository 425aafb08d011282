"""Output files and folders: checked before the work, written atomically."""

import errno
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import wraps
from pathlib import Path
from threading import RLock
from typing import Final, ParamSpec, TypeVar

from tiltsim.errors import InputError

TEMPORARY_SUFFIX: Final = ".new"
"""Suffix of unfinished files, whose names begin with a dot; a killed process leaves them."""

_RANDOM_BYTES: Final = 8  # in the name of such a file, in hexadecimal digits

_BUILDING: Final = RLock()


def digest(content: bytes) -> str:
    """The SHA-256 of the content of a file, in hexadecimal digits."""
    from hashlib import sha256  # loads OpenSSL, which costs start-up time

    return sha256(content).hexdigest()


def file_digests(files: Iterable[str | Path]) -> dict[str, str]:
    """The digests of those files that can be read, by name."""
    found = {}
    for file in map(Path, files):
        with suppress(OSError, ValueError):  # the latter for a NUL in the name
            if is_file(file):
                found[str(file)] = digest(file.read_bytes())
    return found


def is_file(path: str | Path) -> bool:
    """Whether a path is a file; no name is too long to ask, unlike with `Path.is_file`."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: str | Path) -> bool:
    """Whether a path is a folder; no name is too long to ask, unlike with `Path.is_dir`."""
    return os.path.isdir(path)  # noqa: PTH112


def exists(path: str | Path) -> bool:
    """Whether a path exists; no name is too long to ask, unlike with `Path.exists`."""
    return os.path.exists(path)  # noqa: PTH110


def prepare_folder(folder: Path) -> None:
    """Create a folder for results before the flight. Raises `InputError` if that is impossible."""
    _require_possible_name("", folder)
    if folder.is_file():
        raise InputError(f"{folder}: is a file; give a folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created: {reason(error)}") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"{folder}: not writable")


def prepare_file(option: str, file: Path, suffixes: Sequence[str] = ()) -> None:
    """Raise `InputError` unless the file of an option can be written and its suffix fits.

    Called before the work for the file begins. Suffixes are in lower case; empty allows any.
    """
    _require_possible_name(f"{option} ", file)
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


def _require_possible_name(option: str, path: Path) -> None:
    # Python raises a ValueError for such a name, where the system would an OSError.
    if "\0" in str(path):
        raise InputError(f"{option}{path}: no file can have a null character in its name")
    try:
        path.lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise InputError(f"{option}{path}: {reason(error)}") from None


@contextmanager
def replacing(path: Path, *, durable: bool = False) -> Iterator[Path]:
    """Yield a temporary path that replaces ``path`` atomically when the block succeeds.

    A ``durable`` file is on disk after the block, so that no crash of the machine can lose it. A
    device or pipe is written itself.

    Raises:
        InputError: If the file cannot be written, as on a full disk.
    """
    _require_possible_name("", path)
    special = path.exists() and not path.is_file()
    # A name that nobody can guess and make a link of. Unlike tempfile's, the file gets the
    # permissions of the umask.
    temporary = path.with_name(f".{path.name}.{os.urandom(_RANDOM_BYTES).hex()}{TEMPORARY_SUFFIX}")
    try:
        yield path if special else temporary
        if not special:
            if durable:
                _flush(temporary)
            temporary.replace(path)
            if durable:
                _flush(path.parent)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {reason(error)}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    if path.is_dir() and os.name == "nt":
        return  # Windows opens no folders
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)  # to flush is to write
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def remove_leftovers(folder: Path, names: re.Pattern[str]) -> None:
    """Remove what killed processes left of `replacing` files with matching names in a folder."""
    random = rf"[0-9a-f]{{{2 * _RANDOM_BYTES}}}"
    left = re.compile(rf"\.({names.pattern})\.{random}{re.escape(TEMPORARY_SUFFIX)}")
    for file in folder.iterdir():
        if left.fullmatch(file.name) and file.is_file():
            file.unlink()


def reason(error: OSError) -> str:
    """Why the operating system refused, in a few words."""
    if error.errno == errno.ENOENT and _is_without_folder():
        return "the working folder no longer exists"
    known = error.errno in errno.errorcode
    return os.strerror(error.errno or 0) if known else str(error).partition("\n")[0]


def _is_without_folder() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


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
