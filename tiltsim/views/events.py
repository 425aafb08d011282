"""Log messages of a flight: saturation, small singularity margins, switches, the end."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.laws.law import SUPERVISION
from tiltsim.vehicles.spans import at_lower_limit, at_upper_limit
from tiltsim.views.attitude_plane import SUPERVISION_THRESHOLD, margin_threshold
from tiltsim.views.titles import describe_controller, describe_gait
from tiltsim_controllers.mathematics.scalar import Floats

Level = Literal["INFO", "WARN", "ERROR"]

QUIET_TIME: Final = 0.5
"""Time (s) for which a condition must have been false before it is reported again."""

Condition = tuple[str, Floats, npt.NDArray[np.bool_]]
"""A message, the times of the samples (s), and where the condition holds."""

_SUPERVISOR_MESSAGES: Final = {
    "scale": "supervisor scales the gait",
    "hold": "supervisor holds the gait",
    "return_to_red": "supervisor moves the gait toward red",
}


@dataclass(frozen=True)
class Event:
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
        title = scenario.title or scenario.address or "flight"
        about = [describe_gait(self._assembly), describe_controller(scenario)]
        texts = [title, *map(", ".join, about), f"{scenario.simulation.plant} plant"]
        return [Event(0.0, "INFO", text) for text in texts if text]

    def observe(self, piece: Flight) -> list[Event]:
        """The events within the next piece of the flight, in order of time."""
        events = []
        for text, times, holds in conditions(piece):
            for time in times[holds].tolist():
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


def conditions(piece: Flight) -> Iterator[Condition]:
    """The conditions to report for a piece of a flight, in a fixed order."""
    time, scenario = piece["time"], piece.scenario
    threshold = margin_threshold(scenario)
    if "singularity_margin" in piece.columns:
        near = np.abs(piece["singularity_margin"]) < threshold
        yield f"singularity margin below {threshold:g} rad", time, near
    supervisor = scenario.controller.supervision
    if supervisor is not None:
        active = piece[SUPERVISION] > SUPERVISION_THRESHOLD
        yield _SUPERVISOR_MESSAGES[supervisor.strategy], time, active
    if "attitude_zone" in piece.columns:
        inside = piece["attitude_zone"] > 0.5
        yield "switched to attitude-altitude control", time, inside
        yield "switched to yaw-position control", time, ~inside
    if "contact_time" in piece.columns:
        yield "touches an object", time, np.diff(piece["contact_time"], prepend=np.inf) > 0.0
    if scenario.vehicle.is_planar:
        for rotor in piece.assembly.loop.kind.rotors:
            stopped = at_lower_limit(piece[f"rotor_speed_{rotor}"], 0.0)
            yield f"rotor {rotor} saturated at zero", time, stopped
        return
    vehicle = scenario.any_rotorcraft
    for rotor, spin in enumerate(vehicle.spins, start=1):
        speed = spin * piece[f"rotor_speed_{rotor}"]
        yield f"rotor {rotor} reversed", time, speed <= 0.0
        if vehicle.max_rotor_speed is not None:
            text = f"rotor {rotor} saturated at {vehicle.max_rotor_speed:g} rad/s"
            yield text, time, at_upper_limit(speed, vehicle.max_rotor_speed)
        if vehicle.min_rotor_speed is not None:
            text = f"rotor {rotor} saturated at {vehicle.min_rotor_speed:g} rad/s"
            yield text, time, at_lower_limit(speed, vehicle.min_rotor_speed)
