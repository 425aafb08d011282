"""Writing one flight into a recording: static data first, then its rows, then its end.

The y axis of Rerun's two-dimensional views points down, so that the roll-pitch plane is drawn with
the sign of pitch reversed.
"""

import re
from collections.abc import Iterator, Sequence
from itertools import product
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import rerun as rr

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.scenario.scenario import Scenario
from tiltsim.views.attitude_plane import (
    HALF_WIDTH,
    MARGIN_THRESHOLD,
    nearest_singular,
    side_of,
    singular_curves,
    torque_free_directions,
    unreachable_pitch,
)
from tiltsim.views.rerun import timeline
from tiltsim.views.rerun.scene import Scene
from tiltsim.views.rerun.timeline import Color, Ticks, Trail, dimmed, send_rows
from tiltsim.views.signals import Signal, Signals, has_attitude_plane, signals_of
from tiltsim.views.titles import Event, EventDetector
from tiltsim_controllers.mathematics.scalar import Floats

MEASURED_WIDTH: Final = 1.8
REFERENCE_WIDTH: Final = 1.0
LEVEL_WIDTH: Final = 1.2
AXIS_COLORS: Final = (timeline.RED, timeline.GREEN, timeline.SKY)
MANY_COLORS: Final = (
    timeline.AMBER,
    timeline.SKY,
    timeline.PINK,
    timeline.GREEN,
    timeline.YELLOW,
    timeline.RED,
)
MANY_WIDTHS: Final = (4.0, 3.0, 2.0, 1.2)  # lines of equal angles and speeds would cover each other

INTERVAL: Final = 0.05  # s between curves of a moving gait, and between points of the trail
MIN_ROTATION: Final = 0.005  # rotation of ``n`` (rad) above which the curve is drawn again
STRIPES: Final = 48  # vertical ones, which fill the unreachable region
STRIPE_RADIUS: Final = 0.55 * pi / STRIPES  # they overlap a little, so that they leave no gaps
BOUND: Final = HALF_WIDTH * 1.48  # half width of the view: the plane and its labels
_EVENT_COLORS: Final = {"INFO": timeline.GREY, "WARN": timeline.AMBER, "ERROR": timeline.RED}


class Line(NamedTuple):
    """A line of a plot."""

    label: str
    signal: Signal
    color: Color
    width: float = MEASURED_WIDTH


def plotted_lines(panel: Signals) -> Iterator[Line]:
    """The lines of a panel of one flight, each followed by its reference, and the bounds."""
    many = len(panel.lines) > len(AXIS_COLORS) or panel.lines[0].name[-1:].isdigit()
    hues = MANY_COLORS if many or panel.levels or panel.bounds else AXIS_COLORS
    colors: Sequence[Color] = timeline.FLIGHTS if panel.of_vehicles else hues
    # The title of a vector says the rest.
    vector = len(panel.lines) > 1 and not (panel.plotted or panel.of_vehicles)
    for number, line in enumerate(panel.lines):
        color = colors[number % len(colors)]
        width = MANY_WIDTHS[min(number, len(MANY_WIDTHS) - 1)] if many else MEASURED_WIDTH
        label = re.findall(r"\d+$|.$", line.name)[0] if vector else line.label
        yield Line(label, line, color, width if panel.plotted else REFERENCE_WIDTH)
        if line.reference:
            reference = Signal("", "", line.reference)
            yield Line("reference", reference, dimmed(color), REFERENCE_WIDTH)
    for bound in panel.bounds:
        yield Line("bound", Signal("", "", bound), dimmed(timeline.AMBER), REFERENCE_WIDTH)


class FlightRecorder:
    """Writes one flight into a recording.

    It writes the static data at once. Call `draw_references` once, `append` with pieces of the
    flight in order, and `finish`.

    Args:
        recording: The recording to write to.
        assembly: The assembly of the flight.
        name: The flight's name among several, or the vehicle's; empty for a single one.
        colors: The flight's color, and its companions'.
        first: Whether it also draws the entities that all flights share.
        together: Whether it is one vehicle of a flight with several, in the scene of the first.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        assembly: Assembly,
        name: str,
        colors: Sequence[Color],
        first: bool,
        *,
        together: bool = False,
    ) -> None:
        color = colors[0]
        part = rr.escape_entity_path_part(name) if name else ""
        suffix = f"/{part}" if name else ""
        self.name = name
        self.part = part
        self.scenario = assembly.scenario
        self.assembly = assembly
        self.signals = signals_of(assembly)
        self.details = f"{part}/signals/" if together else ""
        self.scene: Scene | None = None
        if first or not together:
            self.scene = Scene(recording, assembly, f"world{suffix}", colors, name)
        self.plane = None
        if has_attitude_plane(assembly):
            self.plane = AttitudePlane(recording, self.scenario, f"plane{suffix}", color)
        self._plots: dict[str, list[Line]] = {}  # by their entities
        for panel in self.signals.values():
            for line in panel.compared if name else ():
                self._plots[f"{part}/{panel.path}/{line.name}"] = [Line(name, line, color)]
            if together or not name:
                self._plots[f"{self.details}{panel.path}"] = [*plotted_lines(panel)]
        # The entities of levels: in a comparison the first flight's.
        roots = {f"{part}/".lstrip("/")} if first else set()
        self._level_roots = sorted(roots | {self.details} if together else roots)
        self._recording = recording
        self._events = EventDetector(assembly)
        self._event_path = f"events{suffix}"
        for path, lines in self._plots.items():
            labels, _, hues, widths = zip(*lines, strict=True)
            self._log_style(path, labels, hues, widths)
        self._log_events(self._events.opening())
        if self.scene is not None and self.scene.not_drawn:
            text = f"not drawn, because Rerun has no such shape: {', '.join(self.scene.not_drawn)}"
            self._log_events([Event(0.0, "WARN", text)])

    def draw_references(self, end: float) -> None:
        """Log the path of the reference and the levels of the plots up to a time (s)."""
        if self.scene is not None:
            self.scene.draw_references(end)
        levels = [(panel.path, level) for panel in self.signals.values() for level in panel.levels]
        for root, (panel, level) in product(self._level_roots, levels):
            path = f"{root}{panel}/{level.name}"
            color = timeline.RED if level.value else timeline.GREY
            self._log_style(path, [level.label], [color], [LEVEL_WIDTH])
            row = rr.Scalars.columns(scalars=[level.value, level.value])
            send_rows(self._recording, path, np.array([0.0, end]), row)

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        if self.scene is not None:
            self.scene.append(piece)
        if self.plane is not None:
            self.plane.append(piece)
        for path, lines in self._plots.items():
            values = np.stack([line.signal.of(piece) for line in lines], axis=1)
            rows = rr.Scalars.columns(scalars=values.ravel()).partition([len(lines)] * len(piece))
            send_rows(self._recording, path, piece["time"], rows)
        self._log_events(self._events.observe(piece))

    def finish(self, end: End) -> None:
        """Log how the flight ended."""
        self._log_events(self._events.closing(end))

    def _log_style(
        self, path: str, labels: Sequence[str], colors: Sequence[Color], widths: Sequence[float]
    ) -> None:
        style = rr.SeriesLines(names=labels, colors=colors, widths=widths)
        self._recording.log(path, style, static=True)

    def _log_events(self, events: list[Event]) -> None:
        prefix = f"{self.name}: " if self.name else ""
        rows = rr.TextLog.columns(
            text=[prefix + event.text for event in events],
            level=[event.level for event in events],
            color=[_EVENT_COLORS[event.level] for event in events],
        )
        send_rows(self._recording, self._event_path, np.array([e.time for e in events]), rows)


class AttitudePlane:
    """The entities below ``plane`` for one flight.

    Args:
        recording: The recording to write to.
        scenario: The scenario of the flight, of a rotorcraft.
        root: The entity of the plane.
        color: The flight's color.
    """

    def __init__(
        self, recording: rr.RecordingStream, scenario: Scenario, root: str, color: Color
    ) -> None:
        self._recording = recording
        self._vehicle = scenario.rotorcraft.resolve()
        self._color = color
        self.root = root
        self._side = 0.0  # of the margin at the start; unknown before
        self._curve_ticks = Ticks(INTERVAL)
        self._trail = Trail(INTERVAL)
        self._drawn: Floats | None = None
        self._log_styles()

    def _log_styles(self) -> None:
        lines, trail = rr.LineStrips2D.from_fields, timeline.dimmed(self._color, 0.8)
        shade = timeline.UNREACHABLE
        styles = {
            "forbidden": lines(colors=[shade], radii=[STRIPE_RADIUS], draw_order=-5.0),
            "curve": lines(colors=[timeline.RED], radii=[-2.0], draw_order=1.0),
            "margin": lines(radii=[-1.2], draw_order=2.0),
            "trail": lines(colors=[trail], radii=[-1.0], draw_order=3.0),
            "attitude": rr.Points2D.from_fields(colors=[self._color], radii=[-6.0], draw_order=4.0),
        }
        names = {-2: "-π/2", -1: "", 0: "0", 1: "", 2: "π/2"}
        ticks = np.array([*names]) * pi / 4
        grid = [[(t, -HALF_WIDTH), (t, HALF_WIDTH)] for t in ticks]
        grid += [[(-HALF_WIDTH, t), (HALF_WIDTH, t)] for t in ticks]
        look: dict[str, Any] = {"colors": [timeline.FAINT], "radii": [-0.5], "draw_order": -10.0}
        styles["axes/grid"] = rr.LineStrips2D(grid, **look)
        edge, shown = HALF_WIDTH * 1.1, [tick for tick, name in zip(ticks, names.values()) if name]
        places = [*((t, edge * 0.98) for t in shown), *((-edge, -t - 0.1) for t in shown)]
        places += [(0.0, HALF_WIDTH * 1.3), (-0.4 * HALF_WIDTH, -HALF_WIDTH * 1.2)]
        labels = [name for name in names.values() if name]
        look = {"colors": [timeline.GREY], "radii": [0.0], "show_labels": True, "draw_order": 0.0}
        words = [*labels, *labels, "roll (rad)", "pitch (rad)"]
        styles["axes/labels"] = rr.Points2D(places, labels=words, **look)
        for name, style in styles.items():
            self._recording.log(f"{self.root}/{name}", style, static=True)

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        time, margin = piece["time"], piece["singularity_margin"]
        self._side = self._side or side_of(margin)
        n = torque_free_directions(piece.columns, self._vehicle)
        self._append_curves(time, n)
        attitude = np.stack([piece["roll"], piece["pitch"]], axis=1)
        labels = [f"margin {value:.2f} rad" for value in np.abs(margin).tolist()]
        points = rr.Points2D.columns(positions=on_screen(attitude), labels=labels)
        self._send("attitude", time, points)
        to_nearest = clip_to_plane(np.stack([attitude, nearest_singular(n, attitude)], axis=1))
        near = np.abs(margin) < MARGIN_THRESHOLD
        colors = np.where(near[:, np.newaxis], timeline.RED, timeline.GREY).astype(np.uint8)
        lines = rr.LineStrips2D.columns(strips=on_screen(to_nearest), colors=colors)
        self._send("margin", time, lines)
        ends, segments = self._trail.extend(time, attitude)
        if len(ends):
            self._send("trail", ends, rr.LineStrips2D.columns(strips=on_screen(segments)))

    def _send(self, name: str, times: Floats, *columns: Any) -> None:
        send_rows(self._recording, f"{self.root}/{name}", times, *columns)

    def _append_curves(self, time: Floats, n: Floats) -> None:
        """Draw the curve and the region beyond it at the times at which the gait has moved."""
        picked = []
        for sample in self._curve_ticks.pick(time).tolist():
            if self._drawn is None or np.linalg.norm(n[sample] - self._drawn) > MIN_ROTATION:
                self._drawn = n[sample]
                picked.append(sample)
        if picked:
            time, n = time[picked], n[picked]
            curves = on_screen(singular_curves(n))
            exist = np.isfinite(curves).all(axis=(1, 2))
            stripes, counts = unreachable_stripes(n, self._side)
            columns = rr.LineStrips2D.columns
            self._send("curve", time, columns(strips=curves[exist]).partition(exist.astype(int)))
            self._send("forbidden", time, columns(strips=stripes).partition(counts))


def on_screen(attitude: Floats) -> npt.NDArray[np.float32]:
    """View coordinates of attitudes (roll, pitch in rad), shape (..., 2)."""
    return (attitude * (1.0, -1.0)).astype(np.float32)


def unreachable_stripes(
    n: Floats, side: float
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int_]]:
    """Stripes that fill the unreachable region, shape (M, 2, 2), and their number per sample.

    See `tiltsim.views.attitude_plane.unreachable_pitch` for the arguments.
    """
    roll = np.asarray(pi / STRIPES * (np.arange(STRIPES) + 0.5) - HALF_WIDTH, np.float64)
    # Stripes have round ends, which must not extend beyond the region.
    intervals = unreachable_pitch(n, side, roll) + np.array((STRIPE_RADIUS, -STRIPE_RADIUS))
    ends = np.stack([np.broadcast_to(roll[:, np.newaxis], intervals.shape), intervals], axis=-1)
    filled = intervals[..., 1] > intervals[..., 0]
    return on_screen(ends[filled]), np.count_nonzero(filled, axis=1)


def clip_to_plane(lines: Floats) -> Floats:
    """Line segments, shape (N, 2, 2), cut off at the border of the plane."""
    start, step = lines[:, 0], lines[:, 1] - lines[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        fractions = (np.sign(step) * HALF_WIDTH - start) / step
    inside = np.nanmin(np.where(step == 0.0, 1.0, fractions), axis=1)
    return np.stack([start, start + np.clip(inside, 0.0, 1.0)[:, np.newaxis] * step], axis=1)
