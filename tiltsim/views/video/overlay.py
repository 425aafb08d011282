"""How each kind of vehicle is filmed: where the camera stands, what is written, what is inset."""

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

INSET_SHARE: Final = 0.32  # of the height
GAP_SHARE: Final = 0.025


class Eye(NamedTuple):
    """Where the camera stands, seen from the vehicle."""

    distance: float  # radii of the vehicle
    azimuth: float  # degrees
    elevation: float  # degrees, negative from above


class Aspect(Protocol):
    """One flight as it is filmed."""

    eye: Eye
    caption: Caption

    def rows(self, sample: int) -> dict[str, str]:
        """What is written of a sample besides time and error."""

    def paint(self, image: Image, sample: int) -> None:
        """Paint over the frame of a sample, in place."""


class RotorcraftAspect:
    """A rotorcraft, with the roll-pitch plane in the corner."""

    eye = Eye(7.5, 130.0, -24.0)

    def __init__(self, flight: Flight, height: int) -> None:
        self._flight = flight
        self._n = torque_free_directions(flight.columns, flight.scenario.rotorcraft.resolve())
        self._attitude = np.stack([flight["roll"], flight["pitch"]], axis=1)
        side = float(np.sign(flight["singularity_margin"][0])) or 1.0
        self._inset = PlaneInset(round(INSET_SHARE * height), side)
        self._curve_stands = curve_is_constant(flight.scenario)
        self._gap = round(GAP_SHARE * height)
        self.caption = Caption(
            "shaded: attitudes out of reach", self._gap, self._inset.size + self._gap
        )

    def rows(self, sample: int) -> dict[str, str]:
        """See `Aspect.rows`."""
        flight = self._flight
        return {
            "singularity margin": f"{abs(flight['singularity_margin'][sample]):.2f} rad",
            "roll, pitch": f"{flight['roll'][sample]:+.2f}, {flight['pitch'][sample]:+.2f} rad",
        }

    def paint(self, image: Image, sample: int) -> None:
        """See `Aspect.paint`."""
        trail = self._attitude[self._trail_start(sample) : sample + 1 : 2]
        trail = np.concatenate([trail, self._attitude[sample : sample + 1]])
        margin = float(self._flight["singularity_margin"][sample])
        overlay_inset(image, self._inset.paint(self._n[sample], trail, margin), self._gap)

    def _trail_start(self, sample: int) -> int:
        """The first sample of the trail, an even one lest the trail crawl from frame to frame."""
        if self._curve_stands:
            return 0
        time = self._flight["time"]
        start = int(np.searchsorted(time, time[sample] - MOVING_TRAIL_TIME))
        return start - start % 2


class TiltCarAspect:
    """A tilt-car, from above and behind."""

    eye = Eye(9.0, 90.0, -62.0)
    caption = Caption("", 0, 0)

    def __init__(self, flight: Flight, _height: int) -> None:
        self._flight = flight

    def rows(self, sample: int) -> dict[str, str]:
        """See `Aspect.rows`."""
        flight = self._flight
        squares = [flight[f"rotor_speed_{rotor}"][sample] ** 2 for rotor in (1, 2)]
        lean = flight["direction_ref"][sample] - flight["direction"][sample]
        return {
            "rotor speeds squared": f"{squares[0]:.0f}, {squares[1]:.0f} rad2/s2",
            "wanted off the middle": f"{lean:+.2f} rad",
        }

    def paint(self, image: Image, sample: int) -> None:
        """See `Aspect.paint`: nothing is inset."""


_ASPECTS: Final[dict[str, type[RotorcraftAspect] | type[TiltCarAspect]]] = {
    "rotorcraft": RotorcraftAspect,
    "tilt_car": TiltCarAspect,
}


def aspect_of(flight: Flight, height: int) -> Aspect:
    """How a flight is filmed in frames of a height (pixels)."""
    return _ASPECTS[flight.assembly.loop.kind.name](flight, height)
