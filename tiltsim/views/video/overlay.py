"""The text over the frames of a video, and the roll-pitch plane in their corner."""

from typing import Any, Final

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw

from tiltsim.flight.flight import Flight
from tiltsim.views import attitude_plane
from tiltsim.views.figures import style
from tiltsim.views.signals import has_attitude_plane
from tiltsim.views.video.offscreen import Caption, Image
from tiltsim_controllers.mathematics.scalar import Floats

INSET_SHARE: Final = 0.32  # of the frame's height
GAP_SHARE: Final = 0.025
OPACITY: Final = 0.88
GROUND: Final = (250, 250, 250)
UNREACHABLE: Final = tuple(bytes.fromhex(style.UNREACHABLE[1:]))  # the color of the figures
CURVE: Final = (213, 94, 0)
GRID: Final = (212, 216, 220)
FRAME: Final = (70, 78, 86)
TRAIL: Final = (90, 160, 210)
ATTITUDE: Final = (0, 90, 150)


class Overlay:
    """Drawings over the frames of one flight, by the columns that it has."""

    def __init__(self, flight: Flight, height: int) -> None:
        """Prepare frames of a height (pixels)."""
        self._flight = flight
        self._inset = round(INSET_SHARE * height) if has_attitude_plane(flight.assembly) else 0
        self.caption = Caption("", 0, 0)
        if self._inset:
            vehicle = flight.scenario.rotorcraft.resolve()
            self._n = attitude_plane.torque_free_directions(flight.columns, vehicle)
            self._attitude = np.stack([flight["roll"], flight["pitch"]], axis=1)
            self._gap = gap = round(GAP_SHARE * height)
            self.caption = Caption("shaded: unreachable", gap, self._inset + gap)

    def rows(self, sample: int) -> dict[str, str]:
        """Rows of the frame's table but time and position error."""
        now = {name: float(column[sample]) for name, column in self._flight.columns.items()}
        rows = {}
        if "singularity_margin" in now:
            rows["singularity margin"] = f"{abs(now['singularity_margin']):.2f} rad"
        if "roll" in now:
            rows["roll, pitch"] = f"{now['roll']:+.2f}, {now['pitch']:+.2f} rad"
        if "direction" in now:
            squares = (now[f"rotor_speed_{rotor}"] ** 2 for rotor in (1, 2))
            rows["rotor speeds squared"] = ", ".join(f"{each:.0f}" for each in squares) + " rad2/s2"
            rows["direction error"] = f"{now['direction_ref'] - now['direction']:+.2f} rad"
        return rows

    def paint(self, image: Image, sample: int) -> None:
        """Paint the roll-pitch plane, if there is one, over the frame of a sample, in place."""
        if not self._inset:
            return
        start, flight = 0, self._flight
        if not attitude_plane.curve_is_constant(flight.scenario):
            time = flight["time"]
            start = int(np.searchsorted(time, time[sample] - attitude_plane.MOVING_TRAIL_TIME))
        # From an even sample on, so that the trail does not shimmer.
        trail = self._attitude[start - start % 2 : sample + 1 : 2]
        trail = np.concatenate([trail, self._attitude[sample : sample + 1]])
        margin = flight["singularity_margin"]
        near = abs(margin[sample]) < attitude_plane.MARGIN_THRESHOLD
        inset = plane(
            self._inset, self._n[sample], attitude_plane.side_of(margin), trail, near=near
        )
        overlay_inset(image, inset, self._gap)


def plane(size: int, n: Floats, side: float, trail: Floats, *, near: bool) -> Image:
    """The roll-pitch plane at an instant, shape (size, size, 3), pitch upwards.

    Args:
        size: Width and height, pixels.
        n: The unit vector along the torque-free force, shape (3,).
        side: The sign of the margin at reachable attitudes, see `side_of`.
        trail: The attitudes (roll, pitch) until now, rad, shape (N, 2).
        near: Whether the attitude is close to a singular one.
    """
    picture = Pillow.new("RGB", (size, size), GROUND)
    pen = ImageDraw.Draw(picture)
    end = size - 1

    def pixels(attitude: Floats) -> Any:
        """Columns and rows of attitudes; those outside the plane are moved to its edge."""
        shares = 0.5 + 0.5 * np.clip(attitude / attitude_plane.HALF_WIDTH, -1.0, 1.0) * (1.0, -1.0)
        return [tuple(place) for place in (shares * end).round().tolist()]

    roll = np.linspace(-attitude_plane.HALF_WIDTH, attitude_plane.HALF_WIDTH, 91)
    low, high = attitude_plane.unreachable_pitch(n[np.newaxis], side, roll)[0].T
    if (high > low).any():
        outline = np.concatenate([np.stack([roll, low], 1), np.stack([roll, high], 1)[::-1]])
        pen.polygon(pixels(outline), fill=UNREACHABLE)
    for line in (round(share * end) for share in (0.25, 0.5, 0.75)):
        pen.line([(0, line), (end, line)], fill=GRID)
        pen.line([(line, 0), (line, end)], fill=GRID)
    curve = attitude_plane.singular_curves(n[np.newaxis])[0]
    if np.isfinite(curve).all():
        pen.line(pixels(curve), fill=CURVE, width=2)
    if len(trail) > 1:
        pen.line(pixels(trail), fill=TRAIL, width=2)
    ((x, y),) = pixels(trail[-1:])
    radius = size / 36
    box = (x - radius, y - radius, x + radius, y + radius)
    pen.ellipse(box, fill=CURVE if near else ATTITUDE)
    pen.rectangle((0, 0, end, end), outline=FRAME)
    return np.asarray(picture)


def overlay_inset(frame: Image, inset: Image, gap: int) -> None:
    """Paint an inset over the lower right corner of a frame, in place, with a gap (pixels)."""
    height, width = inset.shape[:2]
    corner = frame[-gap - height : -gap, -gap - width : -gap]
    corner[:] = (OPACITY * inset + (1.0 - OPACITY) * corner).astype(np.uint8)
