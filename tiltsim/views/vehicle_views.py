"""How a flight is shown: chosen by the vehicle and the columns, whatever the control law.

Figures, Rerun and videos are imported when they are needed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tiltsim.scenario.vehicle import VehicleTable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.flight.flight import Flight
    from tiltsim.views.figures.panels import Panel
    from tiltsim.views.rerun.display import VehicleDisplay
    from tiltsim.views.video.overlay import Overlay


def has_attitude_plane(assembly: Assembly) -> bool:
    """Whether its singular attitudes are a curve of the roll-pitch plane: of rotors on a cross."""
    on_a_cross = isinstance(assembly.scenario.vehicle, VehicleTable)
    return on_a_cross and "singularity_margin" in assembly.loop.units


def panels_of(assembly: Assembly) -> Mapping[str, Panel]:
    """The panels of a flight's page, by name."""
    from tiltsim.views.figures.rotorcraft import ROTORCRAFT_PANELS
    from tiltsim.views.figures.tilt_car import TILT_CAR_PANELS

    vehicle = assembly.scenario.vehicle
    if vehicle.is_planar:
        return TILT_CAR_PANELS
    suits = {
        "tilt_angles": vehicle.has_tilting_rotors,
        "attitude_plane": has_attitude_plane(assembly),
    }
    return {name: one for name, one in ROTORCRAFT_PANELS.items() if suits.get(name, True)}


def overlay_of(flight: Flight, height: int) -> Overlay:
    """Camera and captions of a video of a flight, with frames of a height (pixels)."""
    from tiltsim.views.video.overlay import AttitudeOverlay, PlaneOverlay, TiltCarOverlay

    if flight.scenario.vehicle.is_planar:
        return TiltCarOverlay(flight)
    if has_attitude_plane(flight.assembly):
        return PlaneOverlay(flight, height)
    return AttitudeOverlay(flight)


def display_of(assembly: Assembly) -> VehicleDisplay:
    """Panels and camera in Rerun."""
    from tiltsim.views.rerun.rotorcraft_display import ROTORCRAFT_DISPLAY
    from tiltsim.views.rerun.tilt_car_display import TILT_CAR_DISPLAY

    if assembly.scenario.vehicle.is_planar:
        return TILT_CAR_DISPLAY
    if has_attitude_plane(assembly):
        return ROTORCRAFT_DISPLAY
    return replace(ROTORCRAFT_DISPLAY, plane=None)
