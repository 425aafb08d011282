"""The roll-pitch plane: the reachable attitudes of the gait and the attitude of the vehicle.

The y axis of Rerun's two-dimensional views points down, so pitch is drawn with its sign reversed.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr

from tiltsim.views.attitude_plane import (
    HALF_WIDTH,
    MARGIN_THRESHOLD,
    nearest_singular,
    singular_curves,
    torque_free_directions,
    unreachable_pitch,
)
from tiltsim.views.rerun import palette
from tiltsim.views.rerun.timeline import Ticks, Trail, send_rows
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.views.rerun.palette import Color

CURVE_INTERVAL: Final = 0.05  # s between curves of a moving gait
ATTITUDE_TRAIL_INTERVAL: Final = 0.05  # s
MIN_ROTATION: Final = 0.005
"""Rotation of ``n`` (rad) above which the curve is drawn again."""

STRIPES: Final = 48
"""Vertical stripes that fill the unreachable region."""

STRIPE_RADIUS: Final = 0.55 * pi / STRIPES
"""Half the width of a stripe; the stripes overlap a little, so that they leave no gaps."""

BOUND: Final = HALF_WIDTH * 1.28
"""Half width of the view: the plane and its labels."""


class AttitudePlane:
    """The entities below ``plane`` for one flight.

    Args:
        recording: The recording to write to.
        scenario: The scenario of the flight, of a rotorcraft.
        root: The entity of the plane.
        color: The flight's colour.
    """

    def __init__(
        self, recording: rr.RecordingStream, scenario: Scenario, root: str, color: Color
    ) -> None:
        self._recording = recording
        self._vehicle = scenario.rotorcraft.resolve()
        self.root = root
        self._color = color
        self._curve_ticks = Ticks(CURVE_INTERVAL)
        self._trail = Trail(ATTITUDE_TRAIL_INTERVAL)
        self._drawn: Floats | None = None  # the unit vector along n of the current curve
        self._side = 0.0

    def begin(self) -> None:
        """Log axes and styles."""
        log_axes(self._recording, self.root)
        styles = {
            "forbidden": rr.LineStrips2D.from_fields(
                colors=[palette.UNREACHABLE], radii=[STRIPE_RADIUS], draw_order=-20.0
            ),
            "curve": rr.LineStrips2D.from_fields(
                colors=[palette.RED], radii=[-2.0], draw_order=1.0
            ),
            "margin": rr.LineStrips2D.from_fields(radii=[-1.2], draw_order=2.0),
            "trail": rr.LineStrips2D.from_fields(
                colors=[palette.dimmed(self._color, 0.8)], radii=[-1.0], draw_order=3.0
            ),
            "attitude": rr.Points2D.from_fields(colors=[self._color], radii=[-6.0], draw_order=4.0),
        }
        for name, style in styles.items():
            self._recording.log(f"{self.root}/{name}", style, static=True)

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        time, margin = piece["time"], piece["singularity_margin"]
        if self._side == 0.0:
            self._side = float(np.sign(margin[0])) or 1.0
        n = torque_free_directions(piece.columns, self._vehicle)
        self._append_curves(time, n)
        attitude = np.stack([piece["roll"], piece["pitch"]], axis=1)
        points = rr.Points2D.columns(positions=on_screen(attitude), labels=margin_labels(margin))
        self._send("attitude", time, points)
        to_nearest = np.stack([attitude, nearest_singular(n, attitude)], axis=1)
        near = np.abs(margin) < MARGIN_THRESHOLD
        colors = np.where(near[:, np.newaxis], palette.RED, palette.GREY).astype(np.uint8)
        lines = rr.LineStrips2D.columns(strips=on_screen(clip_to_plane(to_nearest)), colors=colors)
        self._send("margin", time, lines)
        ends, segments = self._trail.extend(time, attitude)
        if len(ends):
            self._send("trail", ends, rr.LineStrips2D.columns(strips=on_screen(segments)))

    def _send(self, name: str, times: Floats, *columns: Any) -> None:
        send_rows(self._recording, f"{self.root}/{name}", times, *columns)

    def _append_curves(self, time: Floats, n: Floats) -> None:
        """Draw the curve and the region beyond it at the times at which the gait has moved."""
        picked = self._moved(self._curve_ticks.pick(time), n)
        if len(picked) == 0:
            return
        time, n = time[picked], n[picked]
        curves = on_screen(singular_curves(n))
        exist = np.isfinite(curves).all(axis=(1, 2))
        self._send("curve", time, _strips(curves[exist], exist.astype(int)))
        self._send("forbidden", time, _strips(*unreachable_stripes(n, self._side)))

    def _moved(self, picked: npt.NDArray[np.intp], n: Floats) -> list[int]:
        """Those of the picked samples whose ``n`` differs from the one drawn before."""
        moved = []
        for sample in picked.tolist():
            if self._drawn is None or np.linalg.norm(n[sample] - self._drawn) > MIN_ROTATION:
                self._drawn = n[sample]
                moved.append(sample)
        return moved


def on_screen(attitude: Floats) -> npt.NDArray[np.float32]:
    """View coordinates of attitudes (roll, pitch in rad), shape (..., 2)."""
    return (attitude * (1.0, -1.0)).astype(np.float32)


def margin_labels(margin: Floats) -> list[str]:
    """One label per sample with its singularity margin (rad)."""
    return [f"margin {value:.2f} rad" for value in np.abs(margin).tolist()]


def unreachable_stripes(
    n: Floats, side: float
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int_]]:
    """Stripes that fill the unreachable region, shape (M, 2, 2), and their number per sample.

    See `tiltsim.attitude_plane.unreachable_pitch` for the arguments.
    """
    width = pi / STRIPES
    roll = np.asarray(width * (np.arange(STRIPES) + 0.5) - HALF_WIDTH, dtype=np.float64)
    # Stripes have round ends, which must not extend beyond the region.
    intervals = unreachable_pitch(n, side, roll) + np.array((STRIPE_RADIUS, -STRIPE_RADIUS))
    ends = np.stack([np.broadcast_to(roll[:, np.newaxis], intervals.shape), intervals], axis=-1)
    filled = intervals[..., 1] > intervals[..., 0]
    return on_screen(ends[filled]), np.count_nonzero(filled, axis=1)


def clip_to_plane(lines: Floats) -> Floats:
    """Line segments, shape (N, 2, 2), cut off at the border of the plane."""
    start, end = lines[:, 0], lines[:, 1]
    step = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        fractions = (np.sign(step) * HALF_WIDTH - start) / step
    inside = np.nanmin(np.where(step == 0.0, 1.0, fractions), axis=1)
    return np.stack([start, start + np.clip(inside, 0.0, 1.0)[:, np.newaxis] * step], axis=1)


def log_axes(recording: rr.RecordingStream, root: str) -> None:
    """Log frame, grid and labels of the plane below the entity ``root``."""
    names = {-2: "-π/2", -1: "-π/4", 0: "0", 1: "π/4", 2: "π/2"}
    ticks = np.array(list(names)) * pi / 4
    inner = [[(t, -HALF_WIDTH), (t, HALF_WIDTH)] for t in ticks]
    inner += [[(-HALF_WIDTH, t), (HALF_WIDTH, t)] for t in ticks]
    grid = rr.LineStrips2D(inner, colors=[palette.FAINT], radii=[-0.5], draw_order=-10.0)
    recording.log(f"{root}/axes/grid", grid, static=True)
    edge = HALF_WIDTH * 1.10
    positions = [*((t, edge * 0.97) for t in ticks), *((-edge, -t - 0.1) for t in ticks)]
    labels = [*names.values(), *names.values()]
    positions += [(0.0, HALF_WIDTH * 1.22), (-HALF_WIDTH * 0.9, -HALF_WIDTH * 1.19)]
    labels += ["roll (rad)", "pitch (rad)"]
    text = rr.Points2D(
        positions,
        labels=labels,
        colors=[palette.GREY],
        radii=[0.0],
        show_labels=True,
        draw_order=0.0,
    )
    recording.log(f"{root}/axes/labels", text, static=True)


def _strips(strips: Any, counts: npt.NDArray[np.int_]) -> Any:
    """Columns of an entity with ``counts`` of the strips, shape (M, points, 2), at each time."""
    return rr.LineStrips2D.columns(strips=strips).partition(counts)
