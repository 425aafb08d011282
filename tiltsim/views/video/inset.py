"""The roll-pitch plane as an inset: the unreachable attitudes and the vehicle's attitude."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from tiltsim.views.attitude_plane import HALF_WIDTH, MARGIN_THRESHOLD
from tiltsim.views.figures import style
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.mathematics.scalar import Floats

Image = npt.NDArray[np.uint8]

GROUND: Final = (250, 250, 250)
_RED, _GREEN, _BLUE = bytes.fromhex(style.UNREACHABLE[1:])
UNREACHABLE: Final = (_RED, _GREEN, _BLUE)
"""The colour of the figures."""
CURVE: Final = (213, 94, 0)
GRID: Final = (212, 216, 220)
FRAME: Final = (70, 78, 86)
TRAIL: Final = (90, 160, 210)
ATTITUDE: Final = (0, 90, 150)
OPACITY: Final = 0.88


class PlaneInset:
    """Paints the plane at single instants, ``size`` pixels wide and high.

    ``side`` is the sign of ``n . r3`` at reachable attitudes: that at the start of the flight.
    """

    def __init__(self, size: int, side: float) -> None:
        self.size = size
        self._side = side
        roll = np.linspace(-HALF_WIDTH, HALF_WIDTH, size)
        self._up = world_up(*np.meshgrid(roll, -roll))  # pitch upwards
        blank = np.full((size, size, 3), GROUND, dtype=np.uint8)
        for share in (0.25, 0.5, 0.75):
            line = round(share * (size - 1))
            blank[line], blank[:, line] = GRID, GRID
        self._blank = blank

    def paint(self, n: Floats, trail: Floats, margin: float) -> Image:
        """The plane at an instant, shape (size, size, 3).

        ``n`` is the unit vector along the torque-free force, shape (3,); ``trail`` are the
        attitudes (roll, pitch) until now, rad, shape (N, 2); ``margin`` is the margin, rad.
        """
        image = self._blank.copy()
        beyond = self._up @ n * self._side <= 0.0
        image[beyond] = np.minimum(image[beyond], UNREACHABLE)
        border = beyond ^ np.roll(beyond, 1, axis=0) | beyond ^ np.roll(beyond, 1, axis=1)
        border[0], border[:, 0] = False, False
        self._dots(image, np.argwhere(border)[:, ::-1], 1.2, CURVE)
        self._dots(image, self._pixels(trail), 0.8, TRAIL)
        color = CURVE if abs(margin) < MARGIN_THRESHOLD else ATTITUDE
        self._dots(image, self._pixels(trail[-1:]), self.size / 36, color)
        image[[0, -1]], image[:, [0, -1]] = FRAME, FRAME
        return image

    def _pixels(self, attitude: Floats) -> npt.NDArray[np.intp]:
        """Columns and rows of attitudes; those outside the plane are moved to its edge."""
        shares = 0.5 + 0.5 * np.clip(attitude / HALF_WIDTH, -1.0, 1.0) * (1.0, -1.0)
        return np.asarray((shares * (self.size - 1)).round(), dtype=np.intp)

    def _dots(
        self,
        image: Image,
        centres: npt.NDArray[np.intp],
        radius: float,
        color: tuple[int, int, int],
    ) -> None:
        extent = int(np.ceil(radius))
        offsets = np.arange(-extent, extent + 1)
        dx, dy = (part.ravel() for part in np.meshgrid(offsets, offsets))
        disc = np.hypot(dx, dy) <= radius
        for offset in np.stack([dx[disc], dy[disc]], axis=1):
            at = np.clip(centres + offset, 0, self.size - 1)
            image[at[:, 1], at[:, 0]] = color


def overlay_inset(frame: Image, inset: Image, gap: int) -> None:
    """Paint an inset over the lower right corner of a frame, in place, with a gap (pixels)."""
    height, width = inset.shape[:2]
    corner = frame[-gap - height : -gap, -gap - width : -gap]
    corner[:] = (OPACITY * inset + (1.0 - OPACITY) * corner).astype(np.uint8)
