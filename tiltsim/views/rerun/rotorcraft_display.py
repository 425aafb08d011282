"""What the viewer shows for a rotorcraft."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.laws.layers.supervision import SUPERVISION
from tiltsim.views.attitude_plane import margin_threshold
from tiltsim.views.events import rotorcraft_conditions
from tiltsim.views.rerun.display import (
    REFERENCE_WIDTH,
    Compared,
    Level,
    Panel,
    Series,
    VehicleDisplay,
    distance,
    error,
)
from tiltsim.views.rerun.palette import AMBER, GREEN, GREY, PINK, RED, SKY, dimmed
from tiltsim.views.rerun.plane import AttitudePlane

if TYPE_CHECKING:
    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.flight.flight import Flight
    from tiltsim.views.rerun.palette import Color
    from tiltsim_controllers.mathematics.scalar import Floats

_ROTOR_COLORS: Final = (AMBER, SKY, PINK, GREEN)
# Lines of equal angles and speeds would cover each other: later ones are thinner.
_ROTOR_WIDTHS: Final = (4.0, 3.0, 2.0, 1.2)
_ANGLE_COLORS: Final = {"roll": RED, "pitch": GREEN, "yaw": SKY}
_AXIS_COLORS: Final = {"x": RED, "y": GREEN, "z": SKY}


def _spin_speed(rotor: int) -> Callable[[Flight], Floats]:
    """The speed of a rotor along its spin, rad/s."""
    return lambda flight: (
        flight.scenario.any_rotorcraft.spins[rotor - 1] * flight[f"rotor_speed_{rotor}"]
    )


def _slowest(flight: Flight) -> Floats:
    spins = np.array(flight.scenario.any_rotorcraft.spins)
    return np.asarray((spins * flight["rotor_speeds"]).min(axis=1))


def _distance(flight: Flight) -> Floats:
    return distance(flight, error_axes(flight.assembly))


def _speed_limits(assembly: Assembly) -> tuple[float, float]:
    """From standstill to twice hover: diverging rotors would make all others a flat line."""
    vehicle = assembly.scenario.any_rotorcraft
    return 0.0, max(2.0 * vehicle.resolve().hover_rotor_speed, vehicle.max_rotor_speed or 0.0)


PANELS: Final = (
    Panel(
        "attitude",
        "Attitude (rad)",
        7.5,
        (Compared("roll", "Roll (rad)", "roll"), Compared("pitch", "Pitch (rad)", "pitch")),
    ),
    Panel("tilt_angles", "Tilt angles (rad)", 6.5),
    Panel(
        "rotor_speeds",
        "Rotor speeds along their spins (rad/s)",
        6.0,
        (Compared("slowest", "Slowest rotor and limits (rad/s)", _slowest),),
        ("min", "max"),
        _speed_limits,
    ),
    Panel(
        "singularity",
        "Singularity margin (rad)",
        6.0,
        (Compared("margin", "Singularity margin and threshold (rad)", "singularity_margin"),),
        ("threshold", "singular"),
    ),
    Panel(
        "position_error",
        "Position error, reference minus actual (m)",
        4.5,
        (Compared("distance", "Distance from the reference (m)", _distance),),
    ),
)
"""The plots from top to bottom; their legends fit a window of 1600 by 1000 pixels."""


def panels(assembly: Assembly) -> tuple[Panel, ...]:
    """The plots of a flight, but those of tilt angles and margins that it has not."""
    shown = {
        "tilt_angles": assembly.scenario.vehicle.has_tilting_rotors,
        "singularity": _has_margin(assembly),
    }
    return tuple(panel for panel in PANELS if shown.get(panel.path, True))


def _has_margin(assembly: Assembly) -> bool:
    return "singularity_margin" in assembly.loop.units


def rotorcraft_series(assembly: Assembly) -> list[Series]:
    """The lines of the plots."""
    series = []
    for angle, color in _ANGLE_COLORS.items():
        series.append(Series(f"attitude/{angle}", angle, color, angle))
        series.append(_reference(f"attitude/{angle}_ref", f"{angle} ref", color))
    columns = assembly.loop.kind.columns
    for rotor in assembly.loop.kind.rotors:
        color = _ROTOR_COLORS[(rotor - 1) % len(_ROTOR_COLORS)]
        width = _ROTOR_WIDTHS[min(rotor, len(_ROTOR_WIDTHS)) - 1]
        tilt, speed = f"alpha_{rotor}", _spin_speed(rotor)
        if tilt in columns:
            series.append(Series(f"tilt_angles/{tilt}", f"α{rotor}", color, tilt, width))
            series.append(_reference(f"tilt_angles/alpha_ref_{rotor}", f"α{rotor} ref", color))
        series.append(Series(f"rotor_speeds/rotor_{rotor}", f"rotor {rotor}", color, speed, width))
    if _has_margin(assembly):
        series.append(Series("singularity/margin", "margin", AMBER, "singularity_margin", 2.5))
    if SUPERVISION in assembly.loop.columns.units:
        path, label = f"singularity/{SUPERVISION}", "supervisor, 0 to 1"
        series.append(Series(path, label, SKY, SUPERVISION))
    for axis in error_axes(assembly):
        series.append(Series(f"position_error/{axis}", axis, _AXIS_COLORS[axis], error(axis)))
    return series


def _reference(path: str, label: str, color: Color) -> Series:
    """The column of the entity's name, as the reference of a line of this colour."""
    return Series(path, label, dimmed(color), path.rpartition("/")[2], REFERENCE_WIDTH)


def rotorcraft_levels(assembly: Assembly) -> list[Level]:
    """Rotor speed limits, singularity, and the threshold of the singularity margin."""
    levels = []
    if _has_margin(assembly):
        threshold = margin_threshold(assembly.scenario)
        levels.append(Level("singularity/threshold", f"threshold {threshold:g}", RED, threshold))
        levels.append(Level("singularity/singular", "singular", GREY, 0.0))
    vehicle = assembly.scenario.any_rotorcraft
    for name, label, limit in (
        ("min", "lower limit", vehicle.min_rotor_speed),
        ("max", "upper limit", vehicle.max_rotor_speed),
    ):
        if limit is not None:
            levels.append(Level(f"rotor_speeds/{name}", label, RED if limit else GREY, limit))
    return levels


def error_axes(assembly: Assembly) -> str:
    """The axes along which the controller follows the reference."""
    return "xyz" if assembly.follows_position else "z"


ROTORCRAFT_DISPLAY: Final = VehicleDisplay(
    conditions=rotorcraft_conditions,
    panels=panels,
    series=rotorcraft_series,
    levels=rotorcraft_levels,
    plane=AttitudePlane,
    eye=(-3.3, -3.3, 2.4),
    up=(0.0, 0.0, 1.0),
    overview=False,
)
