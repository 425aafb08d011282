"""How flights of each kind of vehicle are shown: one entry of `VIEWS` per kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, Protocol

from tiltsim.vehicles.rotorcraft import OTHER_LAYOUT, ROTORCRAFT
from tiltsim.vehicles.tilt_car import TILT_CAR

if TYPE_CHECKING:
    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.closed_loop.vehicle_kind import VehicleKind
    from tiltsim.flight.flight import Flight
    from tiltsim.views.figures.panels import Panel
    from tiltsim.views.rerun.display import VehicleDisplay
    from tiltsim.views.video.overlay import Overlay


class VehicleViews(Protocol):
    """The views of one kind of vehicle; methods import the libraries that they need."""

    def panels(self) -> Mapping[str, Panel]:
        """The panels of a flight's page, by name."""

    def overlay(self, flight: Flight, height: int) -> Overlay:
        """Camera and captions of a video of a flight, with frames of a height (pixels)."""

    def display(self) -> VehicleDisplay:
        """Panels and camera in Rerun."""


class RotorcraftViews(VehicleViews):
    """Views of tiltrotor and quadrotor."""

    def panels(self) -> Mapping[str, Panel]:
        from tiltsim.views.figures.rotorcraft import ROTORCRAFT_PANELS

        return ROTORCRAFT_PANELS

    def overlay(self, flight: Flight, height: int) -> Overlay:
        from tiltsim.views.video.overlay import RotorcraftOverlay

        return RotorcraftOverlay(flight, height)

    def display(self) -> VehicleDisplay:
        from tiltsim.views.rerun.rotorcraft_display import ROTORCRAFT_DISPLAY

        return ROTORCRAFT_DISPLAY


class OtherLayoutViews(RotorcraftViews):
    """Views of a rotorcraft whose singular attitudes are not known; its page leaves them out."""

    def overlay(self, flight: Flight, height: int) -> Overlay:
        from tiltsim.views.video.overlay import AttitudeOverlay

        return AttitudeOverlay(flight, height)

    def display(self) -> VehicleDisplay:
        from tiltsim.views.rerun.rotorcraft_display import OTHER_LAYOUT_DISPLAY

        return OTHER_LAYOUT_DISPLAY


class MultirotorViews(RotorcraftViews):
    """Views of a multirotor, whose singular attitudes need not be a curve."""

    def panels(self) -> Mapping[str, Panel]:
        from tiltsim.views.figures.rotorcraft import MULTIROTOR_PANELS

        return MULTIROTOR_PANELS

    def overlay(self, flight: Flight, height: int) -> Overlay:
        from tiltsim.views.video.overlay import MarginOverlay

        return MarginOverlay(flight, height)

    def display(self) -> VehicleDisplay:
        from tiltsim.views.rerun.rotorcraft_display import MULTIROTOR_DISPLAY

        return MULTIROTOR_DISPLAY


class TiltCarViews(VehicleViews):
    """Views of the tilt-car."""

    def panels(self) -> Mapping[str, Panel]:
        from tiltsim.views.figures.tilt_car import TILT_CAR_PANELS

        return TILT_CAR_PANELS

    def overlay(self, flight: Flight, height: int) -> Overlay:
        from tiltsim.views.video.overlay import TiltCarOverlay

        return TiltCarOverlay(flight, height)

    def display(self) -> VehicleDisplay:
        from tiltsim.views.rerun.tilt_car_display import TILT_CAR_DISPLAY

        return TILT_CAR_DISPLAY


MULTIROTOR: Final = MultirotorViews()

VIEWS: Final[dict[VehicleKind, VehicleViews]] = {
    ROTORCRAFT: RotorcraftViews(),
    OTHER_LAYOUT: OtherLayoutViews(),
    TILT_CAR: TiltCarViews(),
}


def views_of(assembly: Assembly) -> VehicleViews:
    """The views of an assembly's kind of vehicle; each layout of a multirotor is a kind."""
    if assembly.scenario.vehicle.model == "multirotor":
        return MULTIROTOR
    return VIEWS[assembly.loop.kind]
