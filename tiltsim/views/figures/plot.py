"""Figures of flights: one flight on a page, or several compared."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tiltsim.errors import InputError
from tiltsim.flight.flight import VECTORS, Flight, as_flights, components, vehicles_named
from tiltsim.scenario.messages import choose
from tiltsim.system.text import short_repr
from tiltsim.views.figures import layout, style
from tiltsim.views.figures.flight_lines import MOST_LINES, Shown
from tiltsim.views.figures.panels import Panel, column_panel, panels_of, set_scale, signals_panel
from tiltsim.views.signals import OF_WORLD, stems, vector_signals
from tiltsim.views.titles import common_title, describe_controller, describe_gait, flight_names

LARGEST: Final = 1e100
"""Magnitude up to which values are drawn: a diverged flight may end just below overflow."""

WIDE: Final = 6.0
"""Width (inches) from which a page names gait, controller, plant and end below its title."""


def plot(
    flights: Flight | Sequence[Flight],
    *,
    panels: str | Sequence[str] = (),
    size: str | tuple[float, float] | None = None,
    title: str | None = None,
    labels: Sequence[str] | Mapping[str, str] | None = None,
    vehicle: str = "",
) -> Figure:
    """One flight on a page, several in the same axes, or quantiles of more than seven.

    The caller's rcParams take precedence over tiltsim's style, and stay as they are.

    Args:
        flights: One or several.
        panels: Names of panels, columns or vectors, such as ``("path", "margin", "velocity")``;
            default: all that suit the flights.
        size: Such as "85mm x 60mm", or width and height in inches; the panels are arranged to fit.
        title: Instead of the scenarios' title; empty for none.
        labels: Names of the flights in their order, the title if there is only one flight; or, as a
            dict, new texts by present names or texts of the figure.
        vehicle: The only one to draw of flights with several, a name in `Flight.vehicles`; default:
            all.

    Raises:
        InputError: If an argument is wrong, or the size is too small.
    """
    flights = as_flights(flights)
    panels = [panels] if isinstance(panels, str) else panels
    if not isinstance(panels, list | tuple) or not all(isinstance(name, str) for name in panels):
        raise InputError(f"panels = {short_repr(panels)}: must be a list of names")
    if title is not None and not isinstance(title, str):
        raise InputError(f"title = {short_repr(title)}: must be text")
    names, texts = _names_and_texts(flights, labels)
    with style.paper_style(size=style.parse_size("size", size)):
        return draw_flights(flights, names, texts, panels=panels, title=title, vehicle=vehicle)


def draw_flights(
    flights: Sequence[Flight],
    names: Sequence[str],
    texts: Mapping[str, str],
    *,
    panels: Sequence[str],
    title: str | None,
    vehicle: str = "",
) -> Figure:
    """The figure of `plot`, in the style and size of the context: a line for every vehicle.

    Args:
        flights: One or several.
        names: Their names; empty for a single one without a name.
        texts: Texts instead of these names and of other texts of the figure.
        panels: Names; empty for all that suit the flights.
        title: Instead of the scenarios' title; empty for none.
        vehicle: The only one that is drawn; empty for all.
    """
    scenarios = [flight.scenario for flight in flights]
    world: dict[str, Panel] = {}
    flights = vehicles_named(vehicle, flights)
    if vehicle and title is None:
        title = f"{common_title(scenarios)}: {vehicle}".removeprefix(": ")
        names, title = ([names[0] or title], None) if len(flights) == 1 else (names, title)
    together = [] if vehicle or len(flights) > 1 else [*flights[0].vehicles.values()]
    if len(together) > 1:
        alone, shared = panels_of(flights), panels_of(together)
        world = {name: alone[name] for name in OF_WORLD if name in alone}
        if {*panels} <= shared.keys() | world.keys():
            names, flights = [*flights[0].vehicles], together
            title = scenarios[0].title or scenarios[0].address if title is None else title
        else:
            world = {}
    clipped = [np.clip(flight.samples, -LARGEST, LARGEST) for flight in flights]
    flights = [
        flight if np.array_equal(samples, flight.samples) else replace(flight, samples=samples)
        for flight, samples in zip(flights, clipped, strict=True)
    ]
    others = dict(texts)
    names = [others.pop(name, name) if name else "" for name in names]
    longest = max(len(flight) for flight in flights)
    looks = [style.marked_line(number, longest) for number in range(len(flights))]
    if len(flights) == 1:
        looks = [{"color": style.BLUE}]
    elif len(flights) > MOST_LINES:
        looks = [{"color": style.BLUE, "alpha": 0.3, "lw": 0.6, "marker": ""}] * len(flights)
    shown = [Shown(*one) for one in zip(flights, names, looks, strict=True)]
    chosen = _chosen(flights, panels, world)
    heading = partial(_heading, shown, title)
    return layout.fitting(lambda: _page(shown, chosen, heading, others))


def _page(
    shown: Sequence[Shown],
    chosen: Mapping[str, Panel],
    heading: Callable[[float], tuple[str, str]],
    texts: Mapping[str, str],
) -> layout.Page:
    """Draw the panels; ``heading`` is title and line below it for a width (inches)."""
    page = layout.new_page([panel.over_time for panel in chosen.values()])
    for axes, panel in zip(page.panels, chosen.values(), strict=True):
        drawn = [one for one in shown if panel.needs in one.flight.units]
        if panel.over_time:
            style.time_axis(axes, max(float(one.flight["time"][-1]) for one in shown))
        panel.draw(axes, drawn)
        if panel.signals is not None:
            set_scale(axes, panel.signals, drawn)
    if len(shown) == 1:
        layout.place_legends(page)
    for column in page.columns:
        _label_time(column)
    marks = [*_handles(shown, page.figure.axes)] if len(shown) > 1 else []
    said = {str(mark.get_label()): mark for mark in marks}
    for name in said.keys() & texts.keys():
        said[name].set_label(style.verbatim(texts[name]))
    others = {name: text for name, text in texts.items() if name not in said}
    layout.relabel(page.figure, others, dict(zip(chosen, page.panels, strict=True)))
    layout.add_heading(page.figure, *heading(page.figure.get_figwidth()), marks)
    for axes in page.panels:
        layout.wrap(axes.yaxis.label, axes.get_window_extent().height)
    return page


def _names_and_texts(
    flights: Sequence[Flight], labels: Sequence[str] | Mapping[str, str] | None
) -> tuple[Sequence[str], dict[str, str]]:
    """The names of flights, and other texts by the texts that they replace."""
    names = flight_names([flight.scenario for flight in flights]) if len(flights) > 1 else [""]
    if labels is None:
        return names, {}
    if isinstance(labels, Mapping):
        known, texts = True, [*labels, *labels.values()]
    else:
        known = isinstance(labels, list | tuple) and len(labels) == len(flights)
        texts = [*labels] if known else []
    if not known or not all(isinstance(text, str) for text in texts):
        allowed = f"must be a list of one text per flight, here {len(flights)}, or a dict of texts"
        raise InputError(f"labels = {short_repr(labels)}: {allowed}")
    return (names, dict(labels)) if isinstance(labels, Mapping) else (texts, {})


def _chosen(
    flights: Sequence[Flight], names: Sequence[str], world: dict[str, Panel]
) -> dict[str, Panel]:
    """The panels to draw, by name; ``world`` are panels of no vehicle."""
    available = panels_of(flights) | world
    if not names:
        default = [one for one in available.items() if one[0] in world or not one[1].on_request]
        # Squares stand last.
        return dict(sorted(default, key=lambda item: bool(world) and not item[1].over_time))
    columns = dict.fromkeys(column for flight in flights for column in flight.units)
    companions = (one.name for flight in flights for one in flight.scenario.companion)
    prefixes = ("", *(f"{name}_" for name in companions))
    named = (prefix + name for prefix in prefixes for name in VECTORS)
    vectors = stems(columns) | {name: components(name, columns) for name in named}
    vectors = {name: parts for name, parts in vectors.items() if parts}
    chosen: dict[str, Panel] = {}
    for name in names:
        if name in available:
            chosen[name] = available[name]
        elif name in columns:
            chosen[name] = column_panel(flights, name)
        elif name in vectors and len(flights) == 1:
            chosen[name] = signals_panel(vector_signals(flights[0].assembly, name, vectors[name]))
        elif name in vectors:
            chosen |= {part: column_panel(flights, part) for part in vectors[name]}
        else:
            known = dict.fromkeys([*available, *vectors, *columns])
            begun = [each for each in (*available, *vectors) if each.startswith(f"{name}_")]
            reason = f"choose {', '.join(begun)}" if begun else choose(name, known)
            raise InputError(f"panels: {name!r}: {reason}")
    return chosen


def _heading(shown: Sequence[Shown], title: str | None, width: float) -> tuple[str, str]:
    """The title of a page and the line below it, for its width (inches)."""
    flights = [one.flight for one in shown]
    scenarios = [flight.scenario for flight in flights]
    if title is not None:
        return style.verbatim(title), ""
    if len(flights) > 1:
        return style.verbatim(common_title(scenarios) or f"{len(flights)} flights compared"), ""
    scenario, end = scenarios[0], flights[0].end
    own = shown[0].name or " ".join(scenario.title.split())
    text = style.verbatim(own or scenario.address or "Flight")
    if width < WIDE:
        return text, ""
    parts = [style.verbatim(scenario.address.partition("#")[2])]
    parts += [*describe_gait(flights[0].assembly), *describe_controller(scenario)]
    parts.append(f"{scenario.simulation.plant} plant")
    if end.kind == "completed":
        parts.append(f"completed after {end.time:g} s")
    else:
        parts.append(f"{end.kind} at {end.time:.2f} s")
    return text, "  ·  ".join(filter(None, parts))


def _label_time(column: Sequence[Axes]) -> None:
    """Name the time below the lowest panel, and below every one that shows another part of it."""
    for axes, below in zip(column, [*column[1:], None]):
        same = below is not None and axes.get_xlim() == below.get_xlim()
        axes.tick_params(labelbottom=not same)
        if same:
            axes.set_xlabel("")
        elif not axes.get_xlabel():
            axes.set_xlabel("time (s)")


def _handles(shown: Sequence[Shown], axes: Sequence[Axes]) -> Iterator[Any]:
    """Handles of the flights and of the marks in the axes."""
    many = len(shown) > MOST_LINES
    for flight, name, look in () if many else shown:
        end = flight.end
        more = "" if end.kind == "completed" else f", {end.kind} at {end.time:.2f} s"
        yield Line2D([], [], label=style.verbatim(name) + more, **{**look, "markevery": None})
    lost = sum(flight.end.kind != "completed" for flight, _, _ in shown)
    if lost and many:
        yield Line2D([], [], ls="", label=f"{lost} of {len(shown)} terminated early")
    elif lost:
        look = {"color": style.GREY, "marker": "X", "ls": "", "ms": 6}
        yield Line2D([], [], **look, label="terminated early")
    marks: dict[str, Any] = {}
    for one in axes:
        for handle, text in zip(*one.get_legend_handles_labels(), strict=True):
            marks.setdefault(text, handle)
    yield from marks.values()
