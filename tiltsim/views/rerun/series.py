"""Time series: what a flight is plotted by, with names, units and colours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.laws.assembling import follows_position, loop_of
from tiltsim.laws.layers.supervision import SUPERVISION
from tiltsim.views.attitude_plane import margin_threshold
from tiltsim.views.rerun import palette
from tiltsim.views.rerun.rows import send_rows
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import SPIN

if TYPE_CHECKING:
    import rerun as rr

    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.views.rerun.palette import Color

MEASURED_WIDTH: Final = 1.8
REFERENCE_WIDTH: Final = 1.0
LIMIT_WIDTH: Final = 1.2


@dataclass(frozen=True)
class Series:
    """A line of a plot: its entity (panel and name), its label, colour and width."""

    path: str
    label: str
    color: Color
    width: float = MEASURED_WIDTH


@dataclass(frozen=True)
class Panel:
    """A plot: its entity, its title with the unit, and what stands for it in a comparison."""

    path: str
    title: str
    height: float  # share of the column
    compared: tuple[tuple[str, str], ...]  # series, and the title of their plot
    levels: tuple[str, ...] = ()  # level lines, which a comparison shows too


PANELS: Final = (
    Panel("attitude", "Attitude (rad)", 7.5, (("roll", "Roll (rad)"), ("pitch", "Pitch (rad)"))),
    Panel("tilt_angles", "Tilt angles (rad)", 6.5, ()),
    Panel(
        "rotor_speeds",
        "Rotor speeds along their spins (rad/s)",
        6.0,
        (("slowest", "Slowest rotor and limits (rad/s)"),),
        ("min", "max"),
    ),
    Panel(
        "singularity",
        "Singularity margin (rad)",
        6.0,
        (("margin", "Singularity margin and threshold (rad)"),),
        ("threshold", "singular"),
    ),
    Panel(
        "position_error",
        "Position error, reference minus actual (m)",
        4.5,
        (("distance", "Distance from the reference (m)"),),
    ),
)
"""The plots of a flight, from top to bottom; legends fit a window of 1600 by 1000 pixels."""

_ROTORS: Final = (1, 2, 3, 4)
_ROTOR_COLORS: Final = (palette.AMBER, palette.SKY, palette.PINK, palette.GREEN)
# Equal angles and speeds would hide each other: later lines are thinner.
_ROTOR_WIDTHS: Final = (4.0, 3.0, 2.0, 1.2)
_ANGLE_COLORS: Final = {"roll": palette.RED, "pitch": palette.GREEN, "yaw": palette.SKY}
_AXIS_COLORS: Final = {"x": palette.RED, "y": palette.GREEN, "z": palette.SKY}


def panels(scenario: Scenario) -> tuple[Panel, ...]:
    """The plots of a scenario's flights; a quadrotor has no tilt angles to plot."""
    tilts = scenario.vehicle.model != "quadrotor"
    return tuple(panel for panel in PANELS if tilts or panel.path != "tilt_angles")


def measured_series(scenario: Scenario) -> list[Series]:
    """The series of every sample that a flight of this scenario has."""
    series = []
    for angle, color in _ANGLE_COLORS.items():
        series.append(Series(f"attitude/{angle}", angle, color))
        reference = palette.dimmed(color)
        label = f"{angle} ref"
        series.append(Series(f"attitude/{angle}_ref", label, reference, REFERENCE_WIDTH))
    for rotor, color, width in zip(_ROTORS, _ROTOR_COLORS, _ROTOR_WIDTHS, strict=True):
        series.append(Series(f"tilt_angles/alpha_{rotor}", f"α{rotor}", color, width))
        reference = palette.dimmed(color)
        path, label = f"tilt_angles/alpha_ref_{rotor}", f"α{rotor} ref"
        series.append(Series(path, label, reference, REFERENCE_WIDTH))
        series.append(Series(f"rotor_speeds/rotor_{rotor}", f"rotor {rotor}", color, width))
    series.append(Series("singularity/margin", "margin", palette.AMBER, 2.5))
    if SUPERVISION in loop_of(scenario).extra_columns:
        label = "supervisor, 0 to 1"
        series.append(Series(f"singularity/{SUPERVISION}", label, palette.SKY, MEASURED_WIDTH))
    for axis in error_axes(scenario):
        series.append(Series(f"position_error/{axis}", axis, _AXIS_COLORS[axis]))
    return series


def limit_series(scenario: Scenario) -> list[tuple[Series, float]]:
    """Level lines, with their values: rotor speed limits, singularity and its threshold."""
    threshold = margin_threshold(scenario)
    lines = [
        ("singularity/threshold", f"threshold {threshold:g}", threshold),
        ("singularity/singular", "singular", 0.0),
    ]
    vehicle = scenario.rotorcraft
    if vehicle.min_rotor_speed is not None:
        lines.append(("rotor_speeds/min", "lower limit", vehicle.min_rotor_speed))
    if vehicle.max_rotor_speed is not None:
        lines.append(("rotor_speeds/max", "upper limit", vehicle.max_rotor_speed))
    return [
        (Series(path, label, palette.RED if value else palette.GREY, LIMIT_WIDTH), value)
        for path, label, value in lines
    ]


def error_axes(scenario: Scenario) -> str:
    """The axes along which the scenario controls the position."""
    return "xyz" if follows_position(scenario) else "z"


def series_values(flight: Flight) -> dict[str, Floats]:
    """Every series of a flight by entity, those for comparison included."""
    columns, values = flight.columns, {}
    for angle in _ANGLE_COLORS:
        values[f"attitude/{angle}"] = columns[angle]
        values[f"attitude/{angle}_ref"] = columns[f"{angle}_ref"]
    for rotor, spin in zip(_ROTORS, SPIN, strict=True):
        for name in (f"alpha_{rotor}", f"alpha_ref_{rotor}"):
            values[f"tilt_angles/{name}"] = columns[name]
        values[f"rotor_speeds/rotor_{rotor}"] = spin * columns[f"rotor_speed_{rotor}"]
    values["singularity/margin"] = columns["singularity_margin"]
    if SUPERVISION in columns:
        values[f"singularity/{SUPERVISION}"] = columns[SUPERVISION]
    axes = error_axes(flight.scenario)
    errors = [columns[f"{axis}_ref"] - columns[axis] for axis in axes]
    values |= {f"position_error/{axis}": error for axis, error in zip(axes, errors, strict=True)}
    values["position_error/distance"] = np.linalg.norm(errors, axis=0)
    speeds = [values[f"rotor_speeds/rotor_{rotor}"] for rotor in _ROTORS]
    values["rotor_speeds/slowest"] = np.min(speeds, axis=0)
    return values


class TimeSeries:
    """The plotted entities of one flight."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        series: list[Series],
        values: Callable[[Flight], dict[str, Floats]],
        prefix: str,
    ) -> None:
        self._recording = recording
        self._series = series
        self._values = values
        self._prefix = prefix

    def begin(self) -> None:
        """Log names, colours and widths of the lines."""
        for series in self._series:
            self._log_style(series)

    def draw_limits(self, limits: list[tuple[Series, float]], until: float) -> None:
        """Draw level lines, given with their values, from the start to a time (s)."""
        import rerun as rr

        for series, value in limits:
            self._log_style(series)
            row = rr.Scalars.columns(scalars=[value, value])
            send_rows(self._recording, self._prefix + series.path, np.array([0.0, until]), row)

    def append(self, piece: Flight) -> None:
        """Log the rows of a piece of the flight."""
        import rerun as rr

        values = self._values(piece)
        for series in self._series:
            row = rr.Scalars.columns(scalars=values[series.path])
            send_rows(self._recording, self._prefix + series.path, piece["time"], row)

    def _log_style(self, series: Series) -> None:
        import rerun as rr

        style = rr.SeriesLines(names=[series.label], colors=[series.color], widths=[series.width])
        self._recording.log(self._prefix + series.path, style, static=True)
