"""Engines: how the control step runs inside MuJoCo.

The same scalar source runs either as Python floats (nothing to compile, best for one short flight)
or as a native callback (`tiltsim.engines.native_engine`). MuJoCo's control callback is global to
the process, so an engine is installed for the length of a ``with`` block and checks that a model is
ours before it touches it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol

import mujoco

from tiltsim.closed_loop.loop import ClosedLoop, Sizes
from tiltsim.closed_loop.userdata import HEADER_SIZE

EngineName = Literal["python", "native"]

Callback = Callable[[mujoco.MjModel, mujoco.MjData], None]


class Engine(Protocol):
    """Evaluates the control step of one model whenever MuJoCo asks for controls."""

    name: EngineName

    def callback(self) -> Any:
        """What MuJoCo calls: the whole step, or between the samples of a held law the rest of it.

        Under a held law the controls stay as sampled but for what follows the state by itself, as
        thrust follows the rotor speed.
        """


def check_model(loop: ClosedLoop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise ValueError unless model and data are those of a flight of this loop."""
    sizes = Sizes(model.nq, model.nv, model.na, model.nu)
    head = HEADER_SIZE + loop.record_size
    signed = model.nuserdata >= head and data.userdata[HEADER_SIZE] == loop.signature
    if sizes != loop.dynamics.sizes or not signed:
        raise ValueError(
            f"not a flight of the {loop.dynamics.model}: {sizes}, expected {loop.dynamics.sizes} "
            "with the parameters in userdata"
        )
