"""Building the engine of a plant."""

import mujoco

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import Engine, EngineName
from tiltsim.engines.python_engine import PythonEngine


def make_engine(
    name: EngineName, assembly: Assembly, model: mujoco.MjModel, data: mujoco.MjData
) -> Engine:
    """Build an engine for a model whose parameters are in ``data.userdata`` already.

    Args:
        name: The engine.
        assembly: The flight.
        model, data: A model for its loop and its data.

    Raises:
        ValueError: If model and data do not belong to a flight of its loop.
    """
    if name == "python":
        return PythonEngine(assembly, model, data)
    from tiltsim.engines.native_engine import NativeEngine

    return NativeEngine(assembly, model, data)
