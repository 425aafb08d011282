"""A sweep's definition: all that decides its rows, as plain data that processes can share."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.scenario.messages import show
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.system.files import digest, file_digests

VERSIONS: Final = ("tiltsim", "mujoco", "numpy", "scipy")
"""Packages whose arithmetic the rows depend on."""

COSMETIC: Final = (*DESCRIPTIVE, "plot")  # keys of a sweep file that change no flight
UNUSED: Final = {"expect", "claim"}  # tables of a scenario that have no effect in a sweep of it


@cache
def installed_versions() -> dict[str, str]:
    """Versions of the packages that rows depend on."""
    return {name: version(name) for name in VERSIONS}


@dataclass(frozen=True)
class SweepDefinition:
    """All that decides the rows of a sweep, in plain dicts and lists."""

    address: str  # the sweep's name on the command line
    sweep: dict[str, Any]  # the validated file
    base: dict[str, Any]  # the base scenario with every default written out
    versions: dict[str, str]  # installed versions of `VERSIONS`
    files: dict[str, str] = field(default_factory=dict)  # digests of the files that scenarios name

    def to_json(self) -> str:
        """The definition as text with a checksum, for a file."""
        return json.dumps({"sha256": _checksum(vars(self)), **vars(self)}, indent=2) + "\n"

    @staticmethod
    def from_json(text: str) -> SweepDefinition:
        """The inverse of `to_json`. Raises ValueError for any other text."""
        try:
            document = dict(json.loads(text))
            checksum = document.pop("sha256", None)
            definition, expected = SweepDefinition(**document), _checksum(document)
        except (TypeError, RecursionError):
            raise ValueError("keys are missing or unknown") from None
        if checksum != expected:
            raise ValueError("its content differs from its checksum")
        return definition

    def require_same_files(self) -> None:
        """Raise `InputError` if a file is not the one with which the definition was made."""
        found = file_digests(self.files)
        for file, expected in self.files.items():
            if found.get(file) != expected:
                raise InputError(
                    f"{self.address}: {file}: no longer the file with which this sweep began; "
                    "finished flights are kept"
                )

    def mistake(self, key: str, value: object, allowed: str) -> InputError:
        """The error, to be raised by the caller, for a key of the sweep file."""
        return InputError(f"{self.address}: {key} = {show(value)}: {allowed}")

    def difference(self, other: SweepDefinition) -> str:
        """The first difference by which another definition would give other rows, or ""."""
        ours, theirs = (_flat(one._decisive()) for one in (self, other))
        for key in [*ours, *theirs]:
            before, now = ours.get(key), theirs.get(key)
            if before != now:
                return f"{key} was {show(before)} and is {show(now)}"
        return ""

    def _decisive(self) -> dict[str, Any]:
        sweep = {key: value for key, value in self.sweep.items() if key not in COSMETIC}
        base = {key: value for key, value in self.base.items() if key not in COSMETIC}
        sweep.pop("scenario", None)  # the scenario that it names is in the base
        files = {f"sha256 of {file}": of_file for file, of_file in self.files.items()}
        return {**sweep, "scenario": base, **files, "versions": self.versions}


def _checksum(document: Mapping[str, Any]) -> str:
    return digest(json.dumps(document).encode())


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    """Nested tables and lists as one table with dotted keys."""
    if isinstance(value, dict):
        parts = [(f"{key}.{name}" if key else name, item) for name, item in value.items()]
    elif isinstance(value, list) and any(isinstance(item, dict | list) for item in value):
        parts = [(f"{key}[{position}]", item) for position, item in enumerate(value)]
    else:
        return {key: value}
    return {name: leaf for part, item in parts for name, leaf in _flat(item, part).items()}
