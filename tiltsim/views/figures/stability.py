"""Figures of stability: poles, multipliers, loops, and maps of the region of attraction."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from math import nan
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tiltsim.laws.assembling import assemble
from tiltsim.linear.attraction import PLACES, Attraction
from tiltsim.linear.linearization import Linearization
from tiltsim.linear.margins import TOGETHER, broken_loops, frequency_grid
from tiltsim.linear.modes import NEUTRAL
from tiltsim.linear.stability import Point, Stability
from tiltsim.scenario.schema import quantity_of_key
from tiltsim.system.text import in_words
from tiltsim.views.figures import style
from tiltsim.views.titles import address_in_words
from tiltsim_controllers.analysis.singularity import unacceptable_attitudes
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle

SWINGS: Final = 0.01  # imaginary part, as a share of a pole, below which it counts as real
ALIKE: Final = 30.0  # parts of poles that differ by a smaller factor share a linear axis
MOST: Final = 1e4
"""Ratio of the largest part of a pole to the smallest that a logarithmic axis resolves."""

UNITS: Final = {"position": "m", "velocity": "m/s", "attitude": "rad", "angular_velocity": "rad/s"}
CURVES: Final = 8  # curves of singular attitudes of a moving gait


@style.paper_style()
def stability_figure(found: Stability) -> Figure:
    """The poles of a rest point in the complex plane, or the multipliers of an orbit."""
    figure = style.new_figure(5.2, 4.2)
    axes = figure.subplots()
    values = found.poles if found.poles is not None else found.multipliers
    assert values is not None  # it is an orbit, if not a rest point
    if found.poles is not None:
        grows = values.real > NEUTRAL
        _frame_poles(axes, values)
    else:
        grows = np.abs(values) > 1.0
        _unit_circle(axes, style.INK)
        axes.set(xlabel="real part", ylabel="imaginary part", aspect="equal")
    for shown, color, marker in ((~grows, style.BLUE, "x"), (grows, style.RED, "X")):
        look = {"color": color, "ms": 6.0, "mew": 1.4}
        axes.plot(values[shown].real, values[shown].imag, marker, **look)
    verdict = "stable" if found.stable else "unstable"
    if found.period is None:
        axes.set_title(f"Poles of the rest point: {verdict}")
    else:
        axes.set_title(f"Multipliers of the orbit of {found.period:.4g} s: {verdict}")
    return figure


@style.paper_style()
def sweep_figure(key: str, sweeps: Mapping[str, Sequence[Point]]) -> Figure:
    """Largest multiplier, and slowest mode but altitude, over a key; one line per scenario."""
    figure = style.new_figure(6.4, 6.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    looks = zip(cycle(style.CYCLE), cycle(style.DASHES), cycle(style.MARKERS))
    for (address, points), (color, dashes, marker) in zip(sweeps.items(), looks):
        found = [(point.value, point.found) for point in points if point.found is not None]
        values = [value for value, _ in found]
        largest = [each.growth for _, each in found]
        rates = [
            max((mode.growth_rate for mode in each.modes if mode.name != "altitude"), default=nan)
            for _, each in found
        ]
        label = style.verbatim(address_in_words(address))
        line: Any = {"color": color, "ls": dashes, "marker": marker, "ms": 3.5, "label": label}
        upper.plot(values, largest, **line)
        lower.plot(values, rates, **line)
    for axes, limit in ((upper, 1.0), (lower, 0.0)):
        low, high = axes.get_ylim()
        axes.set_ylim(low, max(high, limit + 0.1 * (limit - low)))
        axes.axhspan(limit, axes.get_ylim()[1], color=style.UNREACHABLE, lw=0, zorder=0)
        axes.axhline(limit, color=style.INK, lw=0.8)
        axes.margins(x=0.02)
    upper.set(ylabel="largest multiplier", title="Remainder of a disturbance after one period")
    lower.set(ylabel="growth rate (1/s)", xlabel=quantity_of_key(key).text)
    lower.set_title("Slowest mode other than altitude")
    figure.legend(handles=upper.get_legend_handles_labels()[0], loc="outside lower center", ncols=2)
    return figure


@style.paper_style()
def loop_figure(system: Linearization) -> Figure:
    """Bode and Nyquist diagrams of loops broken at one input, and sensitivities of all inputs."""
    grid, places = frequency_grid(system), {TOGETHER, *(signal.name for signal in system.inputs)}
    together, *single = [loop for loop in broken_loops(system) if loop.place in places]
    figure = style.new_figure(8.4, 6.0)
    (gain, nyquist), (phase, sensitivity) = figure.subplots(2, 2)
    _unit_circle(nyquist, style.GREY)
    for loop, line in zip(single, style.rotor_lines(len(single)), strict=True):
        transfer = loop.transfer(grid)[:, 0, 0]
        gain.loglog(grid, np.abs(transfer), label=in_words(loop.place), **line)
        degrees = np.degrees(np.unwrap(np.angle(transfer)))
        phase.semilogx(grid, degrees - 360.0 * np.ceil(degrees.max() / 360.0 - 0.5), **line)
        nyquist.plot(transfer.real, transfer.imag, **line)
    nyquist.plot([-1.0], [0.0], "+", color=style.RED, ms=9.0, mew=1.6)
    gain.axhline(1.0, color=style.INK, lw=0.8)
    phase.axhline(-180.0, color=style.INK, lw=0.8)
    transfer = together.transfer(grid)
    inverse = np.linalg.inv(np.eye(transfer.shape[-1]) + transfer)
    for name, matrices, line in (
        ("sensitivity", inverse, style.AXIS_LINES[0]),
        ("complement", np.eye(transfer.shape[-1]) - inverse, style.AXIS_LINES[1]),
    ):
        sizes = np.linalg.norm(matrices, ord=2, axis=(1, 2))
        sensitivity.loglog(grid, sizes, label=name, **line)
    sensitivity.axhline(1.0, color=style.INK, lw=0.8)
    sensitivity.legend(loc="lower center")
    gain.set(ylabel="loop gain (1)", title="Loops broken at one input")
    phase.set(xlabel="frequency (rad/s)", ylabel="phase (deg)")
    nyquist.set(xlim=(-3.2, 2.0), ylim=(-1.6, 1.6), title="Nyquist diagram")
    nyquist.set_aspect("equal", anchor="N")
    nyquist.set(xlabel="real part", ylabel="imaginary part")
    sensitivity.set(xlabel="frequency (rad/s)", ylabel="largest singular value (1)")
    sensitivity.set_title("All inputs together")
    figure.legend(handles=gain.get_legend_handles_labels()[0], loc="outside lower center", ncols=4)
    return figure


def _unit_circle(axes: Any, color: str) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(angle), np.sin(angle), color=color, lw=0.8)


def _frame_poles(axes: Any, poles: Floats) -> None:
    """Scales on which poles of any size can be seen, and the unstable half plane."""
    # Rounding splits equal real poles into pairs that hardly swing.
    swings = np.where(np.abs(poles.imag) > SWINGS * np.abs(poles), poles.imag, 0.0)
    least = _stretch(axes, "x", poles.real)
    _stretch(axes, "y", swings)
    right = max(least, 1.5 * float(poles.real.max()))
    up = 1.5 * float(swings.max()) or 1.0
    axes.axvspan(0.0, right, color=style.UNREACHABLE, lw=0)
    axes.set(xlim=(min(-least, 1.5 * float(poles.real.min())), right), ylim=(-up, up))
    axes.set(xlabel="real part (rad/s)", ylabel="imaginary part (rad/s)")
    axes.axvline(0.0, color=style.INK, lw=0.8)


def _stretch(axes: Any, name: str, parts: Floats) -> float:
    """Make an axis logarithmic down to the smallest part if the parts are of different size.

    Returns:
        The size below which it is linear; a tenth of the largest where it is throughout.
    """
    sizes = np.abs(parts)[np.abs(parts) > NEUTRAL]
    if not sizes.size:
        return 1.0
    if sizes.max() <= ALIKE * sizes.min():
        return float(0.1 * sizes.max())
    least = 10.0 ** np.floor(np.log10(max(sizes.min(), sizes.max() / MOST)))
    getattr(axes, f"set_{name}scale")("symlog", linthresh=least, subs=range(2, 10))
    getattr(axes, f"{name}axis").set_major_formatter("{x:g}")
    return float(least)


@style.paper_style()
def attraction_figure(found: Attraction) -> Figure:
    """Initial states that come back, with the gait's singular attitudes."""
    figure = style.new_figure(5.0, 5.0)
    axes = figure.subplots()
    handles = _draw_map(axes, found)
    places = [PLACES[name] for name in found.axes]
    start = [getattr(found.scenario.initial, key)[index] for key, index in places]
    axes.plot(*start, "+", color=style.INK, ms=8, mew=1.2)
    handles.append(Line2D([], [], color=style.INK, marker="+", ls="", label="the scenario"))
    labels = [f"{in_words(name)} ({UNITS[PLACES[name][0]]})" for name in found.axes]
    axes.set(xlabel=f"initial {labels[0]}", ylabel=f"initial {labels[1]}")
    axes.set_title(f"{100.0 * found.share.mean():.1f} % of the initial states come back")
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@style.paper_style()
def attraction_panels(maps: Mapping[str, Attraction], columns: int = 4) -> Figure:
    """Maps of roll and pitch side by side, by title: the initial attitudes that come back."""
    rows = -(-len(maps) // columns)
    figure = style.new_figure(2.5 * columns, 2.9 * rows)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    handles: dict[str, Artist] = {}
    for axes, (title, found) in zip(grid.flat, maps.items(), strict=False):
        drawn = _draw_map(axes, found)
        # Curves of fixed and of moving gaits look the same: one entry.
        handles |= {str(handle.get_label()).partition(",")[0]: handle for handle in drawn}
        report = found.report()
        shares = [report["acceptable_returned"], report["unacceptable_returned"]]
        texts = ["-" if share is None else f"{100.0 * share:.1f} %" for share in shares]
        axes.set_title(f"{title}\n{' | '.join(texts)}")
    for axes in grid[-1]:
        axes.set_xlabel("initial roll (rad)")
    for axes in grid[:, 0]:
        axes.set_ylabel("initial pitch (rad)")
    for axes in grid.flat[len(maps) :]:
        axes.axis("off")
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=3)
    return figure


def _draw_map(axes: Any, found: Attraction) -> list[Artist]:
    """Shade what comes back and draw the singular attitudes; return the legend's entries."""
    shades = LinearSegmentedColormap.from_list("returned", ["#FFFFFF", style.SKY])
    axes.pcolormesh(*found.edges, found.share, cmap=shades, vmin=0.0, vmax=1.0, rasterized=True)
    handles: list[Artist] = [Patch(facecolor=style.SKY, label="comes back")]
    vehicle = found.scenario.vehicle.resolve()
    if found.acceptable is not None and isinstance(vehicle, Vehicle):
        gait = assemble(found.scenario).gait
        times = np.arange(CURVES) / CURVES * (gait.period or 0.0)
        instants = gait.angles(times if gait.period else times[:1])
        curves = [unacceptable_attitudes(angles, vehicle, 721) for angles in instants]
        for curve in curves:
            axes.plot(curve.roll, curve.pitch, color=style.SINGULAR, lw=1.2)
        if any(len(curve.roll) for curve in curves):
            label = "singular, over a period" if gait.period else "singular"
            handles.append(Line2D([], [], color=style.SINGULAR, lw=1.2, label=label))
    first, second = found.edges
    axes.set(xlim=(first[0], first[-1]), ylim=(second[0], second[-1]))
    axes.grid(False)
    if len({PLACES[name][0] for name in found.axes}) == 1:
        axes.set_aspect("equal")
    return handles
