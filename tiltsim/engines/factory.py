"""Building the engine of a plant."""

from __future__ import annotations

import mujoco

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.engines.base import Engine, EngineName
from tiltsim.engines.python_engine import PythonEngine


def make_engine(
    name: EngineName, loop: ClosedLoop, model: mujoco.MjModel, data: mujoco.MjData
) -> Engine:
    """Build an engine for a model whose parameters are in ``data.userdata`` already.

    Args:
        name: The engine.
        loop: The closed loop of the model.
        model, data: A model for the loop and its data.

    Raises:
        ValueError: If model and data do not belong to a flight of this loop.
    """
    if name == "python":
        return PythonEngine(loop, model, data)
    from tiltsim.engines.native_engine import NativeEngine

    return NativeEngine(loop, model, data)
