"""Films of flights: MuJoCo's offscreen renderer, a camera that follows, encoded by PyAV.

Works without a screen. `tiltsim.views.video.rendering.write_video` makes a film;
`tiltsim.views.video.offscreen` finds a way to draw, `tiltsim.views.video.inset` paints the
roll-pitch plane into the corner.
"""

from __future__ import annotations

import os
import sys


def has_display() -> bool:
    """Whether windows can be opened."""
    return sys.platform != "linux" or bool({"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ))


def prefer_offscreen_gl() -> None:
    """Without a screen, set MUJOCO_GL to egl unless it is set; call before MuJoCo is imported."""
    if not has_display():
        os.environ.setdefault("MUJOCO_GL", "egl")
