"""MuJoCo as the plant."""

from collections.abc import Sequence
from functools import cache, partial
from itertools import pairwise
from math import nan
from typing import Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import (
    CONTROL_PERIOD,
    EVALUATIONS,
    HEADER_SIZE,
    RECORDER,
    TIMESTEP,
    Header,
    evaluation_time,
    steps_taken,
)
from tiltsim.engines.base import EngineName, vectors_of
from tiltsim.engines.control import control_callback, control_step, make_callback
from tiltsim.engines.programs import Recorder
from tiltsim.models.cables import switch
from tiltsim.plants.flight_model import check_start, evaluations_per_step, flight_model
from tiltsim.plants.plant import Plant, choose_engine
from tiltsim.scenario.interaction import objects_of
from tiltsim.vehicles.rotorcraft.others import motion_at_start
from tiltsim_controllers.mathematics.scalar import Floats


class MujocoPlant(Plant):
    """The compiled MJCF model in MuJoCo, with the control step in its control callback.

    Args:
        assembly: The flight.
        model: Its model; default: the one that `flight_model` compiles.
        engine: Default: the one that the scenario requests.
    """

    def __init__(
        self,
        assembly: Assembly,
        model: mujoco.MjModel | None = None,
        engine: EngineName | None = None,
    ) -> None:
        self._assembly, self._loop, self._setup = assembly, assembly.loop, assembly.setup
        self.model = flight_model(assembly) if model is None else model
        self.data = mujoco.MjData(self.model)
        self._evaluations_per_step = evaluations_per_step(self.model)
        self._set_initial_state()
        self.engine: EngineName = choose_engine(assembly, engine)
        self._read_parameters()
        self._prepare_engine()

    def _set_initial_state(self) -> None:
        assembly, data = self._assembly, self.data
        simulation, per_step = assembly.scenario.simulation, self._evaluations_per_step
        data.userdata[:HEADER_SIZE] = Header(
            timestep=simulation.timestep,
            evaluations_per_step=per_step,
            control_period=per_step * simulation.control_steps,
        )
        parameters = self._setup.userdata  # a shared model may have room for more
        data.userdata[HEADER_SIZE : HEADER_SIZE + len(parameters)] = parameters
        sizes = self._loop.sizes
        motion = self._loop.kind.initial_motion(assembly)
        data.qpos[: sizes.qpos], data.qvel[: sizes.qvel] = motion
        if assembly.scenario.has_objects:
            others = motion_at_start(assembly)
            data.qpos[sizes.qpos :], data.qvel[sizes.qvel :] = others
        data.act[:] = self._loop.initial_activations(assembly, self._setup)
        objects = objects_of(assembly.scenario)
        self._cables = () if objects is None else objects.cables
        self._switches = {s for c in self._cables for s in c.switches(simulation.timestep)}
        switch(self.model, self._cables, 0.0)
        with control_callback(None):
            mujoco.mj_forward(self.model, data)
        if assembly.scenario.has_objects or assembly.scenario.companion:
            check_start(assembly.scenario, self.model, data)

    @property
    def time(self) -> float:
        return self.steps_taken * float(self.data.userdata[TIMESTEP])

    @property
    def steps_taken(self) -> int:
        """Physics steps since time zero."""
        return steps_taken(self.data.userdata[:HEADER_SIZE])

    @property
    def state(self) -> Floats:
        """MuJoCo's integration state, the parameters in userdata included."""
        values = np.empty(mujoco.mj_stateSize(self.model, _INTEGRATION))
        mujoco.mj_getState(self.model, self.data, values, _INTEGRATION)
        return values

    @state.setter
    def state(self, value: Floats) -> None:
        mujoco.mj_resetData(self.model, self.data)  # clears the warnings
        mujoco.mj_setState(self.model, self.data, value, _INTEGRATION)
        switch(self.model, self._cables, self.time)
        with control_callback(None):
            mujoco.mj_forward(self.model, self.data)
        self._read_parameters()
        self._prepare_engine()

    def _read_parameters(self) -> None:
        """Bind the parameters in ``userdata`` to the functions of the loop, by name."""
        user = self.data.userdata[HEADER_SIZE:].tolist()
        self._evaluate = cache(partial(control_step, self._assembly, user))

    def _prepare_engine(self) -> None:
        """Build the engine, which reads the parameters in ``userdata`` once."""
        self._callback = make_callback(self.engine, self._assembly, self.model, self.data)

    def advance(self, steps: int) -> None:
        with control_callback(self._callback):
            self._step(steps)

    def _step(self, steps: int) -> None:
        """Take physics steps, between which cables begin to hold and release."""
        first = self.steps_taken
        inside = sorted(step for step in self._switches if first < step < first + steps)
        for begin, end in pairwise((first, *inside, first + steps)):
            switch(self.model, self._cables, begin * self._assembly.scenario.simulation.timestep)
            mujoco.mj_step(self.model, self.data, nstep=end - begin)

    def record(self, samples: int, steps: int) -> Floats | None:
        """Natively, all but the last sample come from the callback."""
        if self.engine == "native":
            return self._record_natively(samples, steps)
        return super().record(samples, steps)

    @property
    def evaluation_time(self) -> float:
        """Time (s) for the next evaluation of the control step."""
        timestep, per_step, _, evaluations, _ = self.data.userdata[:HEADER_SIZE].tolist()
        return evaluation_time(evaluations, per_step, timestep)

    @property
    def callback(self) -> Any:
        """The control callback for MuJoCo; see `tiltsim.engines.control.make_callback`."""
        return self._callback

    @property
    def header_offset(self) -> int:
        """Index in `state` at which the `tiltsim.closed_loop.userdata.Header` begins."""
        before = int(mujoco.mjtState.mjSTATE_USERDATA) - 1
        return int(mujoco.mj_stateSize(self.model, _INTEGRATION & before))

    def recorder(self, samples: int, steps: int, last_steps: int) -> Recorder:
        """Memory for the samples of the native engine; its address goes to ``userdata[RECORDER]``.

        Args:
            samples: Number of samples.
            steps, last_steps: Physics steps between samples, and before the last one.
        """
        from tiltsim.engines.programs import Recorder

        evaluations = self._evaluations_per_step
        return Recorder(
            self._assembly,
            samples,
            steps * evaluations,
            last_steps * evaluations,
            self._assembly.sign_check_values(self.time, self.observe()),
        )

    def _record_natively(self, samples: int, steps: int) -> Floats | None:
        recorder = self.recorder(samples, steps, steps)
        self.data.userdata[RECORDER] = recorder.address
        try:
            self.advance(samples * steps)
        finally:
            self.data.userdata[RECORDER] = 0.0
        if recorder.terminated or self.fault():
            return None
        return np.vstack([recorder.samples, (self.time, *self.observe())])

    def observe(self) -> tuple[float, ...]:
        data, state = self.data, vectors_of(self._loop, self.data).lists()
        # MuJoCo keeps the controls of its last integrator stage.
        period = data.userdata[CONTROL_PERIOD]
        stale = period == 0.0 or data.userdata[EVALUATIONS] % period == 0.0
        reads_controls = self._loop.observe_reads_controls
        ctrl = self.controls(*state) if reads_controls and stale else data.ctrl.tolist()
        header = data.userdata[:HEADER_SIZE].tolist()
        try:
            return tuple(self._evaluate("observe")(header, *state, ctrl))
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._loop.sample_fields) - 1)

    def controls(self, *vectors: Sequence[float]) -> Sequence[float]:
        """The controls for a state (`Vectors`) at the present time; NaN where there are none."""
        header = self.data.userdata[:HEADER_SIZE].tolist()
        try:
            return self._evaluate("controls")(header, *vectors, ())
        except (ArithmeticError, ValueError):
            return [nan] * len(self.data.ctrl)

    def fault(self) -> str:
        """MuJoCo resets an unstable state silently but counts its warnings."""
        for warning, text in _WARNINGS.items():
            if self.data.warning[warning].number:
                return text
        return ""


_INTEGRATION: Final = int(mujoco.mjtState.mjSTATE_INTEGRATION)
# MuJoCo checks the state first, and a control law cannot do anything with a bad one.
_WARNINGS: Final = {
    mujoco.mjtWarning.mjWARN_BADQPOS: "positions are NaN or beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADQVEL: "velocities are NaN or beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADCTRL: "the control law returned NaN or a value beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADQACC: "accelerations are NaN or beyond 1e10",
}
