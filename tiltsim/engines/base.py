"""Engines, which run the control step inside MuJoCo.

One scalar source runs on Python floats (nothing to compile, best for one short flight) or as a
native callback (`tiltsim.engines.control`). MuJoCo's control callback is global to the
process, so an engine checks that a model is ours before it writes to it.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import mujoco

from tiltsim.closed_loop.loop import ClosedLoop, Sizes
from tiltsim.closed_loop.userdata import HEADER_SIZE
from tiltsim_controllers.mathematics.scalar import Floats

EngineName = Literal["python", "native", "jax"]

Callback = Callable[[mujoco.MjModel, mujoco.MjData], None]


class Vectors(NamedTuple):
    """Views of the vectors of MuJoCo's state that a control step reads, as programs take them."""

    qpos: Floats
    qvel: Floats
    act: Floats
    others: Floats
    history: Floats

    def lists(self) -> tuple[list[float], ...]:
        """Their present values."""
        return tuple(vector.tolist() for vector in self)

    def joined(self) -> tuple[list[float], list[float], list[float]]:
        """``qpos``, ``qvel`` and ``act`` as the functions of a loop see them."""
        qpos, qvel, *behind = self.lists()
        return qpos, qvel, [number for part in behind for number in part]


def vectors_of(loop: ClosedLoop, data: mujoco.MjData) -> Vectors:
    """Views of the state of a flight's data."""
    sizes = loop.sizes
    qpos, others = data.qpos[: sizes.qpos], data.qpos[sizes.qpos :]
    return Vectors(qpos, data.qvel[: sizes.qvel], data.act, others, data.history)


def check_model(loop: ClosedLoop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise ValueError unless model and data belong to a flight of this loop."""
    known = loop.sizes
    moving = known.qvel if known.others else model.nv
    sizes = Sizes(model.nq - known.others, moving, model.na, model.nu, known.others, model.nhistory)
    head = HEADER_SIZE + loop.record_size
    signed = model.nuserdata >= head and data.userdata[HEADER_SIZE] == loop.signature
    if sizes != known or not signed:
        raise ValueError(
            f"not a flight of the {loop.model}: {sizes}, expected {known} "
            "with the parameters in userdata"
        )
