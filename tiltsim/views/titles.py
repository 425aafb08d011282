"""What flights are called where several are shown together: by what tells them apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from tiltsim.scenario.scenario import Scenario
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario
from tiltsim.laws.assembling import loop_of


def flight_names(scenarios: Sequence[Scenario], paths: Sequence[Path] = ()) -> list[str]:
    """A name for each of several flights, no two alike.

    By their addresses where these differ, as short as can be: variant or file, else more of the
    address. Where two flights are of one address, by where they were loaded from: the folder, else
    as much of the path as tells them apart. Where that does not help either, numbered.

    Parameters
    ----------
    scenarios
        What was flown.
    paths
        What each flight was loaded from, a folder or a file; empty for flights in memory.
    """
    addresses = [scenario.address for scenario in scenarios]
    short = [_short(address) for address in addresses]
    folders = [_folder(path) for path in paths]
    for names in (short, *_endings(addresses), *_endings(folders)):
        if all(names) and len(set(names)) == len(scenarios):
            return names
    return [f"{name or 'flight'}_{number}" for number, name in enumerate(short, start=1)]


def common_title(scenarios: Sequence[Scenario]) -> str:
    """The title that all scenarios have, else the family that all are of; else empty."""
    titles = {scenario.title for scenario in scenarios}
    families = {file for file, _, _ in (one.address.rpartition("#") for one in scenarios)}
    title = titles.pop() if len(titles) == 1 else ""
    return title or (families.pop() if len(families) == 1 else "")


def _short(address: str) -> str:
    """The variant, or the file without its folder and suffix."""
    file, _, variant = address.partition("#")
    return variant or file.rpartition("/")[2].removesuffix(".toml")


def _folder(path: Path) -> str:
    """Where a flight lies, from the root on; a Parquet file of a name of its own counts, too."""
    # Links are not followed, for they bear the user's own names.
    whole = path.resolve() if ".." in path.parts else path.absolute()
    if whole.name == "flight.parquet":
        whole = whole.parent
    return whole.as_posix().removesuffix(".parquet")


def _endings(names: Sequence[str]) -> Iterator[list[str]]:
    """The last part of every name, the last two parts, and so on until nothing is left out."""
    parts = [name.split("/") for name in names]
    for count in range(1, max(map(len, parts), default=0) + 1):
        yield ["/".join(part[-count:]) for part in parts]


def describe_gait(scenario: Scenario) -> list[str]:
    """The gait of a scenario for titles; nothing where its law flies none."""
    return [f"{scenario.gait.type} gait"] if loop_of(scenario).uses_gait else []


def describe_controller(scenario: Scenario) -> list[str]:
    """The law of a scenario for titles, most telling first."""
    controller = scenario.controller
    words = [f"{controller.law.replace('_', '-')} law"]
    if getattr(controller, "gait_rate_feedforward", False):
        words.append("gait rates fed forward")
    decoupler = getattr(controller, "decoupler", "none")  # only laws that lean to steer have one
    return words if decoupler == "none" else [f"{decoupler} decoupler", *words]
