"""Limits of a user's MJCF, checked before MuJoCo allocates memory and time for it."""

from __future__ import annotations

from math import isfinite, prod
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

MAX_BYTES: Final = 4 * 2**20
"""Of the file and of those that it includes, together."""

MAX_ELEMENTS: Final = 5_000
"""XML elements, those of included files and of each replica counted."""

MAX_SAMPLES: Final = 4096**2
"""Pixels of a texture, or points of a height field."""

MAX_SIZE: Final = 100_000
"""An attribute of ``<size>``."""

_TEXTS: Final = frozenset(("name", "class", "childclass", "file", "model"))
"""Attributes that are names, of any spelling."""


def check_mjcf(path: Path) -> None:
    """Raise ValueError, in one line, for MJCF that is no XML, too large, or has a NaN in it."""
    waiting, bytes_read, elements = [path], 0, 0
    while waiting:
        file = waiting.pop()
        if not file.is_file():
            continue  # MuJoCo reports it
        bytes_read += file.stat().st_size
        if bytes_read > MAX_BYTES:
            raise ValueError(f"more than {MAX_BYTES} bytes with what it includes")
        try:
            # MuJoCo reads some text that is no XML; dm_control, which edits the file, does not.
            root = ElementTree.fromstring(file.read_bytes())
        except (ElementTree.ParseError, ValueError, OSError) as error:
            raise ValueError(f"not XML: {' '.join(str(error).split())}") from None
        pending = [(root, 1)]
        while pending:
            element, replicas = pending.pop()
            _check_attributes(element)
            if element.tag == "include":
                waiting.append(path.parent / element.get("file", ""))
            replicas *= prod(max(1, int(count)) for count in _numbers(element.get("count", "")))
            elements += replicas
            if elements > MAX_ELEMENTS:
                raise ValueError(f"more than {MAX_ELEMENTS} elements")
            pending += [(child, replicas) for child in element]


def _check_attributes(element: Any) -> None:
    for name, value in element.attrib.items():
        if name not in _TEXTS and not all(map(isfinite, _numbers(value))):
            raise ValueError(f"{element.tag} {name} = {value[:60]!r}: must be finite")
    for pair in (("nrow", "ncol"), ("width", "height")):
        samples = prod(number for name in pair for number in _numbers(element.get(name, "")))
        if samples > MAX_SAMPLES:
            raise ValueError(f"{element.tag} {' x '.join(pair)}: more than {MAX_SAMPLES} samples")
    for name, value in element.attrib.items() if element.tag == "size" else ():
        if any(number > MAX_SIZE for number in _numbers(value)):
            raise ValueError(f"size {name} = {value[:60]}: at most {MAX_SIZE}")


def _numbers(text: str) -> list[float]:
    """The numbers in an attribute; those of text that is none are left out."""
    found = []
    for word in text.split():
        try:
            found.append(float(word))
        except ValueError:
            continue
    return found
