"""The blueprint of a recording: the views of the viewer and their layout."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tiltsim.flight.flight import Flight
from tiltsim.system.text import Quantity
from tiltsim.views import replay
from tiltsim.views.attitude_plane import MOVING_TRAIL_TIME, curve_is_constant
from tiltsim.views.rerun.flight_recorder import BOUND, FlightRecorder, plotted_lines
from tiltsim.views.rerun.scene import REFERENCE_POINTS, Scene, ground_height
from tiltsim.views.rerun.timeline import TIMELINE
from tiltsim.views.signals import OF_WORLD, Signals, range_of
from tiltsim_controllers.mathematics.scalar import Floats

ALONE: Final = "Attitude (shaded: unreachable)"
NEARER: Final = 0.75  # than in videos, whose frames are larger
OVERVIEW: Final = 1.35  # distance of the overview camera, in lengths of the scene that it shows
LETTER: Final = 0.0155  # width of a letter of a legend, as a share of a plot
MAX_LEGEND: Final = 0.34  # share of a plot before the flight, where legends cover no curve
MAIN: Final = "Main signals"
TOGETHER: Final = "All vehicles"
AFTER: Final = 0.06  # time after the flight, as a share of it, for the label of its end
EDGE: Final = 0.06  # of a range, beyond either end, for the labels there
AROUND: Final = 2.2  # height of a plot beside its legend, in lines of the legend
BACKGROUND: Final = (38, 48, 60)


def flight_blueprint(
    recorders: Sequence[FlightRecorder], flights: Sequence[Flight] = (), *, live: bool = False
) -> rrb.Blueprint:
    """Vehicle, trajectory, roll-pitch plane and events on the left, time series on the right.

    Args:
        recorders: One per flight.
        flights: Flights whose values set the ranges of the axes; without them, the viewer does.
        live: Whether the viewer follows the latest time instead of playing from the start.
    """
    scenes = [(one, one.scene) for one in recorders if one.scene is not None]
    planned = recorders[0].scenario.simulation.duration
    end = max((float(flight["time"][-1]) for flight in flights), default=planned)
    trajectory, events = _trajectory_view(scenes, flights, end), _events_view()
    vehicles = [_vehicle_view(*one, alone=len(scenes) == 1) for one in scenes]
    planes = [_plane_view(one) for one in recorders if one.plane is not None]
    below = rrb.Horizontal(trajectory, events, column_shares=[4, 5])
    if len(recorders) > 1:
        # Each flight has its own vehicle and curve; together they would cover each other.
        rows = [rrb.Horizontal(*views) for views in (vehicles, planes) if views]
        left = rrb.Vertical(*rows, below)
    elif planes:
        views = rrb.Horizontal(*vehicles, *planes, column_shares=[5, 4])
        left = rrb.Vertical(views, below, row_shares=[11, 8])
    else:
        views = rrb.Horizontal(*vehicles, trajectory, column_shares=[1, 1])
        left = rrb.Vertical(views, events, row_shares=[11, 4])
    return rrb.Blueprint(
        rrb.Horizontal(left, _plots(recorders, flights, end), column_shares=[13, 8]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            timeline=TIMELINE, state="collapsed", play_state="following" if live else "playing"
        ),
        auto_views=False,
    )


def _vehicle_view(one: FlightRecorder, scene: Scene, *, alone: bool) -> rrb.View:
    """The vehicle at close range; the camera moves with it but does not rotate."""
    radius = replay.seen_radius(one.scenario, scene.model)
    arrows = f"thrust arrows: {100.0 * replay.thrust_scale(scene.model):g} cm per newton"
    pose = replay.camera_of(one.scenario)
    eye = NEARER * radius * pose.distance * pose.away
    return rrb.Spatial3DView(
        origin=scene.camera,
        contents=[f"{scene.root}/**"],
        name=f"Vehicle{'s' * bool(one.name)} ({arrows})" if alone else one.name,
        eye_controls=_eye(eye, np.array([0.0, 0.0, 0.1 * radius])),
        background=BACKGROUND,
        line_grid=False,
        overrides=_trails([scene]),
    )


def _trajectory_view(
    scenes: Sequence[tuple[FlightRecorder, Scene]], flights: Sequence[Flight], end: float
) -> rrb.View:
    """The complete paths of all vehicles and references."""
    first, scene = scenes[0]
    paths = [replay.reference_path(first.assembly, end, REFERENCE_POINTS)]
    tracks = [
        replay.positions(one.columns, p) for one in flights for p in replay.by_prefix(one.assembly)
    ]
    known = np.concatenate([*paths, *tracks])
    low, high = np.quantile(known, 0.02, axis=0), np.quantile(known, 0.98, axis=0)
    size = max(float((high - low).max()), 6.0 * replay.vehicle_radius(scene.model))
    middle, above = 0.5 * (low + high), np.array([0.0, 0.0, 1.0])
    away = above if first.scenario.vehicle.is_planar else replay.camera_of(first.scenario).away
    plane = rr.encodings.Plane3D(normal=(0.0, 0.0, 1.0), distance=ground_height(scene.model))
    return rrb.Spatial3DView(
        origin="world",
        contents=[path for _, each in scenes for path in each.paths],
        name="Trajectory and reference",
        eye_controls=_eye(middle + OVERVIEW * size * away, middle),
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=True, spacing=1.0, plane=plane),
        overrides=_trails([scene for _, scene in scenes]),
    )


def _eye(position: Floats, target: Floats) -> rrb.EyeControls3D:
    steep = abs(float((target - position)[2])) > 0.99 * float(np.linalg.norm(target - position))
    return rrb.EyeControls3D(
        position=position.tolist(),
        look_target=target.tolist(),
        eye_up=(0.0, 1.0, 0.0) if steep else (0.0, 0.0, 1.0),
    )


def _plane_view(one: FlightRecorder) -> rrb.View:
    assert one.plane is not None
    root = one.plane.root
    # Where the curve moves, only the latest attitudes, to which it applies.
    trail = _from_the_start()
    if not curve_is_constant(one.scenario):
        start = rr.TimeRangeBoundary.cursor_relative(seconds=-MOVING_TRAIL_TIME)
        end = rr.TimeRangeBoundary.cursor_relative()
        trail = rrb.VisibleTimeRanges(timeline=TIMELINE, start=start, end=end)
    return rrb.Spatial2DView(
        origin=root,
        name=one.name or ALONE,
        visual_bounds=rrb.VisualBounds2D(x_range=(-BOUND, BOUND), y_range=(-BOUND, BOUND)),
        overrides={f"{root}/trail": trail},
    )


def _events_view() -> rrb.View:
    return rrb.TextLogView(
        origin="events",
        name="Events",
        columns=rrb.TextLogColumns(
            timeline_columns=[TIMELINE],
            text_log_columns=["Body"],  # the color shows the level
        ),
    )


def _plots(
    recorders: Sequence[FlightRecorder], flights: Sequence[Flight], end: float
) -> rrb.Container:
    """The plots of the time series; for several flights or vehicles, of the compared signals.

    Only the first plot of a comparison has a legend: colors are the same in all plots. Vehicles
    that fly together have separate tabs behind it.
    """
    if len(recorders) == 1:
        return rrb.Tabs(*_tabs(recorders[0], flights, end))
    compared = _compared(recorders, flights, _times([one.name for one in recorders], end))
    if not recorders[0].details:
        return rrb.Vertical(*compared)
    own: list[list[Flight]] = [[flight] for flight in flights] or [[] for _ in recorders]
    alone = zip(recorders, own, strict=True)
    tabs = (rrb.Tabs(*_tabs(one, shown, end), name=one.name) for one, shown in alone)
    return rrb.Tabs(rrb.Vertical(*compared, name=TOGETHER), *tabs)


def _times(labels: Sequence[str], end: float) -> tuple[float, float]:
    """The times (s) that plots show: before the flight, their legend has its place."""
    share = min(MAX_LEGEND, 0.08 + LETTER * max(map(len, labels)))
    return -share / (1.0 - share) * end, (1.0 + AFTER) * end


def _tabs(
    one: FlightRecorder, flights: Sequence[Flight], end: float
) -> tuple[rrb.Container, rrb.Container]:
    """The plots of one vehicle: its main signals, and all others."""
    signals, root = one.signals.values(), one.details
    labels = {each.name: [line.label for line in plotted_lines(each)] for each in signals}
    times = _times([text for each in signals if each.plotted for text in labels[each.name]], end)

    def plot(panel: Signals, title: str, *, legend: bool = False) -> rrb.View:
        limits = range_of([(panel, flight) for flight in flights]) if flights else None
        return _plot(title, [f"{root}{panel.path}/**"], limits, times, legend=legend)

    rows: list[rrb.View | rrb.Container] = []
    heights, bare, others = [], [], []
    for each in signals:
        entries = {*labels[each.name]}
        if not each.plotted:
            others.append(plot(each, each.text, legend=len(entries) > 1))
        elif len(entries) < 2:
            bare.append(each)
        else:
            # The next legend needs the height: plots without one stand beside it, named by lines.
            names = [Quantity(one.lines[0].label.capitalize(), one.unit).text for one in bare]
            narrow = map(plot, bare, names)
            view = plot(each, each.text, legend=True)
            rows.append(rrb.Horizontal(*narrow, view) if bare else view)
            heights.append(AROUND + len(entries) + len(each.levels))
            bare = []
    rows += [plot(each, each.text) for each in bare]
    shares = [*heights, *[4.0] * len(bare)]
    main = rrb.Vertical(*rows, row_shares=shares, name=MAIN)
    return main, rrb.Grid(*others, grid_columns=2, name="All other signals")


def _compared(
    recorders: Sequence[FlightRecorder], flights: Sequence[Flight], times: tuple[float, float]
) -> Iterator[rrb.View]:
    """A plot of each compared signal, with one line per flight."""
    found: dict[tuple[str, str], dict[int, Signals]] = {}
    for number, one in enumerate(recorders):
        for panel in one.signals.values():
            for line in panel.compared:
                alone = replace(panel, title=line.label, detail="", lines=[line], bounds=())
                found.setdefault((panel.path, line.name), {})[number] = alone
    for place, ((path, name), panels) in enumerate(found.items()):
        first = next(iter(panels.values()))
        paths = [f"{recorders[number].part}/{path}/{name}" for number in panels]
        paths += [f"{recorders[0].part}/{path}/{each.name}" for each in first.levels]
        shown = [(panel, flights[number]) for number, panel in panels.items() if flights]
        limits = range_of(shown) if shown else None
        yield _plot(first.text, paths, limits, times, legend=place == 0)
    one, world = recorders[0], flights[:1]
    for panel in one.signals.values():
        if one.details and panel.name in OF_WORLD:
            limits = range_of([(panel, flight) for flight in world]) if world else None
            yield _plot(panel.text, [f"{one.details}{panel.path}/**"], limits, times)


def _plot(
    title: str,
    contents: list[str],
    limits: tuple[float, float] | None,
    times: tuple[float, float],
    *,
    legend: bool = True,
) -> rrb.View:
    shown = (rr.TimeRangeBoundary.absolute(seconds=time) for time in times)
    edge = 0.0 if limits is None else EDGE * (limits[1] - limits[0])
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=title,
        axis_x=rrb.TimeAxis(view_range=rr.encodings.TimeRange(*shown)),
        axis_y=limits and rrb.ScalarAxis(range=(limits[0] - edge, limits[1] + edge)),
        plot_legend=rrb.PlotLegend("LeftTop", visible=legend),
    )


def _trails(scenes: Sequence[Scene]) -> dict[str, rrb.VisibleTimeRanges]:
    return {trail: _from_the_start() for scene in scenes for trail in scene.trails}


def _from_the_start() -> rrb.VisibleTimeRanges:
    """Show everything logged so far, not just the latest segment."""
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rr.TimeRangeBoundary.infinite(),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )
