"""The figure of a rotorcraft's flight: time series, plan view, roll-pitch plane (ch. 4)."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.laws.layers.supervision import SUPERVISION
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
from tiltsim.views.figures.flight_layout import (
    SIZE,
    add_headings,
    exclude_divergence_from_scale,
    label,
    plan_view,
    widen,
)
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle
from tiltsim_controllers.vehicle.states import ROTORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight

UNREACHABLE: Final = "#F6DDD0"
INSTANTS: Final = 120
"""Number of instants whose unreachable attitudes the roll-pitch plane shows."""

MAX_PERIODS: Final = 20
"""Periods of a gait above which its tilt angles would be a solid band."""

SHOWN_PERIODS: Final = 6
"""Number of periods that are shown instead, the last ones."""

_SUBSCRIPTS: Final = "₁₂₃₄"


def rotorcraft_figure(flight: Flight) -> Figure:
    """Time series, plan view, and the attitudes with their distance to singular ones."""
    with style.paper_style():
        figure = style.new_figure(*SIZE)
        add_headings(figure, flight)
        halves: Any = figure.subfigures(1, 2, width_ratios=[2.1, 1.0])
        left, right = halves
        panels = [_attitude, _tilt_angles, _altitude, _rotor_speeds, _position_error]
        has_margin = "singularity_margin" in flight.units
        panels += [_margin] if has_margin else []
        series: Any = left.subplots(3, 2)
        lowest = series[-1]
        if not has_margin:
            lowest = [series[-1, 0], series[-2, 1]]
            series[-1, -1].remove()
        for axes, panel in zip(series.flat, panels):
            style.time_axis(axes, flight["time"][-1])
            axes.tick_params(labelbottom=axes in lowest)
            panel(axes, flight)
            if panel is not _margin:
                exclude_divergence_from_scale(axes, flight)
        for axes in lowest:
            axes.set_xlabel("time (s)")
        above, below = right.subplots(2, 1)
        plan_view(above, flight)
        if has_margin:
            _roll_pitch_plane(below, flight)
        else:
            below.remove()
        return figure


def _attitude(axes: Axes, flight: Flight) -> None:
    for angle, line in zip(("roll", "pitch", "yaw"), style.AXIS_LINES):
        axes.plot(flight["time"], flight[angle], label=angle, **line)
        axes.plot(flight["time"], flight[f"{angle}_ref"], color=style.INK, ls=":", lw=0.8)
    axes.plot([], [], color=style.INK, ls=":", lw=0.8, label="reference")
    label(axes, "Attitude", "rad", columns=4)


def _altitude(axes: Axes, flight: Flight) -> None:
    axes.plot(flight["time"], flight["z"], color=style.BLUE, label="actual")
    axes.plot(flight["time"], flight["z_ref"], color=style.INK, ls=":", lw=1.0, label="reference")
    widen(axes, 0.1)
    label(axes, "Altitude", "m")


def _position_error(axes: Axes, flight: Flight) -> None:
    follows = flight.assembly.follows_position
    style.zero_lines(axes, "x")
    for axis, line in zip("xyz", style.AXIS_LINES):
        if follows or axis == "z":
            error = flight[f"{axis}_ref"] - flight[axis]
            axes.plot(flight["time"], error, label=axis, **line)
    widen(axes, 0.1)
    label(axes, "Position error", "m")


def _tilt_angles(axes: Axes, flight: Flight) -> None:
    end, begin = flight["time"][-1], _start_of_tilt_angles(flight)
    for rotor, line in zip(ROTORS, style.ROTOR_LINES, strict=True):
        name = f"α{_SUBSCRIPTS[rotor - 1]}"
        axes.plot(flight["time"], flight[f"alpha_{rotor}"], label=name, **line)
    widen(axes, 0.1)
    title = "Tilt angles"
    if begin > 0.0:
        axes.set_xlim(begin, end)
        axes.tick_params(labelbottom=True)
        title += f", last {end - begin:g} s"
    label(axes, title, "rad", columns=4)


def _start_of_tilt_angles(flight: Flight) -> float:
    """The time (s) from which tilt angles are shown."""
    vehicle, end = flight.scenario.vehicle.resolve(), float(flight["time"][-1])
    if not isinstance(vehicle, Vehicle) or SUPERVISION in flight.columns:
        return 0.0
    period = flight.assembly.gait.period
    return 0.0 if period is None or end <= MAX_PERIODS * period else end - SHOWN_PERIODS * period


def _rotor_speeds(axes: Axes, flight: Flight) -> None:
    for rotor, spin, line in zip(ROTORS, SPIN, style.ROTOR_LINES, strict=True):
        speed = spin * flight[f"rotor_speed_{rotor}"]
        axes.plot(flight["time"], speed, label=f"{rotor}", **line)
    vehicle = flight.scenario.rotorcraft
    for limit in (vehicle.min_rotor_speed, vehicle.max_rotor_speed):
        if limit is not None:
            axes.axhline(limit, color=style.RED, ls="--", lw=0.9)
    widen(axes, 20.0)
    label(axes, "Rotor speeds", "rad/s", name="along the spin", columns=4)


def _margin(axes: Axes, flight: Flight) -> None:
    time, margin = flight["time"], np.abs(flight["singularity_margin"])
    closest = int(np.argmin(margin))
    threshold = margin_threshold(flight.scenario)
    axes.fill_between(time, 0.0, threshold, color=UNREACHABLE, lw=0.0)
    text = f"below {threshold:g} rad"
    axes.text(0.012, 0.03, text, transform=axes.transAxes, fontsize=7.5, color="#7A4A33")
    if SUPERVISION in flight.columns:
        axes.axhline(threshold, color=style.RED, ls="--", lw=0.9)
        axes.fill_between(
            time,
            0.0,
            1.0,
            where=flight[SUPERVISION] > SUPERVISION_THRESHOLD,
            transform=axes.get_xaxis_transform(),
            color=style.PALE,
            lw=0.0,
            zorder=0.5,
        )
        text = "shaded: supervisor active"
        axes.text(0.99, 0.03, text, transform=axes.transAxes, ha="right", fontsize=8)
    axes.plot(time, margin, color=style.BLUE)
    axes.plot(time[closest], margin[closest], "o", color=style.RED, ms=5, clip_on=False, zorder=5)
    style.angle_axis(axes, "y", pi / 2)
    axes.set_ylim(0.0, pi / 2 * 1.04)
    label(axes, f"Singularity margin, minimum {margin[closest]:.2f} rad", "rad")


def _roll_pitch_plane(axes: Axes, flight: Flight) -> None:
    """The attitudes flown, unreachable ones, and the closest approach to a singular one."""
    n = torque_free_directions(flight.columns, flight.scenario.rotorcraft.resolve())
    margin = flight["singularity_margin"]
    closest = int(np.argmin(np.abs(margin)))
    side = float(np.sign(margin[0])) or 1.0
    shaded = _shade_unreachable(axes, n, side)
    attitude = np.stack([flight["roll"], flight["pitch"]], axis=1)
    axes.plot(*attitude.T, color=style.BLUE, lw=0.9)
    curve = singular_curves(n[[closest]], 181)[0]
    here = attitude[closest]
    if np.isfinite(curve).any():
        axes.plot(*curve.T, color=style.RED, lw=1.8)
        there = nearest_singular(n[[closest]], attitude[[closest]])[0]
        axes.plot(*np.stack([here, there]).T, color=style.INK, lw=1.0, ls="--")
    axes.plot(*here, "o", color=style.RED, ms=5, zorder=5)
    axes.text(
        0.97,
        0.03,
        f"minimum margin {abs(margin[closest]):.2f} rad at {flight['time'][closest]:.2f} s",
        transform=axes.transAxes,
        ha="right",
        fontsize=8,
        bbox={"facecolor": "white", "edgecolor": style.GREY, "linewidth": 0.5, "pad": 2.5},
    )
    style.roll_pitch_axes(axes)
    axes.set_title(f"Attitudes flown; {'shaded: unreachable' if shaded else 'all reachable'}")


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
    from matplotlib.colors import LinearSegmentedColormap

    shades = LinearSegmentedColormap.from_list("unreachable", ["#FFFFFF", UNREACHABLE, "#E9B49A"])
    axes.pcolormesh(edges, edges, share, cmap=shades, vmin=0.0, vmax=1.0, rasterized=True)
    return bool(share.any())
