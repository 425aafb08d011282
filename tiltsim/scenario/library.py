"""The scenario library and other shipped files, and limits on the content of all files."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from tiltsim.errors import InputError
from tiltsim.resources import shipped_folder
from tiltsim.scenario.messages import did_you_mean
from tiltsim.system.files import is_file, is_folder

MAX_FILE_SIZE: Final = 4 * 2**20  # bytes of a text file
MAX_DEPTH: Final = 64  # tables and lists in one another, and steps of a dotted key
MAX_VALUES: Final = 200_000  # values of a document; entries of lists count one by one
MAX_ROWS: Final = 10_000  # rows of a table of a reference or a gait


def read_text(path: Path) -> str:
    """The text of a file in UTF-8. Raises `InputError` if it cannot be read or is too large."""
    try:
        size = path.stat().st_size
        if size > MAX_FILE_SIZE:
            raise InputError(f"{path}: {size} bytes; at most {MAX_FILE_SIZE}")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start}: {error.reason})") from error


def check_limits(document: object, address: str) -> None:
    """Raise `InputError` for a document that is too deep or too long, or has huge integers.

    Args:
        document: Plain tables, lists and values.
        address: Its name in the message.
    """
    level, depth, values = [document], 0, 0
    while level:
        if depth > MAX_DEPTH:
            raise InputError(f"{address}: tables and lists nest more than {MAX_DEPTH} deep")
        if any(type(value) is int and abs(value) >= 2**63 for value in level):
            raise InputError(f"{address}: a whole number has more than 64 bits")
        inner: list[object] = []
        for value in level:
            inner += value.values() if isinstance(value, dict) else ()
            inner += value if isinstance(value, list | tuple) else ()
        values += len(inner)
        if values > MAX_VALUES:
            raise InputError(f"{address}: more than {MAX_VALUES} values")
        level, depth = inner, depth + 1


_SWEEP: Final = re.compile(r"^\s*\[\[?\s*(axis|bisect)\s*\]", re.MULTILINE)
"""The tables that distinguish a sweep from a scenario."""


def find_scenario_file(path: str | Path) -> Path:
    """The scenario file at a path, or of a name in the library.

    Raises `InputError` if neither is a file.
    """
    if not str(path):
        raise InputError("name a scenario; see tiltsim list")
    given = Path(path)
    if is_file(given):
        return given
    if not given.is_absolute():
        library = shipped_folder("scenarios")
        for candidate in (library / given, library / f"{given}.toml"):
            if is_file(candidate):
                return candidate
    if is_folder(given):
        raise InputError(f"{path}: a folder, not a scenario file; tiltsim check takes folders")
    hint = closest_in_library(path)
    raise InputError(
        f"{path}: no such file, nor a scenario of the library ({hint}see tiltsim list)"
    )


def closest_in_library(path: str | Path) -> str:
    """A suggestion of the file or folder of the library with the most similar name, if any."""
    library = shipped_folder("scenarios")
    places = (place.relative_to(library) for place in library.rglob("*"))
    names = [place.with_suffix("").as_posix() for place in places]
    return did_you_mean(Path(path).with_suffix("").as_posix(), names)


_OTHER_FILES: Final = {
    ".xml": "a vehicle, for the key vehicle.mjcf of a scenario, as tiltsim new writes it",
    ".parquet": "a flight; its scenario is scenario.toml beside it",
    ".py": "Python; name a controller with --controller FILE.py:NAME or controller=",
}
"""Hints at what a file that is given in place of a scenario is, by its ending."""


def read_toml(path: Path) -> dict[str, Any]:
    """The document in a TOML file. Raises `InputError` with the file and the reason."""
    if hint := _OTHER_FILES.get(path.suffix):
        raise InputError(f"{path}: not a TOML file: {hint}")
    try:
        document = tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:  # TOMLDecodeError is a ValueError
        raise InputError(f"{path}: not valid TOML: {_in_words(str(error))}") from error
    check_limits(document, str(path))
    return document


def _in_words(mistake: str) -> str:
    """A message of tomllib, with names as in the file and the usual cause."""
    name = re.match(r"Cannot (declare|mutate immutable namespace) \((.*?),?\)(.*)", mistake)
    if name is not None:
        table = ".".join(part.strip(" '\"") for part in name[2].split(","))
        return f"Cannot {name[1]} [{table}]{name[3]}"
    return mistake.replace("Invalid value", "Invalid value; text needs quotes")


def scenario_files(path: Path) -> list[Path]:
    """All scenario files under a folder, sorted, without sweeps; a file is returned itself."""
    if not path.is_dir():
        return [path]
    # Special files are skipped, but broken links are kept, to be reported.
    files = (file for file in path.rglob("*.toml") if file.is_file() or file.is_symlink())
    return sorted(file for file in files if not is_sweep(file))


def is_sweep(file: Path) -> bool:
    """Whether a TOML file defines a sweep: it has ``[[axis]]`` or ``[bisect]`` tables."""
    try:
        return _SWEEP.search(read_text(file)) is not None
    except InputError:
        return False  # reading it will report the error


def library_name(path: Path) -> str:
    """A file's address: without folder and suffix if it is in the library."""
    library = shipped_folder("scenarios")
    resolved = path.resolve()
    if resolved.is_relative_to(library.resolve()):
        return resolved.relative_to(library.resolve()).with_suffix("").as_posix()
    return str(path)


class Entry(NamedTuple):
    """A scenario or sweep, as the library lists it."""

    address: str
    title: str
    source: str

    def contains(self, word: str) -> bool:
        """Whether a word is in the address, the title or the source, ignoring case."""
        return any(word.casefold() in text.casefold() for text in self)


class Family(NamedTuple):
    """A file of the library, and its variants."""

    entry: Entry
    variants: tuple[Entry, ...]  # each by itself
    members: tuple[Entry, ...]  # below the file: "#name", title or changed keys, source if other

    @property
    def scenarios(self) -> tuple[Entry, ...]:
        """The variants; the file itself if it has none."""
        return self.variants or (self.entry,)


def selected_family(name: str, document: Mapping[str, Any], word: str) -> Family | None:
    """A file and the variants that a word selects; None if it selects nothing.

    A word in the file's own address, title or source selects all variants; any other word selects
    the variants that contain it.

    Args:
        name: Address of the file.
        document: Its content; only a valid file is certain to have the right types.
        word: Plain text, without wildcards; the case of its letters does not matter.
    """
    title, source = str(document.get("title", "")), str(document.get("source", ""))
    file = Entry(name, title, source)
    variants, members = [], []
    for variant in document.get("variant", []):
        own, differences = variant.get("title"), _differences(document, variant)
        at, place = f"#{variant['name']}", str(variant.get("source", source))
        alone = Entry(name + at, str(own or f"{title}: {differences}"), place)
        if file.contains(word) or alone.contains(word):
            variants.append(alone)
            members.append(Entry(at, str(own or differences), _shorter(place, source)))
    found = Family(file, tuple(variants), tuple(members))
    return found if variants or file.contains(word) else None


def library_families(word: str = "") -> Iterator[Family]:
    """The files of the library with the variants that a word selects; '' selects all."""
    for path in scenario_files(shipped_folder("scenarios")):
        if family := selected_family(library_name(path), read_toml(path), word):
            yield family


def library_entries(word: str = "") -> Iterator[Entry]:
    """Every scenario of the library that a word selects, variants included; '' selects all."""
    for family in library_families(word):
        yield from family.scenarios


def _differences(document: Mapping[str, Any], variant: Mapping[str, Any]) -> str:
    """The keys that a variant changes, with their values."""
    changes: dict[str, Any] = {}
    for table, values in variant.items():
        if isinstance(values, dict):
            base = document.get(table)
            same = base.items() if isinstance(base, dict) else ()
            changes |= {key: value for key, value in values.items() if (key, value) not in same}
    return ", ".join(f"{key} = {value}" for key, value in changes.items()) or "as the family"


def _shorter(source: str, family: str) -> str:
    """A member's source without the chapter and section shared with its family."""
    if source == family:
        return ""
    parts, shared = source.split(", "), family.split(", ")
    while len(parts) > 1 and shared and parts[0] == shared[0]:
        parts, shared = parts[1:], shared[1:]
    return ", ".join(parts)


def library_sweeps() -> Iterator[Entry]:
    """Every sweep of the library."""
    for path in sorted(shipped_folder("scenarios").rglob("*.toml")):
        if is_sweep(path):
            document = read_toml(path)
            yield Entry(library_name(path), document.get("title", ""), document.get("source", ""))
