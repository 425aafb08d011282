"""Drawing MuJoCo scenes into memory, with whatever OpenGL the machine has."""

from __future__ import annotations

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
"""Ways to OpenGL, by the names that MUJOCO_GL knows."""

FONT_SIZE: Final = mujoco.mjtFontScale.mjFONTSCALE_100


def make_contexts(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """An OpenGL context of at least this size (pixels), made current, and MuJoCo's for a model.

    MUJOCO_GL chooses the way to it; without it, EGL is tried first where there is no screen.
    Raises `InputError`, in one line with the way out, where none works.
    """
    failures = []
    for name, make in _ways().items():
        # GLFW warns where others raise, and only MuJoCo notices that there is no context.
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            try:
                context = make(width, height)
                context.make_current()
                return context, mujoco.MjrContext(model, FONT_SIZE.value)
            except Exception as error:  # every library fails in its own way
                said = str(heard[0].message if heard else error)
                reason = said.strip().partition("\n")[0] or type(error).__name__
                failures.append(f"{name}: {reason}")
    raise InputError(
        f"no OpenGL to draw with ({'; '.join(failures)}); install a driver, on Debian "
        "apt-get install libegl1 libgl1-mesa-dri, and set MUJOCO_GL=egl"
    )


def _ways() -> dict[str, Callable[[int, int], Any]]:
    if sys.platform != "linux":
        return {sys.platform: mujoco.GLContext}
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen in MODULES:
        names = [chosen]
    else:
        names = ["glfw", "egl", "osmesa"] if has_display() else ["egl", "osmesa"]
    # Imported on the way, for a library that is missing is a failure like any other.
    return {
        name: lambda *size, m=MODULES[name]: import_module(m).GLContext(*size) for name in names
    }


class Caption(NamedTuple):
    """A line whose lower right corner stands off the frame's (pixels)."""

    text: str
    inwards: int
    up: int


class Canvas:
    """Draws one model, frame by frame; use it as a context manager.

    Parameters
    ----------
    model
        What to draw.
    width, height
        Size of the frames, pixels.

    Raises
    ------
    InputError
        If there is no OpenGL to draw with.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        self._model = model
        self._gl, self._context = make_contexts(model, width, height)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._frame = mujoco.MjrRect(0, 0, width, height)
        self._options = mujoco.MjvOption()
        self.scene = mujoco.MjvScene(model, maxgeom=5000)
        # Where the processor draws, shadows and reflections would take half of the time.
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self.scene.flags[flag] = 0

    def __enter__(self) -> Self:
        """Nothing to do: the context was made with the canvas."""
        return self

    def __exit__(self, *_: object) -> None:
        """Give the OpenGL context back."""
        self._context.free()
        self._gl.free()

    def compose(self, data: mujoco.MjData, camera: mujoco.MjvCamera) -> None:
        """Fill the scene with the model; more may be added to it before `draw`."""
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            *(self._model, data, self._options, None, camera, everything, self.scene)
        )

    def draw(self, names: str, values: str, caption: Caption) -> Image:
        """The scene as an image, shape (height, width, 3), with words on it.

        ``names`` and ``values`` are the columns of a table at the upper left, one line a row.
        """
        mujoco.mjr_render(self._frame, self.scene, self._context)
        frame = self._frame
        self._write(mujoco.mjtGridPos.mjGRID_TOPLEFT, frame, names, values)
        corner = mujoco.MjrRect(0, caption.up, frame.width - caption.inwards, frame.height)
        if caption.text:
            self._write(mujoco.mjtGridPos.mjGRID_BOTTOMRIGHT, corner, caption.text, "")
        image = np.empty((self._frame.height, self._frame.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(image, None, self._frame, self._context)
        return np.flipud(image)

    def _write(self, place: mujoco.mjtGridPos, area: mujoco.MjrRect, *columns: str) -> None:
        mujoco.mjr_overlay(mujoco.mjtFont.mjFONT_NORMAL, place, area, *columns, self._context)
