"""The roll-pitch plane: what attitudes the gait leaves, and where the vehicle is among them.

Rerun's two-dimensional views count downwards, so pitch is drawn with its sign reversed: up is up.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from tiltsim.views.attitude_plane import (
    HALF_WIDTH,
    MARGIN_THRESHOLD,
    nearest_singular,
    singular_curves,
    torque_free_directions,
    unreachable_pitch,
)
from tiltsim.views.rerun import palette
from tiltsim.views.rerun.rows import Ticks, send_rows
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import rerun as rr

    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.views.rerun.palette import Color

CURVE_INTERVAL: Final = 0.05  # s between drawings of a gait that moves
ATTITUDE_TRAIL_INTERVAL: Final = 0.05  # s
SMALLEST_TURN: Final = 0.005
"""The curve is drawn anew when ``n`` has turned by this much (rad)."""

STRIPES: Final = 48
"""Upright stripes that paint the forbidden ground."""

STRIPE_RADIUS: Final = 0.55 * pi / STRIPES
"""Half the width of a stripe, a little more than would do, to leave no gaps."""

BOUND: Final = HALF_WIDTH * 1.28
"""Half width of the view: the plane and its labels."""


class AttitudePlane:
    """The entities below ``plane`` for one flight, ``among_others`` where several are compared."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        scenario: Scenario,
        root: str,
        color: Color,
        among_others: bool = False,
    ) -> None:
        self._recording = recording
        self._vehicle = scenario.rotorcraft.resolve()
        self._root = root
        self._color = color
        self._labelled = not among_others  # labels of several would hide each other
        self._curve_ticks = Ticks(CURVE_INTERVAL)
        self._trail_ticks = Ticks(ATTITUDE_TRAIL_INTERVAL)
        self._drawn: Floats | None = None  # the unit vector along n that the curve shows
        self._side = 0.0
        self._trail_end: Floats | None = None

    def begin(self, *, paints: bool) -> None:
        """Log styles; ``paints`` whether this flight also draws the axes and forbidden ground."""
        import rerun as rr

        self._paints = paints
        if paints:
            log_axes(self._recording, self._root.partition("/")[0])
        styles = {
            "forbidden": rr.LineStrips2D.from_fields(
                colors=[palette.FORBIDDEN], radii=[STRIPE_RADIUS], draw_order=-20.0
            ),
            "curve": rr.LineStrips2D.from_fields(
                colors=[palette.RED if paints else self._color],
                radii=[-2.0],
                draw_order=1.5 if paints else 1.0,  # on its ground also where others are the same
            ),
            "margin": rr.LineStrips2D.from_fields(radii=[-1.2], draw_order=2.0),
            "trail": rr.LineStrips2D.from_fields(
                colors=[palette.dimmed(self._color, 0.8)], radii=[-1.0], draw_order=3.0
            ),
            "attitude": rr.Points2D.from_fields(colors=[self._color], radii=[-6.0], draw_order=4.0),
        }
        for name, style in styles.items():
            self._recording.log(f"{self._root}/{name}", style, static=True)

    def append(self, piece: Flight) -> None:
        """Log the rows of a piece of the flight that follows on from the last."""
        import rerun as rr

        time, margin = piece["time"], piece["singularity_margin"]
        if self._side == 0.0:
            self._side = float(np.sign(margin[0])) or 1.0
        n = torque_free_directions(piece.columns, self._vehicle)
        self._append_curves(time, n)
        attitude = np.stack([piece["roll"], piece["pitch"]], axis=1)
        labels = margin_labels(margin) if self._labelled else None
        points = rr.Points2D.columns(positions=on_screen(attitude), labels=labels)
        self._send("attitude", time, points)
        reach = np.stack([attitude, nearest_singular(n, attitude)], axis=1)
        near = np.abs(margin) < MARGIN_THRESHOLD
        colors = np.where(near[:, np.newaxis], palette.RED, palette.GREY).astype(np.uint8)
        lines = rr.LineStrips2D.columns(strips=on_screen(clipped(reach)), colors=colors)
        self._send("margin", time, lines)
        self._append_trail(time, attitude)

    def _send(self, name: str, times: Floats, *columns: Any) -> None:
        send_rows(self._recording, f"{self._root}/{name}", times, *columns)

    def _append_trail(self, time: Floats, attitude: Floats) -> None:
        import rerun as rr

        picked = self._trail_ticks.pick(time)
        if len(picked) == 0:
            return
        ends = attitude[picked]
        start = ends[:1] if self._trail_end is None else self._trail_end[np.newaxis]
        stretches = np.stack([np.concatenate([start, ends[:-1]]), ends], axis=1)
        strips = rr.LineStrips2D.columns(strips=on_screen(stretches))
        self._send("trail", time[picked], strips)
        self._trail_end = ends[-1]

    def _append_curves(self, time: Floats, n: Floats) -> None:
        """Draw the curve and the ground beyond it where the gait has moved."""
        picked = self._turned(self._curve_ticks.pick(time), n)
        if len(picked) == 0:
            return
        time, n = time[picked], n[picked]
        curves = on_screen(singular_curves(n))
        exist = np.isfinite(curves).all(axis=(1, 2))
        self._send("curve", time, _strips(curves[exist], exist.astype(int)))
        if self._paints:
            self._send("forbidden", time, _strips(*forbidden_stripes(n, self._side)))

    def _turned(self, picked: Any, n: Floats) -> list[int]:
        """Of the picked samples those whose ``n`` points elsewhere than the one drawn last."""
        turned = []
        for sample in picked.tolist():
            if self._drawn is None or np.linalg.norm(n[sample] - self._drawn) > SMALLEST_TURN:
                self._drawn = n[sample]
                turned.append(sample)
        return turned


def on_screen(attitude: Floats) -> Any:
    """Points (roll, pitch) in rad where the view draws them."""
    return (attitude * (1.0, -1.0)).astype(np.float32)


def margin_labels(margin: Floats) -> list[str]:
    """The margin in words, one label a sample."""
    return [f"margin {value:.2f} rad" for value in np.abs(margin).tolist()]


def forbidden_stripes(n: Floats, side: float) -> tuple[Any, npt.NDArray[np.int_]]:
    """Stripes that fill the ground out of reach, shape (M, 2, 2), and how many each instant has."""
    width = pi / STRIPES
    roll = np.asarray(width * (np.arange(STRIPES) + 0.5) - HALF_WIDTH, dtype=np.float64)
    # Stripes have round ends, which must not stand out beyond the ground they fill.
    intervals = unreachable_pitch(n, side, roll) + np.array((STRIPE_RADIUS, -STRIPE_RADIUS))
    ends = np.stack([np.broadcast_to(roll[:, np.newaxis], intervals.shape), intervals], axis=-1)
    filled = intervals[..., 1] > intervals[..., 0]
    return on_screen(ends[filled]), np.count_nonzero(filled, axis=1)


def clipped(lines: Floats) -> Floats:
    """Lines, shape (N, 2, 2), cut off where they leave the plane."""
    start, end = lines[:, 0], lines[:, 1]
    way = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = (np.sign(way) * HALF_WIDTH - start) / way
    share = np.nanmin(np.where(way == 0.0, 1.0, shares), axis=1)
    return np.stack([start, start + np.clip(share, 0.0, 1.0)[:, np.newaxis] * way], axis=1)


def log_axes(recording: rr.RecordingStream, root: str) -> None:
    """Log frame, level lines and labels of the plane."""
    import rerun as rr

    names = {-2: "-π/2", -1: "-π/4", 0: "0", 1: "π/4", 2: "π/2"}
    ticks = np.array(list(names)) * pi / 4
    inner = [[(t, -HALF_WIDTH), (t, HALF_WIDTH)] for t in ticks]
    inner += [[(-HALF_WIDTH, t), (HALF_WIDTH, t)] for t in ticks]
    grid = rr.LineStrips2D(inner, colors=[palette.FAINT], radii=[-0.5], draw_order=-10.0)
    recording.log(f"{root}/axes/grid", grid, static=True)
    off = HALF_WIDTH * 1.10
    places = [*((t, off * 0.97) for t in ticks), *((-off, -t - 0.1) for t in ticks)]
    labels = [*names.values(), *names.values()]
    places += [(0.0, HALF_WIDTH * 1.22), (-HALF_WIDTH * 0.9, -HALF_WIDTH * 1.19)]
    labels += ["roll (rad)", "pitch (rad)"]
    text = rr.Points2D(
        places, labels=labels, colors=[palette.GREY], radii=[0.0], show_labels=True, draw_order=0.0
    )
    recording.log(f"{root}/axes/labels", text, static=True)


def _strips(strips: Any, counts: npt.NDArray[np.int_]) -> Any:
    """Columns of an entity that shows so many of the strips, shape (M, points, 2), at each time."""
    import rerun as rr

    return rr.LineStrips2D.columns(strips=strips).partition(counts)
