"""How flights of each kind of vehicle are shown: one entry of `VIEWS` per kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from tiltsim.vehicles.rotorcraft import OTHER_LAYOUT, ROTORCRAFT
from tiltsim.vehicles.tilt_car import TILT_CAR

if TYPE_CHECKING:
    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.closed_loop.vehicle_kind import VehicleKind
    from tiltsim.flight.flight import Flight
    from tiltsim.views.figures.panels import Panel
    from tiltsim.views.rerun.display import VehicleDisplay
    from tiltsim.views.video.overlay import Overlay


@dataclass(frozen=True)
class VehicleViews:
    """The views of one kind of vehicle, whose modules are imported when they are needed.

    Attributes:
        page: Name of the panels of its page, below `tiltsim.views.figures`.
        caption: Name of the class of its videos' overlay, in `tiltsim.views.video.overlay`.
        viewer: Name of its display in Rerun, below `tiltsim.views.rerun`.
    """

    page: str
    caption: str
    viewer: str

    def panels(self) -> Mapping[str, Panel]:
        """The panels of a flight's page, by name."""
        panels: Mapping[str, Panel] = _imported(f"figures.{self.page}")
        return panels

    def overlay(self, flight: Flight, height: int) -> Overlay:
        """Camera and captions of a video of a flight, with frames of a height (pixels)."""
        overlay: Overlay = _imported(f"video.overlay.{self.caption}")(flight, height)
        return overlay

    def display(self) -> VehicleDisplay:
        """Panels and camera in Rerun."""
        display: VehicleDisplay = _imported(f"rerun.{self.viewer}")
        return display


def _imported(name: str) -> Any:
    """What has a dotted name in the modules beside this one."""
    module, _, name = name.rpartition(".")
    return getattr(import_module(f"tiltsim.views.{module}"), name)


VIEWS: Final[dict[VehicleKind, VehicleViews]] = {
    ROTORCRAFT: VehicleViews(
        "rotorcraft.ROTORCRAFT_PANELS", "RotorcraftOverlay", "rotorcraft_display.ROTORCRAFT_DISPLAY"
    ),
    OTHER_LAYOUT: VehicleViews(
        "rotorcraft.ROTORCRAFT_PANELS", "AttitudeOverlay", "rotorcraft_display.OTHER_LAYOUT_DISPLAY"
    ),
    TILT_CAR: VehicleViews(
        "tilt_car.TILT_CAR_PANELS", "TiltCarOverlay", "tilt_car_display.TILT_CAR_DISPLAY"
    ),
}

MULTIROTOR: Final = VehicleViews(
    "rotorcraft.MULTIROTOR_PANELS", "MarginOverlay", "rotorcraft_display.MULTIROTOR_DISPLAY"
)
"""Views of a multirotor, whose singular attitudes need not be a curve."""


def views_of(assembly: Assembly) -> VehicleViews:
    """The views of an assembly's kind of vehicle; each layout of a multirotor is a kind."""
    if assembly.scenario.vehicle.model == "multirotor":
        return MULTIROTOR
    return VIEWS[assembly.loop.kind]
