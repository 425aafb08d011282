"""What happened in a flight, in words: saturation, closeness to a singularity, the end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from tiltsim.laws.assembling import loop_of
from tiltsim.laws.layers.supervision import SUPERVISION
from tiltsim.views.attitude_plane import SUPERVISION_THRESHOLD, margin_threshold
from tiltsim.views.titles import describe_controller
from tiltsim_controllers.vehicle.parameters import SPIN

if TYPE_CHECKING:
    import numpy.typing as npt

    from tiltsim.flight.end import End
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario

Level = Literal["INFO", "WARN", "ERROR"]

QUIET_TIME: Final = 0.5
"""A condition that returns within this time (s) has not been away: chatter is one event."""


_SUPERVISION_IN_WORDS: Final = {
    "scale": "supervisor scales the gait",
    "hold": "supervisor holds the gait",
    "return_to_red": "supervisor takes the gait towards red",
}


@dataclass(frozen=True)
class Event:
    """Something worth telling: when (s), how grave, and what."""

    time: float
    level: Level
    text: str


def flight_events(flight: Flight) -> list[Event]:
    """All events of a flight, in order of time."""
    watch = EventDetector(flight.scenario)
    return [watch.opening(), *watch.observe(flight), *watch.closing(flight.end)]


class EventDetector:
    """Finds the events of one flight, which may come in pieces."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._last_seen: dict[str, float] = {}
        self._lowest = (float("inf"), 0.0)

    def opening(self) -> Event:
        """What is flown."""
        scenario = self._scenario
        gait = f"gait {scenario.gait.type}, " if loop_of(scenario).uses_gait else ""
        text = (
            f"{scenario.title or scenario.address or 'flight'}: {gait}"
            f"{', '.join(describe_controller(scenario))}, "
            f"{scenario.simulation.plant} plant"
        )
        return Event(0.0, "INFO", text)

    def observe(self, piece: Flight) -> list[Event]:
        """The events within a piece of the flight that follows on from the last."""
        events = [event for found in self._conditions(piece) for event in self._onsets(*found)]
        if "singularity_margin" in piece.columns:
            margin = np.abs(piece["singularity_margin"])
            lowest = int(np.argmin(margin))
            self._lowest = min(self._lowest, (float(margin[lowest]), float(piece["time"][lowest])))
        return sorted(events, key=lambda event: event.time)

    def closing(self, end: End) -> list[Event]:
        """How close it came to a singularity, and how it ended."""
        margin, time = self._lowest
        level: Level = "INFO" if end.kind == "completed" else "ERROR"
        cause = f": {end.cause}" if end.cause else ""
        ending = Event(end.time, level, f"flight {end.kind}{cause}")
        if margin == float("inf"):
            return [ending]
        text = f"closest to singular: {margin:.3f} rad at {time:.2f} s"
        return [Event(end.time, "INFO", text), ending]

    def _conditions(
        self, piece: Flight
    ) -> Iterator[tuple[str, npt.NDArray[np.float64], npt.NDArray[np.bool_]]]:
        """Conditions to report: in words, the samples' times, and where they hold."""
        of_kind = {"rotorcraft": self._rotorcraft, "tilt_car": self._tilt_car}
        return of_kind[loop_of(self._scenario).kind.name](piece)

    def _tilt_car(
        self, piece: Flight
    ) -> Iterator[tuple[str, npt.NDArray[np.float64], npt.NDArray[np.bool_]]]:
        for rotor in (1, 2):
            yield f"rotor {rotor} saturated at zero", piece["time"], piece[f"thrust_{rotor}"] <= 0.0

    def _rotorcraft(
        self, piece: Flight
    ) -> Iterator[tuple[str, npt.NDArray[np.float64], npt.NDArray[np.bool_]]]:
        time = piece["time"]
        threshold = margin_threshold(self._scenario)
        near = np.abs(piece["singularity_margin"]) < threshold
        yield f"singularity margin below {threshold:g} rad", time, near
        if SUPERVISION in piece.columns:
            supervisor = getattr(self._scenario.controller, "supervisor")  # noqa: B009
            yield (
                _SUPERVISION_IN_WORDS[supervisor.strategy],
                time,
                piece[SUPERVISION] > SUPERVISION_THRESHOLD,
            )
        if "attitude_zone" in piece.columns:
            inside = piece["attitude_zone"] > 0.5
            yield "switched to attitude and altitude", time, inside
            yield "switched to yaw and position", time, ~inside
        vehicle = self._scenario.rotorcraft
        for rotor, spin in enumerate(SPIN, start=1):
            speed = spin * piece[f"rotor_speed_{rotor}"]
            yield f"rotor {rotor} has reversed", time, speed <= 0.0
            # The integrator stops on a limit to rounding, so a hair's breadth counts as reached.
            if vehicle.max_rotor_speed is not None:
                full = speed >= vehicle.max_rotor_speed * (1.0 - 1e-9)
                yield f"rotor {rotor} saturated at {vehicle.max_rotor_speed:g} rad/s", time, full
            if vehicle.min_rotor_speed is not None:
                least = speed <= vehicle.min_rotor_speed * (1.0 + 1e-9)
                yield f"rotor {rotor} saturated at {vehicle.min_rotor_speed:g} rad/s", time, least

    def _onsets(
        self, text: str, times: npt.NDArray[np.float64], holds: npt.NDArray[np.bool_]
    ) -> Iterator[Event]:
        """An event for every time a condition sets in after it has been away for a while."""
        for time in times[holds].tolist():
            if time - self._last_seen.get(text, -np.inf) > QUIET_TIME:
                yield Event(time, "WARN", text)
            self._last_seen[text] = time
