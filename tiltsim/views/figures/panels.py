"""Panels over time and plan views, of one flight or of several in the same axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.laws.layers.supervision import SUPERVISION
from tiltsim.system.quantity import in_words
from tiltsim.views.attitude_plane import margin_threshold
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import legend_over

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tiltsim.flight.flight import Flight
    from tiltsim_controllers.mathematics.scalar import Floats

END_FRACTION: Final = 0.02
"""Share of the samples, at the end of a diverged flight, that the scale of a panel ignores."""

MAX_WIDENING: Final = 4.0
"""Factor by which these samples may widen the scale of a panel before they are ignored."""

MAX_PERIODS: Final = 10
"""Periods of a gait above which what moves with it would be a solid band."""

SHOWN_PERIODS: Final = 4
"""Number of periods that are shown instead, the last ones."""

NARROW: Final = 8.0
"""Ratio of a path's extents above which its plan view has a scale of its own for each axis."""


SMALLEST_ANGLES: Final = 1e-3
"""Smallest range (rad) of an axis of angles: what is far smaller is as good as zero."""


class Shown(NamedTuple):
    """A flight of a figure, with the text of its legend and the look of its lines."""

    flight: Flight
    name: str
    look: Mapping[str, Any]


@dataclass(frozen=True)
class Panel:
    """A part of a figure of flights.

    Attributes:
        draw: ``(axes, shown)``: draws the flights, one or several, and labels the axes.
        over_time: Whether its x axis is the time; else it is a square.
        scaled: Whether `draw` chooses the scale of the y axis for any values.
        needs: A column that the flights must have.
        unless: A column with which the panel is only drawn on request.
    """

    draw: Callable[[Axes, Sequence[Shown]], None]
    over_time: bool = True
    scaled: bool = False
    needs: str = "time"
    unless: str = ""


def of_one(draw: Callable[[Axes, Flight], None], **about: Any) -> Panel:
    """A panel of a single flight."""
    return Panel(lambda axes, shown: draw(axes, shown[0].flight), **about)


def column_panel(name: str) -> Panel:
    """A column over time with, if the flights have it, its reference."""

    def draw(axes: Axes, shown: Sequence[Shown]) -> None:
        for one in shown:
            time, values = one.flight["time"], one.flight[name]
            axes.plot(time, values, **one.look, lw=1.2)
            if f"{name}_ref" in one.flight.columns:
                color = one.look["color"] if len(shown) > 1 else style.INK
                axes.plot(time, one.flight[f"{name}_ref"], color=color, ls=":", lw=0.8)
            _mark_end(axes, one, values)
        label = shown[0].flight.assembly.loop.label(name)
        axes.set_ylabel(label.text)
        show_last_periods(axes, [one.flight for one in shown])
        widen(axes, SMALLEST_ANGLES if label.unit == "rad" else 1e-6)

    return Panel(draw, needs=name)


def vector_panel(name: str, columns: Sequence[str]) -> Panel:
    """The components of a vector of one flight over time."""

    def draw(axes: Axes, flight: Flight) -> None:
        known = [flight.assembly.loop.label(column) for column in columns]
        looks = style.AXIS_LINES if len(columns) <= 3 else style.ROTOR_LINES
        for column, (label, _), line in zip(columns, known, looks, strict=False):
            axes.plot(flight["time"], flight[column], label=label, **line)
        widen(axes, 1e-6)
        show_last_periods(axes, [flight])
        axes.set_ylabel(known[0].unit)
        legend_over(axes, in_words(name).capitalize())

    return of_one(draw)


def _distance(axes: Axes, shown: Sequence[Shown]) -> None:
    """The distance of every flight from its reference."""
    for one in shown:
        names = "xyz" if one.flight.assembly.follows_position else "z"
        errors = [
            one.flight[f"{axis}_ref"] - one.flight[axis]
            for axis in names
            if axis in one.flight.columns
        ]
        distance = np.asarray(np.linalg.norm(errors, axis=0))
        axes.plot(one.flight["time"], distance, **one.look)
        _mark_end(axes, one, distance)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("position error (m)")


def _margins(axes: Axes, shown: Sequence[Shown]) -> None:
    """The singularity margin of every flight, and what of it counts as nearly singular."""
    threshold = max(margin_threshold(one.flight.scenario) for one in shown)
    shade_below(axes, threshold, f"margin below {threshold:g} rad")
    for one in shown:
        margin = np.maximum(one.flight["singularity_margin"], 0.0)
        axes.plot(one.flight["time"], margin, **one.look, lw=line_width([one.flight]))
        _mark_end(axes, one, margin)
    style.angle_axis(axes, "y", pi / 2)
    axes.set_ylim(0.0, pi / 2 * 1.02)
    axes.set_ylabel("singularity margin (rad)")


def _determinant(axes: Axes, shown: Sequence[Shown]) -> None:
    """The determinant, 4 for a level untilted vehicle, and the threshold of the supervisor."""
    thresholds = [one.flight.scenario.controller.supervision for one in shown]
    lowest = max((t.min_determinant for t in thresholds if t is not None), default=0.0)
    if lowest > 0.0:
        shade_below(axes, lowest, f"determinant below {lowest:g}")
    top = 4.0
    for one in shown:
        values = np.maximum(one.flight["determinant"], 0.0)
        top = max(top, 1.05 * float(values.max()))
        axes.plot(one.flight["time"], values, **one.look, lw=line_width([one.flight]))
        _mark_end(axes, one, values)
    axes.set_ylim(0.0, top)
    axes.set_ylabel("determinant n · r₃")


def _supervisor(axes: Axes, shown: Sequence[Shown]) -> None:
    """How far each supervisor intervenes."""
    for one in shown:
        axes.plot(one.flight["time"], one.flight[SUPERVISION], **one.look)
        _mark_end(axes, one, one.flight[SUPERVISION])
    axes.set_ylim(-0.03, 1.03)
    axes.set_ylabel("supervisor (0 to 1)")


def _path(axes: Axes, shown: Sequence[Shown]) -> None:
    """The paths from above."""
    known: list[Floats] = []
    for one in shown:
        flight = one.flight
        if flight.assembly.follows_position:
            reference = np.stack([flight["x_ref"], flight["y_ref"]])
            if not any(np.array_equal(reference, other) for other in known):
                _reference(axes, reference, "" if known else "reference")
                known.append(reference)
        x, y = flight["x"], flight["y"]
        axes.plot(x, y, **one.look, label="path" if len(shown) == 1 else "")
        first, single = one is shown[0], len(shown) == 1
        label = "start" if first else ""
        axes.plot(x[0], y[0], "o", color=style.INK, mfc="white", ms=5, label=label, zorder=3)
        if flight.end.kind != "completed":
            text = "terminated early" if single else ""
            axes.plot(x[-1], y[-1], "X", color=one.look["color"], ms=7, zorder=6, label=text)
        else:
            color = style.INK if single else one.look["color"]
            axes.plot(x[-1], y[-1], "s", color=color, ms=4.5, zorder=4)
            axes.plot([], [], "s", color=style.INK, ms=4.5, label="end" if first else "")
    axes.margins(0.08)
    axes.set(xlabel="x (m)", ylabel="y (m)", title="Plan view")
    data = axes.dataLim
    if min(data.width, data.height) * NARROW < max(data.width, data.height):
        widen(axes, 1e-3)
        axes.set_title("Plan view, x and y to different scales")
    elif len(shown) > 1:
        axes.set_aspect("equal", anchor="N")
    else:
        axes.set_aspect("equal", adjustable="datalim")


def plan_view(axes: Axes, flight: Flight) -> None:
    """The path of one flight from above."""
    _path(axes, [Shown(flight, "", {"color": style.BLUE})])
    style.legend_below(axes)


def _reference(axes: Axes, reference: Floats, label: str) -> None:
    if np.ptp(reference, axis=1).sum() > 0.0:
        axes.plot(*reference, color=style.INK, ls=":", lw=1.1, label=label, zorder=1.5)
    else:
        axes.plot(*reference[:, 0], "+", color=style.INK, ms=7, mew=1.4, label=label)


def show_last_periods(axes: Axes, flights: Sequence[Flight]) -> None:
    """Show only the last periods of moving gaits where all of them would be a solid band.

    Of flights of different lengths they are the last ones that all flights have.
    """
    longest = many_periods(flights)
    if longest > 0.0:
        ends = [float(flight["time"][-1]) for flight in flights]
        begin = max(0.0, min(ends) - SHOWN_PERIODS * longest)
        show_part(axes, begin, begin + SHOWN_PERIODS * longest)
        shared = "" if min(ends) == max(ends) else " of all flights"
        axes.set_xlabel(f"time (s), the last {SHOWN_PERIODS} periods{shared}")


def many_periods(flights: Sequence[Flight]) -> float:
    """The longest period (s) of gaits with so many of them that they are a solid band, else 0."""
    end = max(float(flight["time"][-1]) for flight in flights)
    if any(SUPERVISION in flight.units for flight in flights):
        return 0.0
    periods = [
        flight.assembly.gait.period or 0.0
        for flight in flights
        if flight.scenario.vehicle.has_tilting_rotors
    ]
    return max((period for period in periods if end > MAX_PERIODS * period), default=0.0)


def line_width(flights: Sequence[Flight]) -> float:
    """The width (points) of lines over whole flights: thin where they oscillate densely."""
    return 0.7 if many_periods(flights) else 1.4


def show_part(axes: Axes, begin: float, end: float) -> None:
    """Limit a panel to a part of the time (s), with the scale of what it shows."""
    axes.set_xlim(begin, end)
    shown = []
    for line in axes.get_lines():
        time, values = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        shown.append(values[(time >= begin) & (time <= end)] if len(time) > 2 else values)
    seen = np.concatenate(shown)
    pad = 0.08 * float(np.ptp(seen)) or 0.05
    axes.set_ylim(float(seen.min()) - pad, float(seen.max()) + pad)


def shade_below(axes: Axes, value: float, label: str) -> None:
    """Shade what is as good as singular: everything below a threshold."""
    axes.axhspan(0.0, value, color=style.UNREACHABLE, lw=0.0, label=label)


def _mark_end(axes: Axes, one: Shown, values: Floats) -> None:
    """A cross where a flight terminated early."""
    if one.flight.end.kind != "completed":
        at, color = (one.flight["time"][-1], values[-1]), one.look["color"]
        axes.plot(*at, "X", color=color, ms=6, zorder=6, clip_on=False)


def widen(axes: Axes, minimum: float) -> None:
    """Widen the y axis to a minimum range, so that noise does not fill the panel."""
    low, high = axes.get_ylim()
    if high - low < minimum:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * minimum, middle + 0.5 * minimum)


def exclude_divergence_from_scale(axes: Axes, shown: Sequence[Shown]) -> None:
    """Ignore the last samples of diverged flights in the scale of a panel.

    They can be of any magnitude, which would make the rest of the flights a flat line.
    """
    if all(one.flight.end.kind == "completed" for one in shown):
        return
    lows, highs = [], []
    last_samples = {
        len(one.flight): max(1, round(END_FRACTION * len(one.flight)))
        for one in shown
        if one.flight.end.kind != "completed"
    }
    lines = [
        np.asarray(line.get_ydata()) for line in axes.get_lines() if np.size(line.get_xdata()) > 2
    ]
    for values in lines:
        before = values[: -last_samples.get(len(values), 0) or None]
        lows.append(float(before.min(initial=np.inf)))
        highs.append(float(before.max(initial=-np.inf)))
    low, high = min(lows, default=np.inf), max(highs, default=-np.inf)
    whole = np.ptp(np.concatenate(lines)) if lines else 0.0
    if np.isfinite(low) and whole > MAX_WIDENING * max(high - low, 1e-3 * abs(high), 1e-6):
        pad = 0.3 * max(high - low, 0.1 * abs(high), 1e-2)
        axes.set_ylim(low - pad, high + pad)
        for line in axes.get_lines():
            line.set_clip_on(True)
        look: dict[str, Any] = {"ha": "right", "size": "x-small", "transform": axes.transAxes}
        axes.text(0.995, 0.02, "ends off scale", **look)


COMPARED: Final[dict[str, Panel]] = {
    "position_error": Panel(_distance),
    "margin": Panel(_margins, scaled=True, needs="singularity_margin"),
    "determinant": Panel(_determinant, scaled=True, needs="determinant"),
    "supervisor": Panel(_supervisor, scaled=True, needs=SUPERVISION),
    "roll": column_panel("roll"),
    "pitch": column_panel("pitch"),
    "yaw": column_panel("yaw"),
    "path": Panel(_path, over_time=False),
}
"""The panels of a comparison, by name."""
