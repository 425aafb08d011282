"""The text and inset over the frames of a video, by kind of vehicle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

import numpy as np

from tiltsim.views.attitude_plane import (
    MOVING_TRAIL_TIME,
    curve_is_constant,
    torque_free_directions,
)
from tiltsim.views.video.inset import PlaneInset, overlay_inset
from tiltsim.views.video.offscreen import Caption, Image

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight

INSET_SHARE: Final = 0.32  # of the frame's height
GAP_SHARE: Final = 0.025


class CameraPose(NamedTuple):
    """The pose of the camera relative to the vehicle, at which it looks."""

    distance: float  # vehicle radii
    azimuth: float  # degrees
    elevation: float  # degrees, negative from above


class Overlay(Protocol):
    """What is drawn over the frames of one flight, and the camera that suits it."""

    camera: CameraPose
    caption: Caption

    def rows(self, sample: int) -> dict[str, str]:
        """Rows of the frame's table besides time and position error."""

    def paint(self, image: Image, sample: int) -> None:
        """Paint over the frame of a sample, in place."""


class AttitudeOverlay(Overlay):
    """The attitude of a rotorcraft and, if it is known, its singularity margin."""

    camera = CameraPose(7.5, 130.0, -24.0)
    caption = Caption("", 0, 0)

    def __init__(self, flight: Flight) -> None:
        self._flight = flight

    def rows(self, sample: int) -> dict[str, str]:
        flight, rows = self._flight, {}
        if "singularity_margin" in flight:
            margin = abs(flight["singularity_margin"][sample])
            rows["singularity margin"] = f"{margin:.2f} rad"
        roll, pitch = (flight[name][sample] for name in ("roll", "pitch"))
        return {**rows, "roll, pitch": f"{roll:+.2f}, {pitch:+.2f} rad"}

    def paint(self, image: Image, sample: int) -> None:
        """Paint nothing: without a curve of singular attitudes there is no inset."""


class PlaneOverlay(AttitudeOverlay):
    """The same, and the roll-pitch plane in the corner."""

    def __init__(self, flight: Flight, height: int) -> None:
        super().__init__(flight)
        self._n = torque_free_directions(flight.columns, flight.scenario.rotorcraft.resolve())
        self._attitude = np.stack([flight["roll"], flight["pitch"]], axis=1)
        side = float(np.sign(flight["singularity_margin"][0])) or 1.0
        self._inset = PlaneInset(round(INSET_SHARE * height), side)
        self._curve_is_constant = curve_is_constant(flight.scenario)
        self._gap = gap = round(GAP_SHARE * height)
        self.caption = Caption("shaded: unreachable attitudes", gap, self._inset.size + gap)

    def paint(self, image: Image, sample: int) -> None:
        trail = self._attitude[self._trail_start(sample) : sample + 1 : 2]
        trail = np.concatenate([trail, self._attitude[sample : sample + 1]])
        margin = float(self._flight["singularity_margin"][sample])
        overlay_inset(image, self._inset.paint(self._n[sample], trail, margin), self._gap)

    def _trail_start(self, sample: int) -> int:
        """The first sample of the trail: an even one, so that the trail does not shimmer."""
        if self._curve_is_constant:
            return 0
        time = self._flight["time"]
        start = int(np.searchsorted(time, time[sample] - MOVING_TRAIL_TIME))
        return start - start % 2


class TiltCarOverlay(Overlay):
    """Rotor speeds and the direction error of a tilt-car, seen from above and behind."""

    camera = CameraPose(9.0, 90.0, -62.0)
    caption = Caption("", 0, 0)

    def __init__(self, flight: Flight) -> None:
        self._flight = flight

    def rows(self, sample: int) -> dict[str, str]:
        flight = self._flight
        squares = [flight[f"rotor_speed_{rotor}"][sample] ** 2 for rotor in (1, 2)]
        error = flight["direction_ref"][sample] - flight["direction"][sample]
        return {
            "rotor speeds squared": f"{squares[0]:.0f}, {squares[1]:.0f} rad2/s2",
            "direction error": f"{error:+.2f} rad",
        }

    def paint(self, image: Image, sample: int) -> None:
        """Paint nothing: a tilt-car has no inset."""
