"""The two plants behind one interface: MuJoCo, and the thesis' own equations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import nan
from typing import TYPE_CHECKING, Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.closed_loop.userdata import EVALUATIONS, HEADER_SIZE, RECORDER, Header
from tiltsim.engines.base import EngineName
from tiltsim.engines.callback import control_callback
from tiltsim.engines.factory import make_engine
from tiltsim.laws.assembling import control_setup, loop_of
from tiltsim.plants.engine_choice import choose_engine
from tiltsim.plants.flight_model import evaluations_per_step, flight_model
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.engines.recorder import Recorder


class MujocoPlant:
    """The compiled MJCF model in MuJoCo, with the control step in its control callback."""

    def __init__(self, scenario: Scenario, model: mujoco.MjModel | None = None) -> None:
        """Build the plant, or take a ``model`` that `flight_model` built for such a scenario."""
        self._loop, self._setup = loop_of(scenario), control_setup(scenario)
        if model is None:
            model = flight_model(scenario, len(self._setup.userdata))
        self.model = model
        self.data = mujoco.MjData(self.model)
        self._reference, _ = scenario.reference_and_knots()
        self._follows_position = self._loop.follows_position(scenario)
        self._set_initial_state(scenario, self._setup)
        self.engine: EngineName = choose_engine(scenario)
        self._engine = make_engine(self.engine, self._loop, self.model, self.data)

    def _set_initial_state(self, scenario: Scenario, setup: ControlSetup) -> None:
        data = self.data
        period = evaluations_per_step(self.model) * scenario.simulation.control_steps
        data.userdata[:HEADER_SIZE] = Header(control_period=period)
        parameters = setup.userdata  # a model made for several gaits may have room for more
        data.userdata[HEADER_SIZE : HEADER_SIZE + len(parameters)] = parameters
        data.qpos[:], data.qvel[:] = self._loop.kind.initial_motion(scenario)
        data.act[:] = self._loop.initial_activations(scenario, setup)
        mujoco.mj_forward(self.model, data)

    @property
    def time(self) -> float:
        """See `Plant.time`."""
        return float(self.data.time)

    @property
    def state(self) -> Floats:
        """See `Plant.state`: MuJoCo's integration state, the parameters in userdata included."""
        values = np.empty(mujoco.mj_stateSize(self.model, _INTEGRATION))
        mujoco.mj_getState(self.model, self.data, values, _INTEGRATION)
        return values

    @state.setter
    def state(self, value: Floats) -> None:
        mujoco.mj_resetData(self.model, self.data)  # clears the warnings
        mujoco.mj_setState(self.model, self.data, value, _INTEGRATION)
        mujoco.mj_forward(self.model, self.data)
        # The state brings its own parameters, which the Python engine reads once.
        self._engine = make_engine(self.engine, self._loop, self.model, self.data)

    def advance(self, steps: int) -> None:
        """See `Plant.advance`."""
        with control_callback(self._engine.callback()), quiet_warnings():
            mujoco.mj_step(self.model, self.data, nstep=steps)

    def record(self, samples: int, steps: int) -> Floats | None:
        """See `Plant.record`: natively, all but the last sample come from the callback."""
        if self.engine == "native":
            return self._record_natively(samples, steps)
        rows = []
        for _ in range(samples):
            self.advance(steps)
            rows.append((self.time, *self.observe()))
        return None if self.fault() else np.array(rows)

    @property
    def callback(self) -> Any:
        """What MuJoCo is to call for controls; see `tiltsim.engines.base.Engine.callback`."""
        return self._engine.callback()

    @property
    def header_offset(self) -> int:
        """Where in `state` the `tiltsim.closed_loop.userdata.Header` begins."""
        before = int(mujoco.mjtState.mjSTATE_USERDATA) - 1
        return int(mujoco.mj_stateSize(self.model, _INTEGRATION & before))

    def recorder(self, samples: int, steps: int, last_steps: int) -> Recorder:
        """Memory for samples every so many steps, the last one after ``last_steps``.

        Its address goes to `RECORDER` in `userdata`. Only for the native engine.
        """
        from tiltsim.engines.recorder import Recorder

        evaluations = evaluations_per_step(self.model)
        return Recorder(
            *(self._loop, samples, steps * evaluations, last_steps * evaluations),
            *(self._reference, self._follows_position),
            watched_now(self._loop, self._setup, self.observe()),
        )

    def _record_natively(self, samples: int, steps: int) -> Floats | None:
        recorder = self.recorder(samples, steps, steps)
        self.data.userdata[RECORDER] = recorder.address
        try:
            self.advance(samples * steps)
        finally:
            self.data.userdata[RECORDER] = 0.0
        if recorder.lost or self.fault():
            return None
        return np.vstack([recorder.samples, (self.time, *self.observe())])

    def observe(self) -> tuple[float, ...]:
        """See `Plant.observe`."""
        data = self.data
        state = data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        return self._loop.observe(*state, self._controls_in_force(*state))

    def _controls_in_force(self, *state: Sequence[float]) -> Sequence[float]:
        """The controls at the present state; MuJoCo keeps those of its last integrator stage."""
        data = self.data
        if data.userdata[EVALUATIONS] != 0.0 or not self._loop.observes_controls:
            return list(data.ctrl.tolist())
        try:
            setup = self._setup
            return self._loop.controls(data.time, *state, setup.parameters, setup.knots)
        except (ArithmeticError, ValueError):
            return [nan] * len(data.ctrl)

    def fault(self) -> str:
        """See `Plant.fault`: MuJoCo resets an unstable state silently but counts its warnings."""
        for warning, words in _WARNINGS.items():
            if self.data.warning[warning].number:
                return words
        return ""


def watched_now(
    loop: ClosedLoop, setup: ControlSetup, values: Sequence[float]
) -> tuple[float, ...]:
    """The numbers that a loop watches natively; none where it leaves that to Python."""
    return () if loop.watch is None else loop.watch(values, setup.parameters)


@contextmanager
def quiet_warnings() -> Iterator[None]:
    """Keep MuJoCo from printing its warnings or leaving a log file; `Plant.fault` reports them."""
    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(previous)


_INTEGRATION: Final = int(mujoco.mjtState.mjSTATE_INTEGRATION)
_WARNINGS: Final = {
    mujoco.mjtWarning.mjWARN_BADCTRL: "the control law returned NaN or a value beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADQPOS: "positions are NaN or beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADQVEL: "velocities are NaN or beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADQACC: "accelerations are NaN or beyond 1e10",
}
