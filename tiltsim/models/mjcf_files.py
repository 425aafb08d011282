"""The files of a user's MJCF: their limits and their versions.

The limits are checked before MuJoCo allocates memory and time.
"""

import os
from collections.abc import Iterable
from math import isfinite, prod
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from tiltsim.system.files import is_file, is_folder

MAX_BYTES: Final = 4 * 2**20  # size of the file and all files that it includes, together
MAX_ELEMENTS: Final = 2_000
"""XML elements, with included files and each replica counted.

Ten times the elements of eight rotors on tilting arms. The time to edit a file grows with their
square: with 2,000 some 3 s, with 5,000 above 15 s.
"""

MAX_SAMPLES: Final = 4096**2  # pixels of a texture, or points of a height field
MAX_SIZE: Final = 100_000  # an attribute of ``<size>``
MAX_VALUES: Final = 1_000  # user values of each element of a kind, or of a user's sensor
MAX_FILES: Final = 10_000  # places at which the files are searched that it names
_MODELS: Final = ("include", "model")  # elements that name MJCF
_FOLDERS: Final = ("assetdir", "meshdir", "texturedir")
"""Attributes of ``<compiler>`` that say where files are."""

_TEXTS: Final = frozenset(("name", "class", "childclass", "file", "model"))
"""Attributes that are names, of any spelling."""


def check_mjcf(path: Path) -> set[Path]:
    """Raise ValueError, in one line, for MJCF that is no XML, too large, or has a NaN in it.

    Returns:
        The file and all that its includes, meshes and textures can be: MuJoCo and dm_control search
        for them in different places. Most of these do not exist.
    """
    waiting, bytes_read, elements = [path], 0, 0
    names, folders = {path.name}, {"."}
    while waiting:
        file = waiting.pop()
        if not is_file(file):
            continue  # MuJoCo reports it
        bytes_read += file.stat().st_size
        if bytes_read > MAX_BYTES:
            raise ValueError(f"more than {MAX_BYTES} bytes with what it includes")
        inside = file.parent.is_relative_to(path.parent)
        folders.add(str(file.parent.relative_to(path.parent) if inside else file.parent))
        try:
            # MuJoCo reads some text that is no XML; dm_control, which edits the file, does not.
            root = ElementTree.fromstring(file.read_bytes())
        except (ElementTree.ParseError, ValueError, OSError) as error:
            raise ValueError(f"not XML: {' '.join(str(error).split())}") from None
        pending = [(root, 1)]
        while pending:
            element, replicas = pending.pop()
            _check_attributes(element)
            named = {value for name, value in element.attrib.items() if name.startswith("file")}
            names |= named | {Path(name).name for name in named}
            if element.tag in _MODELS:
                waiting += {
                    folder / name for name in named for folder in (path.parent, file.parent)
                }
            elif element.tag == "compiler":
                folders |= {element.get(key, ".") for key in _FOLDERS}
            replicas *= prod(max(1, int(count)) for count in _numbers(element.get("count", "")))
            elements += replicas
            if elements > MAX_ELEMENTS:
                raise ValueError(f"more than {MAX_ELEMENTS} elements")
            pending += [(child, replicas) for child in element]
    if len(names) * len(folders) ** 2 > MAX_FILES:
        raise ValueError(f"more than {MAX_FILES} places of files that it names")
    found = {path.parent / one / two / name for one in folders for two in folders for name in names}
    for file in sorted(found):
        if os.path.lexists(file) and not (is_file(file) or is_folder(file)):
            raise ValueError(f"{file}: no file to read, but a pipe, a device or a broken link")
    return found


Version = tuple[tuple[Path, int, int], ...]
"""Time of the last change (ns) and size of files; zeros for files that do not exist."""

_versions: dict[Path, Version] = {}


def mjcf_version(path: Path) -> Version:
    """The version of an MJCF file and its named files. Raises ValueError as `check_mjcf`."""
    known = _versions.get(path)
    if known is None or known != _version_of(file for file, *_ in known):
        known = _versions[path] = _version_of(sorted(check_mjcf(path)))
    return known


def _version_of(files: Iterable[Path]) -> Version:
    found = []
    for file in files:
        try:
            state = file.stat()
        except (OSError, ValueError):
            found.append((file, 0, 0))
        else:
            found.append((file, state.st_mtime_ns, state.st_size))
    return tuple(found)


def _check_attributes(element: Any) -> None:
    for name, value in element.attrib.items():
        if name not in _TEXTS and not all(map(isfinite, _numbers(value))):
            raise ValueError(f"{element.tag} {name} = {value[:60]!r}: must be finite")
    for pair in (("nrow", "ncol"), ("width", "height")):
        samples = prod(number for name in pair for number in _numbers(element.get(name, "")))
        if samples > MAX_SAMPLES:
            raise ValueError(f"{element.tag} {' x '.join(pair)}: more than {MAX_SAMPLES} samples")
    for name, value in element.attrib.items():
        most = MAX_VALUES if name == "dim" or name.startswith("nuser_") else MAX_SIZE
        limited = name == "dim" or element.tag == "size"
        if limited and any(number > most for number in _numbers(value)):
            raise ValueError(f"{element.tag} {name} = {value[:60]}: at most {most}")


def _numbers(text: str) -> list[float]:
    """The numbers in an attribute; other words are left out."""
    found = []
    for word in text.split():
        try:
            found.append(float(word))
        except ValueError:
            continue
    return found
