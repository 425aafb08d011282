"""Results that the report stores in a folder, so that a second report takes seconds.

Files are named by a digest of everything that their content depends on: the resolved scenario
(without titles and expectations), the sources of the core and of the models, and the versions of
the packages that compute.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from tiltsim.engines.cache import core_sources
from tiltsim.resources import shipped_folder
from tiltsim.system.files import replacing

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario


def store(path: Path, content: bytes) -> None:
    """Write a file completely or not at all."""
    with replacing(path) as draft:
        draft.write_bytes(content)


def flight_key(scenario: Scenario) -> str:
    """Digest of everything that the numbers of a flight depend on."""
    content = scenario.model_dump(mode="json", exclude={"title", "source", "without", "expect"})
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    digest.update(code_digest())
    return digest.hexdigest()[:24]


@cache
def code_digest() -> bytes:
    """Digest of the sources of core and models, and of the versions of the numeric packages."""
    versions = [version(name) for name in ("tiltsim", "mujoco", "numpy", "numba")]
    sources = [*core_sources(), *shipped_folder("mjcf").rglob("*.xml")]
    return sources_digest(sources, *versions)


def sources_digest(sources: list[Path], *more: str) -> bytes:
    """Digest of the names and contents of files, in any order and place, and of more strings."""
    files = (hashlib.sha256(f.name.encode() + f.read_bytes()).digest() for f in sources)
    return hashlib.sha256(repr(more).encode() + b"".join(sorted(files))).digest()
