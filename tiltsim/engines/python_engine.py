"""The Python engine: the scalar control step on Python floats."""

from __future__ import annotations

from functools import partial
from math import nan
from struct import Struct
from typing import Any

import mujoco

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.closed_loop.userdata import (
    CONTROL_PERIOD,
    EVALUATIONS,
    EVALUATIONS_PER_STEP,
    HEADER_SIZE,
    TIMESTEP,
    evaluation_time,
)
from tiltsim.engines.base import Callback, Engine, EngineName, check_model
from tiltsim_controllers.mathematics.records import slotted, unflatten


class PythonEngine(Engine):
    """Runs the scalar source on Python floats."""

    name: EngineName = "python"

    def __init__(self, loop: ClosedLoop, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        check_model(loop, model, data)
        controls, hold = loop.sampling.controls, loop.sampling.hold
        # Parameters do not change during a flight: read once here, at every call in native code.
        values = data.userdata[HEADER_SIZE:].tolist()
        parameters = slotted(unflatten(loop.parameters, values))
        knots = tuple(values[loop.record_size :])
        # Views of MuJoCo's memory; a look-up at every call would take a tenth of the callback.
        vectors = data.qpos, data.qvel, data.act, data.ctrl
        qpos, qvel, act, ctrl = (memoryview(vector) for vector in vectors)
        header: Any = memoryview(data.userdata[:HEADER_SIZE])
        timestep, per_step, period = (
            header[index] for index in (TIMESTEP, EVALUATIONS_PER_STEP, CONTROL_PERIOD)
        )
        write_controls = partial(Struct(f"{len(ctrl)}d").pack_into, ctrl, 0)

        def evaluate(_model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data:
                return  # another model of this process
            count = header[EVALUATIONS]
            header[EVALUATIONS] = count + 1.0
            time = evaluation_time(count, per_step, timestep)
            q, v, a = qpos.tolist(), qvel.tolist(), act.tolist()
            try:
                if period == 0.0 or count % period == 0.0:
                    values = controls(time, q, v, a, parameters, knots)
                else:
                    values = hold(time, q, v, a, ctrl.tolist(), parameters)
            except (ArithmeticError, ValueError):
                # Where floats raise (sin of infinity), native code has NaN; MuJoCo reports both.
                values = (nan,) * len(ctrl)
            write_controls(*values)

        self._callback = evaluate

    def callback(self) -> Callback:
        return self._callback
