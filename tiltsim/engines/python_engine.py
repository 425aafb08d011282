"""The Python engine: the scalar control step on Python floats."""

from __future__ import annotations

from math import nan
from struct import Struct

import mujoco

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.closed_loop.userdata import CONTROL_PERIOD, EVALUATIONS, HEADER_SIZE
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
        header = data.userdata[:HEADER_SIZE]
        write_controls = Struct(f"{len(ctrl)}d").pack_into

        def sample(_model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data:
                return  # another model of this process
            try:
                positions, velocities = qpos.tolist(), qvel.tolist()
                values = controls(data.time, positions, velocities, act.tolist(), parameters, knots)
                write_controls(ctrl, 0, *values)
            except (ArithmeticError, ValueError):
                # Where floats raise (sin of infinity), native code has NaN; MuJoCo reports both.
                write_controls(ctrl, 0, *(nan,) * len(ctrl))

        def between_samples() -> tuple[float, ...]:
            try:
                state = data.time, qpos.tolist(), qvel.tolist(), act.tolist()
                return hold(*state, ctrl.tolist(), parameters)
            except (ArithmeticError, ValueError):
                return (nan,) * len(ctrl)

        def sample_and_hold(model: mujoco.MjModel, called: mujoco.MjData) -> None:
            if called is not data:
                return
            period, evaluations, _ = header.tolist()
            if evaluations == 0.0:
                sample(model, called)
            else:
                write_controls(ctrl, 0, *between_samples())
            header[EVALUATIONS] = evaluations + 1.0 if evaluations + 1.0 < period else 0.0

        self._callback = sample_and_hold if header[CONTROL_PERIOD] > 0.0 else sample

    def callback(self) -> Callback:
        return self._callback
