"""Rendering MuJoCo scenes offscreen with any OpenGL implementation, and drawings over frames."""

import os
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any, Final, NamedTuple, Self

import mujoco
import numpy as np
import numpy.typing as npt
from PIL import Image as Pillow
from PIL import ImageDraw

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.views import attitude_plane
from tiltsim.views.figures import style
from tiltsim.views.signals import has_attitude_plane
from tiltsim.views.video import has_display
from tiltsim_controllers.mathematics.scalar import Floats

Image = npt.NDArray[np.uint8]

MODULES: Final = {"egl": "mujoco.egl", "osmesa": "mujoco.osmesa", "glfw": "mujoco.glfw"}
"""OpenGL modules by the values of MUJOCO_GL."""

LARGE_HEIGHT: Final = 700
"""Frames at least as high as this (pixels) have larger text; there is no smaller one."""


def make_contexts(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """Make an OpenGL context current, and MuJoCo's rendering context for a model.

    MUJOCO_GL selects the implementation; without it, EGL is tried first if there is no display.
    The context has at least the given size (pixels).

    Raises:
        InputError: If no implementation works.
    """
    failures = []
    normal, large = mujoco.mjtFontScale.mjFONTSCALE_100, mujoco.mjtFontScale.mjFONTSCALE_150
    font = large if height >= LARGE_HEIGHT else normal
    for name, make in _implementations().items():
        # GLFW only warns, and only MuJoCo detects that there is no context.
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                context = make(width, height)
                context.make_current()
                return context, mujoco.MjrContext(model, font.value)
            except Exception as error:  # every library raises other errors
                message = str(caught[0].message if caught else error)
                reason = message.strip().partition("\n")[0] or type(error).__name__
                failures.append(f"{name}: {reason}")
    raise InputError(
        f"no OpenGL implementation works ({'; '.join(failures)}); install a driver, on Debian "
        "apt-get install libegl1 libgl1-mesa-dri, and set MUJOCO_GL=egl"
    )


def _implementations() -> dict[str, Callable[[int, int], Any]]:
    if sys.platform != "linux":
        return {sys.platform: mujoco.GLContext}
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen in MODULES:
        names = [chosen]
    else:
        names = ["glfw", "egl", "osmesa"] if has_display() else ["egl", "osmesa"]
    # Imported when called, so that a missing library is a failure like any other.
    return {
        name: lambda *size, m=MODULES[name]: import_module(m).GLContext(*size) for name in names
    }


class Caption(NamedTuple):
    """A line of text, and the distances of its lower right corner from the frame's (pixels)."""

    text: str
    right: int
    bottom: int


class Canvas:
    """Renders frames of one model; use it as a context manager.

    Args:
        model: The model, whose settings for rendering are changed.
        width, height: Size of the frames, pixels.
        samples: Per pixel, against jagged edges; 0 for none.
        shadows: Whether to render shadows and reflections, which without a GPU takes twice the
            time.

    Raises:
        InputError: If no OpenGL implementation works.
    """

    def __init__(
        self, model: mujoco.MjModel, width: int, height: int, *, samples: int, shadows: bool
    ) -> None:
        model.vis.quality.offsamples = samples
        model.vis.quality.numquads = 1  # per side of a box: lines are boxes
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        self._model = model
        self._gl, self._context = make_contexts(model, width, height)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._frame = mujoco.MjrRect(0, 0, width, height)
        self._options = mujoco.MjvOption()
        self.scene = mujoco.MjvScene(model, maxgeom=10000)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self.scene.flags[flag] = shadows

    def __enter__(self) -> Self:
        """Return the canvas, whose constructor made the context."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the OpenGL context."""
        self.close()

    def close(self) -> None:
        """Free the OpenGL context; nothing can be rendered any more."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def compose(self, data: mujoco.MjData, camera: mujoco.MjvCamera) -> None:
        """Fill the scene with the model; more geoms can be added before `draw`."""
        model, options, category = self._model, self._options, mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, options, None, camera, category, self.scene)

    def draw(self, names: str, values: str, caption: Caption) -> Image:
        """Render the scene, shape (height, width, 3), with a table at the upper left.

        ``names`` and ``values`` are the columns of the table, one line per row; both may be empty.
        """
        self._gl.make_current()  # another canvas may have been in use since
        mujoco.mjr_render(self._frame, self.scene, self._context)
        frame = self._frame
        if names:
            self._write(mujoco.mjtGridPos.mjGRID_TOPLEFT, frame, names, values)
        corner = mujoco.MjrRect(0, caption.bottom, frame.width - caption.right, frame.height)
        if caption.text:
            self._write(mujoco.mjtGridPos.mjGRID_BOTTOMRIGHT, corner, caption.text, "")
        image = np.empty((frame.height, frame.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(image, None, frame, self._context)
        return np.flipud(image)

    def _write(self, place: mujoco.mjtGridPos, area: mujoco.MjrRect, *columns: str) -> None:
        mujoco.mjr_overlay(mujoco.mjtFont.mjFONT_NORMAL, place, area, *columns, self._context)


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
        if not rows and "yaw" in now:
            rows["yaw"] = f"{now['yaw']:+.2f} rad"
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
