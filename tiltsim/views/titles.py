"""Texts about flights: titles, descriptions of gait and controller, log messages."""

from collections.abc import Iterator, Sequence
from itertools import chain, takewhile
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.laws.law import SUPERVISION
from tiltsim.scenario.documents import leaves
from tiltsim.scenario.linearizing_controllers import AttitudeAltitudeController
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.system.text import in_words, valid_unicode
from tiltsim.vehicles.metrics import at_lower_limit, at_upper_limit
from tiltsim.views.attitude_plane import SUPERVISION_THRESHOLD, margin_threshold

MIN_WORDS: Final = 4  # words that titles must share to make a common title
ABBREVIATIONS: Final = ("indi", "lqr", "pid")  # names of laws that are none in words

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


Level = Literal["INFO", "WARN", "ERROR"]

QUIET_TIME: Final = 0.5
"""Time (s) for which a condition must have been false before it is reported again."""

_SUPERVISOR_MESSAGES: Final = {
    "scale": "supervisor scales the gait",
    "hold": "supervisor holds the gait",
    "return_to_red": "supervisor moves the gait toward red",
}


class Event(NamedTuple):
    """A message with its time (s) and level."""

    time: float
    level: Level
    text: str


class EventDetector:
    """Finds the events of one flight, which may be given in pieces."""

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self._last_true: dict[str, float] = {}
        self._minimum_margin = (float("inf"), 0.0)  # rad, and its time in s

    def opening(self) -> list[Event]:
        """The scenario; its gait, controller and plant."""
        scenario = self._assembly.scenario
        title = scenario.title or scenario.address
        about = [describe_gait(self._assembly), describe_controller(scenario)]
        texts = [title, *map(", ".join, about), f"{scenario.simulation.plant} plant"]
        return [Event(0.0, "INFO", text) for text in texts if text]

    def observe(self, piece: Flight) -> list[Event]:
        """The events within the next piece of the flight, in order of time."""
        events = []
        for text, holds in conditions(piece).items():
            for time in piece["time"][holds].tolist():
                if time - self._last_true.get(text, -np.inf) > QUIET_TIME:
                    events.append(Event(time, "WARN", text))
                self._last_true[text] = time
        if "singularity_margin" in piece.columns:
            margin = np.abs(piece["singularity_margin"])
            at = int(np.argmin(margin))
            found = float(margin[at]), float(piece["time"][at])
            self._minimum_margin = min(self._minimum_margin, found)
        return sorted(events, key=lambda event: event.time)

    def closing(self, end: End) -> list[Event]:
        """The minimum singularity margin, and how the flight ended."""
        margin, time = self._minimum_margin
        if end.kind == "completed":
            ending = Event(end.time, "INFO", "flight completed")
        else:
            cause = f": {end.cause}" if end.cause else ""
            ending = Event(end.time, "ERROR", f"flight terminated early ({end.kind}){cause}")
        if margin == float("inf"):
            return [ending]
        text = f"minimum singularity margin: {margin:.3f} rad at {time:.2f} s"
        return [Event(end.time, "INFO", text), ending]


def conditions(piece: Flight) -> dict[str, npt.NDArray[np.bool_]]:
    """Messages about a piece of a flight, and the samples at which they hold, in a fixed order."""
    found: dict[str, npt.NDArray[np.bool_]] = {}
    scenario, columns = piece.scenario, piece.columns
    if "singularity_margin" in columns:
        threshold = margin_threshold(scenario)
        near = np.abs(columns["singularity_margin"]) < threshold
        found[f"singularity margin below {threshold:g} rad"] = near
    if (supervisor := scenario.controller.supervision) is not None:
        active = columns[SUPERVISION] > SUPERVISION_THRESHOLD
        found[_SUPERVISOR_MESSAGES[supervisor.strategy]] = active
    if "attitude_zone" in columns:
        inside = columns["attitude_zone"] > 0.5
        found["switched to attitude-altitude control"] = inside
        found["switched to yaw-position control"] = ~inside
    if "contact_time" in columns:
        found["touches an object"] = np.diff(columns["contact_time"], prepend=np.inf) > 0.0
    lowest, highest = scenario.vehicle.rotor_range
    for rotor in piece.assembly.loop.kind.rotors:
        speed = scenario.vehicle.spins[rotor - 1] * columns[f"rotor_speed_{rotor}"]
        if not scenario.vehicle.is_planar:
            found[f"rotor {rotor} reversed"] = speed <= 0.0
        for limit, reached in ((highest, at_upper_limit), (lowest, at_lower_limit)):
            if limit is not None:
                text = f"{limit:g} rad/s" if limit else "zero"
                found[f"rotor {rotor} saturated at {text}"] = reached(speed, limit)
    return found
