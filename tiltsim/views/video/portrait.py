"""A picture of a vehicle as its file shows it, in hover."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from PIL import Image

from tiltsim.views.replay import vehicle_radius
from tiltsim.views.video.offscreen import Canvas, Caption

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

WIDTH: Final = 720
HEIGHT: Final = 480  # pixels
AZIMUTH: Final = 50.0
ELEVATION: Final = -28.0  # of the camera's direction, degrees
DISTANCE: Final = 2.5  # of the camera, by the radius of the rotors' places and of a rotor
ROTOR_RADIUS: Final = 0.12  # about the radius of the rotors in the files, m


def save_portrait(model_file: Path, angles: Sequence[float], file: Path) -> None:
    """Render an MJCF file as a PNG, from behind and above, at tilt angles (rad)."""
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    data.qpos[7:] = angles
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.distance = DISTANCE * (vehicle_radius(model) + ROTOR_RADIUS)
    camera.azimuth, camera.elevation = AZIMUTH, ELEVATION
    with Canvas(model, WIDTH, HEIGHT, samples=8, shadows=True) as canvas:
        canvas.compose(data, camera)
        image = canvas.draw("", "", Caption("", 0, 0))
    Image.fromarray(np.ascontiguousarray(image)).save(file, optimize=True)
