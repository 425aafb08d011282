"""Rendering MuJoCo scenes offscreen, with any OpenGL implementation of the machine."""

import os
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any, Final, NamedTuple, Self

import mujoco
import numpy as np
import numpy.typing as npt

from tiltsim.errors import InputError
from tiltsim.views.video import has_display

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
        self.scene = mujoco.MjvScene(model, maxgeom=5000)
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
