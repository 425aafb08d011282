"""Videos of flights, MP4 or GIF: rendered by MuJoCo with a camera that follows the vehicle.

`tiltsim.views.video.rendering.write_video` writes a video; no display is needed.
"""

import os
import sys


def has_display() -> bool:
    """Whether there is a display on which windows can be opened."""
    return sys.platform != "linux" or bool({"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ))


def prefer_offscreen_gl() -> None:
    """Without a display, let MUJOCO_GL default to egl; call before MuJoCo is imported."""
    if not has_display():
        os.environ.setdefault("MUJOCO_GL", "egl")
