"""Engines, which run the control step inside MuJoCo.

One scalar source runs on Python floats (nothing to compile, best for one short flight) or as a
native callback (`tiltsim.engines.native_engine`). MuJoCo's control callback is global to the
process, so an engine checks that a model is ours before it writes to it.
"""

from collections.abc import Callable
from typing import Any, Literal, Protocol

import mujoco

from tiltsim.closed_loop.loop import ClosedLoop, Sizes
from tiltsim.closed_loop.userdata import HEADER_SIZE

EngineName = Literal["python", "native", "jax"]

Callback = Callable[[mujoco.MjModel, mujoco.MjData], None]


class Engine(Protocol):
    """Evaluates the control step of one model whenever MuJoCo needs its controls."""

    name: EngineName

    def callback(self) -> Any:
        """The control callback: a Python function, or a C function as `ctypes` shows it.

        It evaluates the whole step or, between the samples of a held controller, only those
        controls that follow the state, as thrusts follow the rotor speeds.
        """


def check_model(loop: ClosedLoop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise ValueError unless model and data belong to a flight of this loop."""
    sizes = Sizes(model.nq, model.nv, model.na, model.nu)
    head = HEADER_SIZE + loop.record_size
    signed = model.nuserdata >= head and data.userdata[HEADER_SIZE] == loop.signature
    if sizes != loop.dynamics.sizes or not signed:
        raise ValueError(
            f"not a flight of the {loop.dynamics.model}: {sizes}, expected {loop.dynamics.sizes} "
            "with the parameters in userdata"
        )
