"""The blueprint: the views that the viewer opens for a recording, and their layout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tiltsim.views.attitude_plane import MOVING_TRAIL_TIME, curve_is_constant
from tiltsim.views.replay import reference_path, thrust_scale, vehicle_radius
from tiltsim.views.rerun.geometry import ground_height
from tiltsim.views.rerun.plane import BOUND
from tiltsim.views.rerun.scene import REFERENCE_POINTS
from tiltsim.views.rerun.timeline import TIMELINE

if TYPE_CHECKING:
    from tiltsim.views.rerun.flight_recorder import FlightRecorder


ALONE: Final = "Attitude (shaded: unreachable attitudes)"
"""Title of the roll-pitch plane of a single flight."""

OVERVIEW_HEIGHT: Final = 1.35
"""Height of the overview camera in lengths of the reference, which it shows completely."""


def flight_blueprint(flights: Sequence[FlightRecorder], *, live: bool = False) -> rrb.Blueprint:
    """Vehicle, trajectory, roll-pitch plane and events on the left, time series on the right.

    ``live`` lets the viewer follow the latest time instead of playing from the start.
    """
    trajectory, events = _trajectory_view(flights), _events_view()
    vehicles = [_vehicle_view(flight) for flight in flights]
    planes = [_plane_view(flight) for flight in flights if flight.plane is not None]
    if len(flights) > 1:
        # Each flight has its own vehicle and curve; together they would cover each other.
        rows = [rrb.Horizontal(*views) for views in (vehicles, planes) if views]
        below = rrb.Horizontal(trajectory, events, column_shares=[4, 5])
        left = rrb.Vertical(*rows, below)
    elif planes:
        views = rrb.Horizontal(*vehicles, *planes, column_shares=[5, 4])
        below = rrb.Horizontal(trajectory, events, column_shares=[4, 5])
        left = rrb.Vertical(views, below, row_shares=[11, 8])
    else:
        views = rrb.Horizontal(*vehicles, trajectory, column_shares=[1, 1])
        left = rrb.Vertical(views, events, row_shares=[11, 4])
    plots, heights = _plots(flights)
    right = rrb.Vertical(*plots, row_shares=heights)
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[13, 8]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            timeline=TIMELINE, state="collapsed", play_state="following" if live else "playing"
        ),
        auto_views=False,
    )


def _vehicle_view(flight: FlightRecorder) -> rrb.View:
    """The vehicle at close range; the camera moves with it but does not rotate."""
    radius = vehicle_radius(flight.model)
    arrows = f"thrust arrows: {100.0 * thrust_scale(flight.model):g} cm per newton"
    return rrb.Spatial3DView(
        origin=flight.scene.camera,
        contents=[f"{flight.scene.root}/**"],
        name=flight.name or f"Vehicle ({arrows})",
        eye_controls=rrb.EyeControls3D(
            position=[radius * part for part in flight.display.eye],
            look_target=(0.0, 0.0, 0.3 * radius),
            eye_up=flight.display.up,
        ),
        line_grid=False,
        overrides=_trails([flight]),
    )


def _trajectory_view(flights: Sequence[FlightRecorder]) -> rrb.View:
    """The complete paths of all vehicles and references."""
    contents = []
    for flight in flights:
        contents += [f"{flight.scene.root}/trail", f"{flight.scene.root}/reference/**"]
        contents += [f"{flight.scene.vehicle}/**", f"{flight.scene.camera}/**"]
    return rrb.Spatial3DView(
        origin="world",
        contents=contents,
        name="Trajectory and reference",
        eye_controls=_from_above(flights[0]),
        line_grid=_grid(ground_height(flights[0].model)),
        overrides=_trails(flights),
    )


def _from_above(flight: FlightRecorder) -> rrb.EyeControls3D | None:
    """A camera straight above the reference, for vehicles that move in a plane."""
    if not flight.display.overview:
        return None
    path = reference_path(flight.assembly, flight.scenario.simulation.duration, REFERENCE_POINTS)
    x, y, _ = (0.5 * (path.min(axis=0) + path.max(axis=0))).tolist()
    height = OVERVIEW_HEIGHT * max(np.ptp(path, axis=0).max(), 1.0)
    return rrb.EyeControls3D(
        position=(x, y, float(height)), look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0)
    )


def _plane_view(flight: FlightRecorder) -> rrb.View:
    assert flight.plane is not None
    root = flight.plane.root
    return rrb.Spatial2DView(
        origin=root,
        name=f"Unreachable: {flight.name}" if flight.name else ALONE,
        visual_bounds=rrb.VisualBounds2D(x_range=(-BOUND, BOUND), y_range=(-BOUND, BOUND)),
        overrides={f"{root}/trail": _attitude_trail(flight)},
    )


def _events_view() -> rrb.View:
    return rrb.TextLogView(
        origin="events",
        name="Events",
        columns=rrb.TextLogColumns(
            timeline_columns=[TIMELINE],
            text_log_columns=["Body"],  # the colour shows the level
        ),
    )


def _plots(flights: Sequence[FlightRecorder]) -> tuple[list[rrb.View], list[float]]:
    """The plots of the time series and their heights; for several flights, those compared.

    Only the first plot of a comparison has a legend: colours are the same in all plots, and long
    names would cover half of each.
    """
    panels = flights[0].display.panels(flights[0].assembly)
    if len(flights) == 1:
        whole = [
            _plot(panel.title, [f"{panel.path}/**"], panel.limits(flights[0].assembly))
            for panel in panels
        ]
        return whole, [panel.height for panel in panels]

    parts = [rr.escape_entity_path_part(flight.name) for flight in flights]
    plots: list[rrb.View] = []
    for panel in panels:
        limits = panel.limits(flights[0].assembly)
        levels = [f"{parts[0]}/{panel.path}/{level}" for level in panel.levels]
        for compared in panel.compared:
            lines = [f"{part}/{panel.path}/{compared.name}" for part in parts]
            legend = not plots
            plots.append(_plot(compared.title, [*lines, *levels], limits, legend))
    return plots, [1.0] * len(plots)


def _plot(
    title: str, contents: list[str], limits: tuple[float, float] | None, legend: bool = True
) -> rrb.View:
    # On the left: how a flight ends matters more than how it begins.
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=title,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=None if limits is None else rrb.ScalarAxis(range=limits),
        plot_legend=rrb.PlotLegend("LeftTop", visible=legend),
    )


def _grid(height: float) -> rrb.LineGrid3D:
    plane = rr.encodings.Plane3D(normal=(0.0, 0.0, 1.0), distance=height)
    return rrb.LineGrid3D(visible=True, spacing=1.0, plane=plane)


def _trails(flights: Sequence[FlightRecorder]) -> dict[str, rrb.VisibleTimeRanges]:
    return {f"{flight.scene.root}/trail": _from_the_start() for flight in flights}


def _attitude_trail(flight: FlightRecorder) -> rrb.VisibleTimeRanges:
    """All attitudes so far or, where the curve moves, only the latest, to which it applies."""
    if curve_is_constant(flight.scenario):
        return _from_the_start()
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-MOVING_TRAIL_TIME),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )


def _from_the_start() -> rrb.VisibleTimeRanges:
    """Show everything logged so far, not just the latest segment."""
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rr.TimeRangeBoundary.infinite(),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )
