"""The blueprint: which views a recording opens with, and where they stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tiltsim.views.attitude_plane import MOVING_TRAIL_TIME
from tiltsim.views.rerun.names import TIMELINE
from tiltsim.views.rerun.plane import BOUND

if TYPE_CHECKING:
    import rerun.blueprint as rrb

    from tiltsim.views.rerun.series import Panel


@dataclass(frozen=True)
class Shown:
    """What the blueprint must know of a flight."""

    name: str
    world: str  # entities
    vehicle: str
    camera: str
    floor: str
    plane: str  # empty where there is none
    curve_is_constant: bool  # whether its curve stays where it is
    panels: tuple[Panel, ...]
    eye: tuple[float, float, float]  # seen from the vehicle, in radii of it
    up: tuple[float, float, float]
    overview: tuple[float, float, float] | None  # m, from where the whole reference is seen
    radius: float  # m
    thrust_scale: float  # m/N
    ground: float  # m


def flight_blueprint(flights: list[Shown], *, live: bool = False) -> rrb.Blueprint:
    """Vehicle, trajectory, roll-pitch plane and events on the left, time series on the right."""
    import rerun.blueprint as rrb

    vehicle, trajectory, events = _vehicle_view(flights), _trajectory_view(flights), _events_view()
    if flights[0].plane:
        views = rrb.Horizontal(vehicle, _plane_view(flights), column_shares=[5, 4])
        below = rrb.Horizontal(trajectory, events, column_shares=[5, 4])
        left = rrb.Vertical(views, below, row_shares=[11, 8])
    else:
        views = rrb.Horizontal(vehicle, trajectory, column_shares=[1, 1])
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


def _vehicle_view(flights: list[Shown]) -> Any:
    """The vehicle from near by; the camera goes with it but does not turn."""
    import rerun.blueprint as rrb

    first = flights[0]
    return rrb.Spatial3DView(
        origin=first.camera,
        contents=[f"{flight.world}/**" for flight in flights],
        name=f"Vehicle (thrust arrows: {100.0 * first.thrust_scale:g} cm per newton)",
        eye_controls=rrb.EyeControls3D(
            position=[first.radius * part for part in first.eye],
            look_target=(0.0, 0.0, 0.15 * first.radius),
            eye_up=first.up,
        ),
        line_grid=False,
        overrides=_trails(flights),
    )


def _trajectory_view(flights: list[Shown]) -> Any:
    """The whole paths of all vehicles and references."""
    import rerun.blueprint as rrb

    contents = []
    for flight in flights:
        contents += [f"{flight.world}/trail", f"{flight.world}/reference/**"]
        contents += [f"{flight.vehicle}/**", f"{flight.camera}/**"]
    return rrb.Spatial3DView(
        origin="world",
        contents=contents,
        name="Trajectory and reference",
        eye_controls=_from_above(flights[0]),
        line_grid=_grid(flights[0].ground),
        overrides=_trails(flights),
    )


def _from_above(flight: Shown) -> Any:
    """A camera straight above the reference, for what moves in a plane."""
    import rerun.blueprint as rrb

    if flight.overview is None:
        return None
    x, y, _ = flight.overview
    return rrb.EyeControls3D(
        position=flight.overview, look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0)
    )


def _plane_view(flights: list[Shown]) -> Any:
    import rerun.blueprint as rrb

    return rrb.Spatial2DView(
        origin="plane",
        name="Attitude (shaded: unacceptable attitudes)",
        visual_bounds=rrb.VisualBounds2D(x_range=(-BOUND, BOUND), y_range=(-BOUND, BOUND)),
        overrides={f"{flight.plane}/trail": _attitude_trail(flight) for flight in flights},
    )


def _events_view() -> Any:
    import rerun.blueprint as rrb

    return rrb.TextLogView(
        origin="events",
        name="Events",
        columns=rrb.TextLogColumns(
            timeline_columns=[TIMELINE],
            text_log_columns=["Body"],  # colours tell the levels
        ),
    )


def _plots(flights: list[Shown]) -> tuple[list[Any], list[float]]:
    """The time series and their heights; of several flights what they are compared by.

    Flights keep their colours, so one legend will do; long names would hide half of every plot.
    """
    panels = flights[0].panels
    if len(flights) == 1:
        whole = [(panel.title, [f"{panel.path}/**"]) for panel in panels]
        return [_plot(*plot) for plot in whole], [panel.height for panel in panels]
    import rerun as rr

    parts = [rr.escape_entity_path_part(flight.name) for flight in flights]
    plots: list[Any] = []
    for panel in panels:
        levels = [f"{parts[0]}/{panel.path}/{level}" for level in panel.levels]
        for series, title in panel.compared:
            lines = [f"{part}/{panel.path}/{series}" for part in parts]
            plots.append(_plot(title, [*lines, *levels], legend=not plots))
    return plots, [1.0] * len(plots)


def _plot(title: str, contents: list[str], *, legend: bool = True) -> Any:
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=title,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend("RightTop", visible=legend),
    )


def _grid(height: float) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    plane = rr.encodings.Plane3D(normal=(0.0, 0.0, 1.0), distance=height)
    return rrb.LineGrid3D(visible=True, spacing=1.0, plane=plane)


def _trails(flights: list[Shown]) -> dict[str, Any]:
    return {f"{flight.world}/trail": _from_the_start() for flight in flights}


def _attitude_trail(flight: Shown) -> Any:
    """All attitudes so far, or the latest: earlier ones were among other unacceptable ones."""
    import rerun as rr
    import rerun.blueprint as rrb

    if flight.curve_is_constant:
        return _from_the_start()
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-MOVING_TRAIL_TIME),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )


def _from_the_start() -> Any:
    """Show all that has been drawn so far, not just the latest stretch."""
    import rerun as rr
    import rerun.blueprint as rrb

    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rr.TimeRangeBoundary.infinite(),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )
