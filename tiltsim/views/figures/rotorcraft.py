"""The panels of a rotorcraft's flight: time series, plan view, roll-pitch plane (ch. 4)."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.laws.layers.supervision import SUPERVISION
from tiltsim.system.quantity import subscript
from tiltsim.views.attitude_plane import (
    HALF_WIDTH,
    SUPERVISION_THRESHOLD,
    margin_threshold,
    nearest_singular,
    singular_curves,
    torque_free_directions,
    unreachable_pitch,
)
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import legend_over
from tiltsim.views.figures.panels import (
    SMALLEST_ANGLES,
    Panel,
    line_width,
    of_one,
    plan_view,
    shade_below,
    show_last_periods,
    widen,
)
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tiltsim.flight.flight import Flight

INSTANTS: Final = 120
"""Number of instants whose unreachable attitudes the roll-pitch plane shows."""


def _attitude(axes: Axes, flight: Flight) -> None:
    for angle, line in zip(("roll", "pitch", "yaw"), style.AXIS_LINES):
        axes.plot(flight["time"], flight[angle], label=angle, **line)
        axes.plot(flight["time"], flight[f"{angle}_ref"], color=style.INK, ls=":", lw=0.8)
    axes.plot([], [], color=style.INK, ls=":", lw=0.8, label="reference")
    show_last_periods(axes, [flight])
    widen(axes, SMALLEST_ANGLES)
    axes.set_ylabel("rad")
    legend_over(axes, "Attitude")


def _altitude(axes: Axes, flight: Flight) -> None:
    axes.plot(flight["time"], flight["z"], color=style.BLUE, label="actual")
    axes.plot(flight["time"], flight["z_ref"], color=style.INK, ls=":", lw=1.0, label="reference")
    widen(axes, 0.1)
    axes.set_ylabel("m")
    legend_over(axes, "Altitude")


def _position_error(axes: Axes, flight: Flight) -> None:
    follows = flight.assembly.follows_position
    style.zero_lines(axes, "x")
    for axis, line in zip("xyz", style.AXIS_LINES):
        if follows or axis == "z":
            error = flight[f"{axis}_ref"] - flight[axis]
            axes.plot(flight["time"], error, label=axis, **line)
    widen(axes, 0.1)
    axes.set_ylabel("m")
    legend_over(axes, "Position error")


def _tilt_angles(axes: Axes, flight: Flight) -> None:
    tilts = flight["tilt_angles"].T
    lines = style.rotor_lines(len(tilts))
    for i, (tilt, line) in enumerate(zip(tilts, lines, strict=True), start=1):
        axes.plot(flight["time"], tilt, label=f"α{subscript(i)}", **line)
    show_last_periods(axes, [flight])
    widen(axes, 0.1)
    axes.set_ylabel("rad")
    legend_over(axes, "Tilt angles")


def _rotor_speeds(axes: Axes, flight: Flight) -> None:
    vehicle = flight.scenario.any_rotorcraft
    lines = style.rotor_lines(vehicle.rotor_count)
    for rotor, (spin, line) in enumerate(zip(vehicle.spins, lines, strict=True), start=1):
        speed = spin * flight[f"rotor_speed_{rotor}"]
        axes.plot(flight["time"], speed, label=f"{rotor}", **line)
    for limit in (vehicle.min_rotor_speed, vehicle.max_rotor_speed):
        if limit is not None:
            known = axes.get_legend_handles_labels()[1]
            text = "" if "limit" in known else "limit"
            axes.axhline(limit, color=style.RED, ls="--", lw=0.9, label=text)
    show_last_periods(axes, [flight])
    widen(axes, 20.0)
    axes.set_ylabel("along the spin (rad/s)")
    legend_over(axes, "Rotor speeds", 5)


def _margin(axes: Axes, flight: Flight) -> None:
    time, margin = flight["time"], np.abs(flight["singularity_margin"])
    closest = int(np.argmin(margin))
    threshold = margin_threshold(flight.scenario)
    shade_below(axes, threshold, f"below {threshold:g}")
    if SUPERVISION in flight.columns:
        active = flight[SUPERVISION] > SUPERVISION_THRESHOLD
        look: dict[str, Any] = {"color": style.PALE, "lw": 0.0, "zorder": 0.5}
        edge = axes.get_xaxis_transform()
        text = "supervisor active"
        axes.fill_between(time, 0.0, 1.0, where=active, transform=edge, **look, label=text)
    axes.plot(time, margin, color=style.BLUE, lw=line_width([flight]))
    text = f"minimum, {margin[closest]:.2f}"
    dot: dict[str, Any] = {"color": style.SINGULAR, "ms": 5, "clip_on": False, "zorder": 5}
    axes.plot(time[closest], margin[closest], "o", **dot, label=text)
    style.angle_axis(axes, "y", pi / 2)
    axes.set_ylim(0.0, pi / 2 * 1.04)
    axes.set_ylabel("rad")
    legend_over(axes, "Singularity margin")


def _roll_pitch_plane(axes: Axes, flight: Flight) -> None:
    """The attitudes flown, unreachable ones, and the closest approach to a singular one."""
    n = torque_free_directions(flight.columns, flight.scenario.rotorcraft.resolve())
    margin = flight["singularity_margin"]
    closest = int(np.argmin(np.abs(margin)))
    side = float(np.sign(margin[0])) or 1.0
    shaded = _shade_unreachable(axes, n, side)
    attitude = np.stack([flight["roll"], flight["pitch"]], axis=1)
    axes.plot(*attitude.T, color=style.BLUE, lw=0.9, label="flown")
    curve = singular_curves(n[[closest]], 181)[0]
    here = attitude[closest]
    if np.isfinite(curve).any():
        axes.plot(*curve.T, color=style.SINGULAR, lw=1.8, label="singular")
        there = nearest_singular(n[[closest]], attitude[[closest]])[0]
        text = f"minimum margin, at {flight['time'][closest]:.2f} s"
        line = np.stack([here, there]).T
        axes.plot(*line, color=style.INK, lw=1.0, ls="--", label=text)
    axes.plot(*here, "o", color=style.SINGULAR, ms=5, zorder=5)
    if shaded:
        axes.fill([], [], color=style.UNREACHABLE, label="unreachable")
    style.roll_pitch_axes(axes)
    axes.set_title("Attitudes flown")
    style.legend_below(axes)


def _shade_unreachable(axes: Axes, n: Floats, side: float) -> bool:
    """Shade unreachable attitudes, darker where they are so for longer; False if there are none."""
    instants = np.unique(np.linspace(0, len(n) - 1, INSTANTS).round().astype(int))
    edges = np.linspace(-HALF_WIDTH, HALF_WIDTH, 361)
    centres = 0.5 * (edges[1:] + edges[:-1])
    intervals = unreachable_pitch(n[instants], side, centres)[:, np.newaxis]
    pitch = centres[:, np.newaxis]
    inside = (pitch > intervals[..., 0]) & (pitch < intervals[..., 1])
    share = inside.mean(axis=0)
    axes.grid(False)
    style.shade_share(axes, edges, share)
    return bool(share.any())


ROTORCRAFT_PANELS: Final[dict[str, Panel]] = {
    "position_error": of_one(_position_error),
    "altitude": of_one(_altitude),
    "margin": of_one(_margin, scaled=True, needs="singularity_margin"),
    "attitude": of_one(_attitude),
    "tilt_angles": of_one(_tilt_angles),
    "rotor_speeds": of_one(_rotor_speeds),
    "path": of_one(plan_view, over_time=False),
    "attitude_plane": of_one(_roll_pitch_plane, over_time=False),
}
"""The panels of a rotorcraft's page, by name."""
