"""Titles: names of flights that are shown together, and descriptions of gait and controller."""

from collections.abc import Iterator, Sequence
from itertools import chain, takewhile
from pathlib import Path
from typing import Final

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.scenario.arguments import leaves
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.system.text import in_words, valid_unicode

MIN_WORDS: Final = 4  # words that titles must share to make a common title
ABBREVIATIONS: Final = ("indi", "lqr", "pid")
"""Names of laws that are none in words."""

_MARKS: Final = ",:;."


def flight_names(scenarios: Sequence[Scenario], paths: Sequence[Path] = ()) -> list[str]:
    """A distinct name for each of several flights.

    The first of these that is distinct: the variant or file of the address, longer parts of the
    address, the folder from which the flight was loaded, longer parts of its path, the value of a
    key in which the scenarios differ (a custom controller counts as its value), a number.
    ``paths`` are the folders or files of the flights; empty for flights in memory.
    """
    addresses = [scenario.address for scenario in scenarios]
    parts = [address.partition("#") for address in addresses]
    short = [variant or file.rpartition("/")[2].removesuffix(".toml") for file, _, variant in parts]
    folders = [_folder(path) for path in paths]
    candidates = chain([short], _endings(addresses), _endings(folders), _differences(scenarios))
    for names in candidates:
        if all(names) and len(set(names)) == len(scenarios):
            return names
    return [f"{name or 'flight'}_{number}" for number, name in enumerate(short, start=1)]


def _differences(scenarios: Sequence[Scenario]) -> Iterator[list[str]]:
    """The values, defaults included, of each key that a scenario sets, in words."""
    tables = [one.model_dump(exclude_unset=True, exclude={*DESCRIPTIVE}) for one in scenarios]
    whole = [dict(leaves(one.model_dump())) for one in scenarios]
    own = [getattr(s.controller, "attribute", "").rpartition(".")[2] for s in scenarios]
    for key in dict.fromkeys(key for given in tables for key, _ in leaves(given)):
        values = [name or keys.get(key) for name, keys in zip(own, whole, strict=True)]
        values = ["" if value is None else value for value in values]
        # Names speak without their key.
        word = in_words(key.rpartition(".")[2])
        yield [value if isinstance(value, str) else f"{word} {value}" for value in values]


def common_title(scenarios: Sequence[Scenario]) -> str:
    """The common start of the titles of all scenarios, or else the name of their scenario file."""
    titles = [scenario.title.split() for scenario in scenarios]
    columns = ({word.rstrip(_MARKS) for word in words} for words in zip(*titles, strict=False))
    start = [words.pop() for words in takewhile(lambda words: len(words) == 1, columns)]
    if len(start) >= MIN_WORDS or (titles[0] and all(title == titles[0] for title in titles)):
        return " ".join(titles[0][: len(start)]).rstrip(_MARKS)
    families = {file for file, _, _ in (one.address.rpartition("#") for one in scenarios)}
    words = in_words(families.pop().rpartition("/")[2]) if len(families) == 1 else ""
    return words[:1].upper() + words[1:]


def address_in_words(address: str) -> str:
    """An address for readers: its file and variant, such as ``Line, continuous t2 modified``."""
    file, _, variant = address.partition("#")
    name = in_words(file.rpartition("/")[2].removesuffix(".toml"))
    return ", ".join(filter(None, (name[:1].upper() + name[1:], in_words(variant))))


def law_in_words(name: str) -> str:
    """The name of a controller for readers; abbreviations in capitals."""
    if name == "given":
        return "the scenario's own"
    return name.upper() if name in ABBREVIATIONS else name.replace("_", "-")


def _folder(path: Path) -> str:
    """The absolute path of a flight's folder, or of its Parquet file if that has another name."""
    # Links are not resolved: their names are the user's own.
    whole = path.resolve() if ".." in path.parts else path.absolute()
    if whole.name == "flight.parquet":
        whole = whole.parent
    return valid_unicode(whole.as_posix()).removesuffix(".parquet")


def _endings(names: Sequence[str]) -> Iterator[list[str]]:
    """The last part of every name, the last two parts, and so on up to the whole names."""
    parts = [name.split("/") for name in names]
    for count in range(1, max(map(len, parts), default=0) + 1):
        yield ["/".join(part[-count:]) for part in parts]


def describe_gait(assembly: Assembly) -> list[str]:
    """The gait of a flight for titles; empty for controllers without one."""
    gait = assembly.scenario.gait.type.replace("_", " ")
    return [f"{gait} gait"] if assembly.loop.uses_gait else []


def describe_controller(scenario: Scenario) -> list[str]:
    """The controller of a scenario for titles, most specific part first."""
    controller = scenario.controller
    parts = [f"{law_in_words(controller.law)} controller"]
    if not isinstance(controller, AttitudeAltitudeController):
        return parts
    if controller.gait_rate_feedforward:
        parts.append("tilt-rate feed-forward")
    leans = controller.decoupler != "none"
    return [f"{controller.decoupler} decoupler", *parts] if leans else parts
