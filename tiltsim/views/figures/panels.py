"""The panels of a page of flights: signals over time, paths from above, planes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, log10, pi
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from tiltsim.flight.flight import VECTORS, Flight
from tiltsim.laws.law import SUPERVISION
from tiltsim.system.text import Quantity
from tiltsim.views import attitude_plane
from tiltsim.views.figures import flight_lines, style
from tiltsim.views.figures.flight_lines import Shown
from tiltsim.views.signals import (
    AXES,
    FLOORS,
    Signals,
    error,
    has_attitude_plane,
    reference_of,
    scale,
    signals_of,
    vector_signals,
)
from tiltsim_controllers.code.arrays import traceable
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.mathematics.scalar import Floats

SHOWN_PERIODS: Final = 4  # the last ones, shown instead
NARROW: Final = 8.0  # ratio of a path's extents above which its axes have different scales
INSTANTS: Final = 120  # whose unreachable attitudes the roll-pitch plane shows
SETTLED: Final = 0.01  # share of the largest error below which errors have settled
SHORT: Final = 0.1  # share of a flight below which only the time until then is shown
LEVEL: Final = 1e-6  # rad, range of a constant margin
ROUNDING: Final = 1e-9  # m, below which errors are rounding
ORDER: Final = ("position_error", "altitude", "margin", "attitude", "tilt_angles")
"""The first panels of a page."""

ESTIMATED: Final = ("position", "velocity", "attitude")  # vectors whose errors have panels


@dataclass(frozen=True)
class Panel:
    """A part of a figure of flights."""

    draw: Callable[[Axes, Sequence[Shown]], None]
    """``(axes, shown)``: draws the flights, one or several, and labels the axes."""
    over_time: bool = True  # whether its x axis is the time; else it is a square
    signals: Signals | None = None
    """Signals over time, which set the limits of both axes; without them, `draw` does."""
    needs: str = "time"  # a column that the flights must have
    on_request: bool = False  # whether it is only drawn on request


def panels_of(flights: Sequence[Flight]) -> dict[str, Panel]:
    """The panels of a page by their names, in their order."""
    units = {column for flight in flights for column in flight.units}
    several, assembly = len(flights) > 1, flights[0].assembly
    margin = Panel(_margins, needs="singularity_margin")
    determinant = Panel(_determinant, needs="determinant")
    determinant = replace(determinant, on_request=not (several and SUPERVISION in units))
    supervisor = Panel(_supervisor, needs=SUPERVISION, on_request=not several)
    common = {"determinant": determinant, "supervisor": supervisor}
    path = {"path": Panel(_path, over_time=False)}
    if several:
        away = Panel(_distance, signals=Signals("position_error", "", "m", ()))
        found = {"position_error": away, "margin": margin, **common}
        found |= {name: column_panel(flights, name) for name in ("roll", "pitch", "yaw")} | path
        return {name: panel for name, panel in found.items() if panel.needs in units}
    signals = signals_of(assembly)
    found = {
        name: signals_panel(signals[name])
        for name in dict.fromkeys([*ORDER, *signals])
        if name in signals
    }
    if "lyapunov" in found:  # which says the same
        found["direction_error"] = replace(found["direction_error"], on_request=True)
    found |= ({"margin": margin} if "margin" in found else {}) | common | path
    if has_attitude_plane(assembly):
        found["attitude_plane"] = Panel(_attitude_plane, over_time=False)
    for name in ESTIMATED:
        draw = partial(_tube, vector=name)
        found[f"estimate_{name}_error"] = Panel(draw, needs="nees", on_request=True)
    if "direction" in units:
        found["portrait"] = Panel(_portrait, over_time=False)
    return {name: panel for name, panel in found.items() if panel.needs in units}


def column_panel(flights: Sequence[Flight], name: str) -> Panel:
    """A column over time with, if the flights have it, its reference."""
    one = next((flight for flight in flights if name in flight.units), None)
    about = None if one is None else vector_signals(one.assembly, name, [name])

    def draw(axes: Axes, shown: Sequence[Shown]) -> None:
        if len(shown) > flight_lines.MOST_LINES:
            flight_lines.plot_flights(axes, shown, [one.flight[name] for one in shown])
        else:
            for one in shown:
                time, values = one.flight["time"], one.flight[name]
                axes.plot(time, values, **one.look, lw=1.2)
                if reference := reference_of(one.flight.assembly, name):
                    color = one.look["color"] if "marker" in one.look else style.INK
                    axes.plot(time, one.flight[reference], color=color, ls=":", lw=0.8)
                flight_lines.mark_end(axes, one, values)
        axes.set_ylabel(shown[0].flight.assembly.loop.label(name).text)

    return Panel(draw, signals=about, needs=name)


def signals_panel(signals: Signals) -> Panel:
    """Signals of one flight with their references, levels and bounds."""
    draw = partial(_signals, signals=signals)
    return Panel(draw, signals=signals, on_request=signals.on_request)


def _signals(axes: Axes, shown: Sequence[Shown], signals: Signals) -> None:
    flight = shown[0].flight
    time, lines = flight["time"], signals.lines
    numbered = len(lines) > 3 or lines[0].name[-1:].isdigit()
    looks: Sequence[Any] = style.rotor_lines(len(lines)) if numbered else style.AXIS_LINES
    if len(shown) > 1:
        looks = [one.look for one in shown] if signals.of_vehicles else style.WORLD_LINES
    if signals.path == "position_error":
        style.zero_lines(axes, "x")
    said = f"{signals.title.lower()} " if len(shown) == 1 else ""  # above the panel
    for line, look in zip(lines, looks, strict=False):
        label = "" if "marker" in look else line.label.removeprefix(said)
        axes.plot(time, line.of(flight), label=label, **look)
    # References of tilt angles would cover the angles that follow them.
    references = [line.reference for line in lines if line.reference in flight.units]
    for number, name in enumerate([] if numbered else references):
        look = {"color": style.INK, "ls": ":", "lw": 0.8}
        axes.plot(time, flight[name], label="" if number else "reference", **look)
    for number, level in enumerate(level for level in signals.levels if level.value or numbered):
        axes.axhline(level.value, color=style.RED, ls="--", lw=0.9, label="" if number else "limit")
    bounds = [flight[name] for name in signals.bounds]
    for values, far, label in zip(bounds, (-2.0, 2.0), ("inadmissible", ""), strict=False):
        axes.plot(time, values, color=style.UNREACHABLE, lw=0.8)
        beyond = far * (1.0 + np.abs(bounds).max())
        shade: dict[str, Any] = {"color": style.UNREACHABLE, "lw": 0.0, "zorder": 0.5}
        axes.fill_between(time, values, beyond, **shade, label=label)
    label = Quantity(signals.detail, signals.unit).text
    axes.set_ylabel(label if signals.detail else label.strip(" ()"))
    axes.set_title(signals.title)
    if signals.path == "position_error" and "direction" in flight.units:
        _zoom_to_start(axes, flight)


def _zoom_to_start(axes: Axes, flight: Flight) -> None:
    """Show only the start of errors that settle soon, and say how small they are later."""
    time, names = flight["time"], [axis for axis in AXES if f"{axis}_ref" in flight.units]
    size = np.max(np.abs([error(flight, axis) for axis in names]), axis=0)
    settled = time[np.flatnonzero(size > SETTLED * size.max())[-1]] if size.any() else time[-1]
    if 2.0 * settled < SHORT * time[-1]:
        axes.set_xlim(0.0, 2.0 * settled)
        axes.set_xlabel(f"time (s), the first {2.0 * settled:.0f} s")
        later = max(float(size[time > 2.0 * settled].max()), ROUNDING)
        axes.set_title(f"Position error, later below $10^{{{ceil(log10(later))}}}$ m")


def _distance(axes: Axes, shown: Sequence[Shown]) -> None:
    """The distance of every flight from its reference."""
    panels = (signals_of(one.flight.assembly)["position_error"] for one in shown)
    away = [panel.compared[0].of(one.flight) for panel, one in zip(panels, shown, strict=True)]
    flight_lines.plot_flights(axes, shown, away)
    axes.set_ylabel("position error (m)")


def _margins(axes: Axes, shown: Sequence[Shown]) -> None:
    """The singularity margin of every flight, and how much of it counts as nearly singular."""
    threshold = max(attitude_plane.margin_threshold(one.flight.scenario) for one in shown)
    single = "marker" not in shown[0].look
    text = f"below {threshold:g}" if single else f"margin below {threshold:g} rad"
    axes.axhspan(0.0, threshold, color=style.UNREACHABLE, lw=0.0, label=text)
    margins = [one.flight["singularity_margin"] for one in shown]
    sided = [np.abs(margin) if single else np.maximum(margin, 0.0) for margin in margins]
    flight_lines.plot_flights(axes, shown, sided)
    if single:
        flight, margin = shown[0].flight, margins[0]
        if SUPERVISION in flight.columns:
            active = flight[SUPERVISION] > attitude_plane.SUPERVISION_THRESHOLD
            look: dict[str, Any] = {"color": style.PALE, "lw": 0.0, "zorder": 0.5}
            look |= {"transform": axes.get_xaxis_transform(), "label": "supervisor active"}
            axes.fill_between(flight["time"], 0.0, 1.0, where=active, **look)
        closest = int(np.argmin(np.abs(margin)))
        least = abs(margin[closest])
        dot: dict[str, Any] = {"color": style.SINGULAR, "ms": 5, "zorder": 5, "clip_on": False}
        if np.ptp(margin) > LEVEL:  # else it is nowhere closest
            text = f"minimum, {least:.2f}"
            axes.plot(flight["time"][closest], least, "o", **dot, label=text)
        axes.set_title("Singularity margin")
    style.angle_axis(axes, "y", pi / 2)
    axes.set_ylim(0.0, pi / 2 * 1.03)
    axes.set_ylabel("rad" if single else "singularity margin (rad)")


def _determinant(axes: Axes, shown: Sequence[Shown]) -> None:
    """The determinant, 4 for a level untilted vehicle, and the threshold of the supervisor."""
    thresholds = [one.flight.scenario.controller.supervision for one in shown]
    lowest = max((t.min_determinant for t in thresholds if t is not None), default=0.0)
    if lowest > 0.0:
        text = f"determinant below {lowest:g}"
        axes.axhspan(0.0, lowest, color=style.UNREACHABLE, lw=0.0, label=text)
    values = [np.maximum(one.flight["determinant"], 0.0) for one in shown]
    flight_lines.plot_flights(axes, shown, values)
    axes.set_ylim(0.0, max(4.0, *(1.05 * float(each.max()) for each in values)))
    axes.set_ylabel("determinant n · r₃")


def _supervisor(axes: Axes, shown: Sequence[Shown]) -> None:
    """The intervention of each supervisor."""
    flight_lines.plot_flights(axes, shown, [one.flight[SUPERVISION] for one in shown])
    axes.set(ylim=(-0.03, 1.03), ylabel="supervisor (0 to 1)")


def _path(axes: Axes, shown: Sequence[Shown]) -> None:
    """The paths from above."""
    known: list[Floats] = []
    single = "marker" not in shown[0].look
    for one in shown:
        flight, color = one.flight, one.look["color"]
        if flight.assembly.follows_position:
            reference = np.stack([flight["x_ref"], flight["y_ref"]])
            if not any(np.array_equal(reference, other) for other in known):
                label = "" if known else "reference"
                look: dict[str, Any] = {"color": style.INK, "label": label}
                if np.ptp(reference, axis=1).sum() > 0.0:
                    axes.plot(*reference, ls=":", lw=1.1, zorder=1.5, **look)
                else:
                    axes.plot(*reference[:, 0], "+", ms=7, mew=1.4, **look)
                known.append(reference)
        x, y = flight["x"], flight["y"]
        axes.plot(x, y, **one.look, label="path" if single else "")
        label = "start" if one is shown[0] else ""
        axes.plot(x[0], y[0], "o", color=style.INK, mfc="white", ms=5, label=label, zorder=3)
        if flight.end.kind != "completed":
            text = "terminated early" if single else ""
            axes.plot(x[-1], y[-1], "X", color=color, ms=7, zorder=6, label=text)
        else:
            axes.plot(x[-1], y[-1], "s", color=style.INK if single else color, ms=4.5, zorder=4)
            axes.plot([], [], "s", color=style.INK, ms=4.5, label=label and "end")
    axes.margins(0.08)
    axes.set(xlabel="x (m)", ylabel="y (m)", title="Plan view")
    data = axes.dataLim
    short, long = sorted((data.width, data.height))
    if short > FLOORS["m"] and short * NARROW < long:
        axes.set_title("Plan view, x and y to different scales")
    else:
        axes.set_aspect("equal", adjustable="datalim")
        if long < FLOORS["m"]:
            wider = ((data.x0 - FLOORS["m"], data.y0), (data.x1 + FLOORS["m"], data.y1))
            axes.update_datalim(wider)
            axes.autoscale_view()


def _attitude_plane(axes: Axes, shown: Sequence[Shown]) -> None:
    """The attitudes flown, unreachable ones, and the closest approach to a singular one."""
    flight = shown[0].flight
    n = attitude_plane.torque_free_directions(flight.columns, flight.scenario.rotorcraft.resolve())
    margin = flight["singularity_margin"]
    closest = int(np.argmin(np.abs(margin)))
    instants = np.unique(np.linspace(0, len(n) - 1, INSTANTS).round().astype(int))
    edges = np.linspace(-attitude_plane.HALF_WIDTH, attitude_plane.HALF_WIDTH, 361)
    centres = 0.5 * (edges[1:] + edges[:-1])
    intervals = attitude_plane.unreachable_pitch(
        n[instants], attitude_plane.side_of(margin), centres
    )[:, np.newaxis]
    pitch = centres[:, np.newaxis]
    share = ((pitch > intervals[..., 0]) & (pitch < intervals[..., 1])).mean(axis=0)
    style.shade_share(axes, edges, share)
    attitude = np.stack([flight["roll"], flight["pitch"]], axis=1)
    axes.plot(*attitude.T, color=style.BLUE, lw=0.9, label="flown")
    curve, here = attitude_plane.singular_curves(n[[closest]], 181)[0], attitude[closest]
    if np.isfinite(curve).any():
        axes.plot(*curve.T, color=style.SINGULAR, lw=1.8, label="singular")
        there = attitude_plane.nearest_singular(n[[closest]], attitude[[closest]])[0]
        when = f", at {flight['time'][closest]:.2f} s" if np.ptp(margin) > LEVEL else ""
        text = f"minimum margin{when}"
        axes.plot(*np.stack([here, there]).T, color=style.INK, lw=1.0, ls="--", label=text)
    axes.plot(*here, "o", color=style.SINGULAR, ms=5, zorder=5)
    if share.any():
        axes.fill([], [], color=style.UNREACHABLE, label="unreachable")
    style.roll_pitch_axes(axes)
    axes.set_title("Attitudes flown")


def _portrait(axes: Axes, shown: Sequence[Shown]) -> None:
    """The phase portrait of the error along y."""
    flight = shown[0].flight
    away, rate = error(flight, "y"), error(flight, "vy")
    style.zero_lines(axes)
    axes.plot(away, rate, color=style.BLUE, lw=1.0, label="path")
    gait: Any = flight.scenario.gait
    if gait.alternates:
        half = flight["time"] / (0.5 * gait.period)
        at = (np.abs(half - np.round(half)) < 1e-6) & (half > 0.5)
        axes.plot(away[at], rate[at], "o", color=style.RED, ms=4.5, zorder=4, label="at n T/2")
    axes.plot(away[0], rate[0], "o", color=style.INK, mfc="white", ms=5, label="start")
    axes.plot(away[-1], rate[-1], "s", color=style.INK, ms=4, label="end")
    axes.margins(0.08)
    title = "Error along y and its rate"
    axes.set(xlabel="error along y (m)", ylabel="rate of the error (m/s)", title=title)
    for part, least in (("x", FLOORS["m"]), ("y", FLOORS["m/s"])):
        low, high = scale([np.array(getattr(axes, f"get_{part}lim")())], [False], least)[:2]
        getattr(axes, f"set_{part}lim")(low, high)
    axes.locator_params(nbins=5)


@traceable
def _turn(true: Floats, estimated: Floats) -> Floats:
    """The rotation (rad, world axes) from an estimated attitude to the true one, if small."""
    about_body = attitude_error(rotation_matrix(estimated), rotation_matrix(true))
    return rotation_matrix(estimated) @ about_body


def errors_of(flight: Flight, vector: str) -> tuple[Floats, Floats]:
    """Errors of an estimate and their standard deviations, each of shape (N, 3).

    Args:
        flight: A flight with an estimator.
        vector: ``position``, ``velocity`` or ``attitude``.
    """
    turned, columns = vector == "attitude", VECTORS[vector]
    estimated = np.stack([flight[f"estimate_{column}"] for column in columns], axis=-1)
    shown = [f"rotation_{axis}" for axis in AXES] if turned else columns
    deviation = np.stack([flight[f"deviation_{column}"] for column in shown], axis=-1)
    if not turned:
        return flight[vector] - estimated, deviation
    return np.array([_turn(*pair) for pair in zip(flight[vector], estimated)]), deviation


def _tube(axes: Axes, shown: Sequence[Shown], vector: str) -> None:
    """The errors of an estimate with a tube of three standard deviations about zero."""
    flight = shown[0].flight
    errors, deviation = errors_of(flight, vector)
    for axis, look in enumerate(style.AXIS_LINES):
        axes.plot(flight["time"], errors[:, axis], label=AXES[axis], **{**look, "lw": 0.8})
    widest = 3.0 * deviation.max(axis=-1)
    axes.fill_between(flight["time"], -widest, widest, color=style.INK, alpha=0.12, lw=0.0)
    settled = widest[len(widest) // 20 :].max()
    axes.set_ylim(-2.0 * settled, 2.0 * settled)
    axes.set_title(f"Estimate {vector} error", loc="left")
    unit = flight.units[VECTORS[vector][0]]
    axes.set_ylabel(f"{vector} error ({unit})")


def set_scale(axes: Axes, signals: Signals, shown: Sequence[Shown]) -> None:
    """Limits of a panel over time: the last periods of moving gaits, the range of the values.

    For flights of different lengths, the periods are the last ones that all flights have.
    """
    flights = [one.flight for one in shown]
    ends = [float(flight["time"][-1]) for flight in flights]
    begin, end = min(signals.settling, 0.5 * max(ends)), max(ends)
    longest = flight_lines.many_periods(flights) if signals.moves else 0.0
    if 0.0 < signals.latest < 0.5 * end:
        begin = end - signals.latest
        axes.set_xlim(begin, end)
        axes.set_xlabel(f"time (s), the last {signals.latest:g} s")
    elif longest > 0.0:
        begin = max(0.0, min(ends) - SHOWN_PERIODS * longest)
        end = begin + SHOWN_PERIODS * longest
        axes.set_xlim(begin, end)
        shared = "" if min(ends) == max(ends) else " of all flights"
        axes.set_xlabel(f"time (s), the last {SHOWN_PERIODS} periods{shared}")
    terminated = {len(one) for one in flights if one.end.kind != "completed"}
    drawn, ended = [], []
    for line in axes.get_lines():
        time, values = (np.asarray(part, float) for part in line.get_data())
        if len(time) != 1:  # a cross at the end follows its line
            whole = len(time) <= 2
            drawn.append(values if whole else values[(time >= begin) & (time <= end)])
            ended.append(not whole and len(time) in terminated)
    low, high, off = scale(drawn, ended, signals.least)
    axes.set_ylim(low, high)
    if off:
        for line in axes.get_lines():
            line.set_clip_on(True)
        look: dict[str, Any] = {"ha": "right", "size": "x-small", "transform": axes.transAxes}
        axes.text(0.995, 0.02, "ends off scale", **look)
