"""The two plants behind one interface: MuJoCo, and the thesis' own equations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import nan
from typing import TYPE_CHECKING, Any, Final, Protocol

import mujoco
import numpy as np

from controllers.records import slotted
from controllers.scalar import Triple
from tiltsim import thesis_plant
from tiltsim.cache import native_code_is_cached, native_code_was_compiled
from tiltsim.engine import EngineName, control_callback, make_engine
from tiltsim.errors import InputError
from tiltsim.interrupts import interrupts_kept
from tiltsim.loop import EVALUATIONS, HEADER_SIZE, RECORDER, ControlSetup, Floats, Header, Loop
from tiltsim.loops import control_setup, loop_of
from tiltsim.scenario import Scenario

if TYPE_CHECKING:
    from tiltsim.native import Recorder

STEPS_WORTH_LOADING: Final = 15_000
"""Flights of at least this many steps repay loading the native engine, once it is compiled."""

STEPS_WORTH_COMPILING: Final = 100_000
"""Flights of at least this many steps repay compiling it first."""


class Plant(Protocol):
    """A vehicle under control, advanced step by step and restartable from its state."""

    engine: EngineName

    @property
    def time(self) -> float:
        """Simulated time, s."""

    @property
    def state(self) -> Floats:
        """Everything that the future depends on, as a vector; assign it to restart there."""

    @state.setter
    def state(self, value: Floats) -> None: ...

    def advance(self, steps: int) -> None:
        """Take physics steps."""

    def record(self, samples: int, steps: int) -> Floats | None:
        """Take ``samples`` times ``steps`` physics steps and a sample after each time.

        None where a sample or the physics engine tells that something has gone wrong on the way;
        what state the plant is in then is open.
        """

    def observe(self) -> tuple[float, ...]:
        """What a sample holds after the time; see `tiltsim.loop.Loop.sample_fields`."""

    def fault(self) -> str:
        """What the physics engine has found wrong so far, in a few words; else empty."""


def make_plant(scenario: Scenario, controller: Any = None) -> Plant:
    """The plant that a scenario asks for, at its initial state.

    ``controller`` is a user's own, for scenarios whose law is ``python``.
    """
    if scenario.controller.law == "python":
        from tiltsim.commanded_plant import ControlledPlant

        return ControlledPlant(scenario, controller)
    thesis = scenario.simulation.plant == "thesis"
    with interrupts_kept():  # it may compile
        return ThesisPlant(scenario) if thesis else MujocoPlant(scenario)


def choose_engine(scenario: Scenario) -> EngineName:
    """The engine a scenario asks for; ``auto`` weighs the flight's length against start-up.

    A user's own controller is Python, whatever is asked for.
    """
    if scenario.controller.law == "python":
        return "python"
    if scenario.simulation.engine != "auto":
        return scenario.simulation.engine
    return "native" if worth_native([scenario]) else "python"


def worth_native(scenarios: Iterable[Scenario]) -> bool:
    """Whether flights are together long enough for the native engine."""
    steps, names = 0, set()
    for scenario in scenarios:
        steps += scenario.simulation.steps
        names.add(loop_of(scenario).native_name(scenario.simulation.plant))
    cached = all(map(native_code_is_cached, names))
    return steps >= (STEPS_WORTH_LOADING if cached else STEPS_WORTH_COMPILING)


class MujocoPlant:
    """The compiled MJCF model in MuJoCo, with the control step in its control callback."""

    def __init__(self, scenario: Scenario, model: mujoco.MjModel | None = None) -> None:
        """Build the plant, or take a ``model`` that `flight_model` built for such a scenario."""
        self._loop, self._setup = loop_of(scenario), control_setup(scenario)
        if model is None:
            model = flight_model(scenario, len(self._setup.userdata))
        self.model = model
        self.data = mujoco.MjData(self.model)
        self._reference, _ = scenario.reference_and_table()
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
        """What MuJoCo is to call for controls; see `tiltsim.engine.Engine.callback`."""
        return self._engine.callback()

    @property
    def header_at(self) -> int:
        """Where in `state` the `tiltsim.loop.Header` begins."""
        before = int(mujoco.mjtState.mjSTATE_USERDATA) - 1
        return int(mujoco.mj_stateSize(self.model, _INTEGRATION & before))

    def recorder(self, samples: int, steps: int, last_steps: int) -> Recorder:
        """Memory for samples every so many steps, the last one after ``last_steps``.

        Its address goes to `RECORDER` in `userdata`. Only for the native engine.
        """
        from tiltsim.native import Recorder

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
            return self._loop.controls(data.time, *state, setup.parameters, setup.table)
        except (ArithmeticError, ValueError):
            return [nan] * len(data.ctrl)

    def fault(self) -> str:
        """See `Plant.fault`: MuJoCo resets an unstable state silently but counts its warnings."""
        for warning, words in _WARNINGS.items():
            if self.data.warning[warning].number:
                return words
        return ""


def watched_now(loop: Loop, setup: ControlSetup, values: Sequence[float]) -> tuple[float, ...]:
    """The numbers that a loop watches natively; none where it leaves that to Python."""
    return () if loop.watch is None else loop.watch(values, setup.parameters)


def flight_model(scenario: Scenario, parameters: int) -> mujoco.MjModel:
    """The model that a scenario flies, with room for as many floats of parameters.

    Raises `InputError` where MuJoCo cannot build it.
    """
    model = build_model(scenario, userdata_size=HEADER_SIZE + parameters)
    # A diverged state must stay visible; by default MuJoCo would silently start over.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


_FLOWN_IN_ANY_MODEL: Final = frozenset(
    {
        *("title", "source", "without", "simulation", "initial", "gait", "reference", "sensors"),
        "expect",
    }
)
"""Tables of a scenario that are parameters or initial state of a flight, or no part of it."""


def what_decides_the_model(scenario: Scenario) -> str:
    """Equal only for scenarios that `flight_model` builds equal models for, if one loop flies."""
    simulation = scenario.simulation
    tables = [value for name, value in scenario if name not in _FLOWN_IN_ANY_MODEL]
    return repr((tables, simulation.timestep, simulation.integrator))


def evaluations_per_step(model: mujoco.MjModel) -> int:
    """How often MuJoCo's integrator asks for controls in a step."""
    return 4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else 1


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


def disturbing_acceleration(scenario: Scenario) -> Triple:
    """The sum of a scenario's disturbances, m/s^2, world."""
    x, y, z = (sum(d.value[axis] for d in scenario.disturbance) for axis in range(3))
    return float(x), float(y), float(z)


def build_model(
    scenario: Scenario, *, userdata_size: int = 0, visuals: bool = False
) -> mujoco.MjModel:
    """Compile the scenario's vehicle, with what is drawn of it only if asked.

    Raises `InputError` where MuJoCo cannot build it.
    """
    loop = loop_of(scenario)
    try:
        model = loop.kind.compile(
            scenario, loop.law_states, loop.extra_actuators, userdata_size, visuals
        )
    except ValueError as error:
        raise InputError(f"{scenario.address or 'scenario'}: vehicle: {error}") from error
    model.opt.gravity += disturbing_acceleration(scenario)
    return model


class ThesisPlant:
    """The thesis' equations with ode3; see `tiltsim.thesis_plant`."""

    def __init__(self, scenario: Scenario) -> None:
        simulation = scenario.simulation
        loop, setup = loop_of(scenario), control_setup(scenario)
        assert loop.equations is not None  # scenarios that ask for others are refused
        self._loop, self._equations, self._setup = loop, loop.equations, setup
        self._reference, _ = scenario.reference_and_table()
        self._follows_position = loop.follows_position(scenario)
        self._disturbance = disturbing_acceleration(scenario)
        self._timestep = simulation.timestep
        self._control_steps = simulation.control_steps
        self._step_index = 0
        self._state = list(map(float, self._equations.initial(scenario, setup)))
        self._held = (0.0,) * self._equations.inputs_size
        self._fault = ""
        self.engine: EngineName = choose_engine(scenario)
        self._advance: thesis_plant.Stepper
        self._law: tuple[Any, Any]  # parameters and table, as the stepper reads them
        if self.engine == "native":
            from tiltsim.native import compile_stepper, native_record

            self._advance, self._record = compile_stepper(loop)
            self._law = native_record(loop, setup.userdata)
        else:
            self._advance = thesis_plant.stepper_of(self._equations)
            self._law = slotted(setup.parameters), setup.table

    @property
    def time(self) -> float:
        """See `Plant.time`."""
        return self._step_index * self._timestep

    @property
    def state(self) -> Floats:
        """See `Plant.state`: the step count, the inputs held and the state of the equations.

        The parameters are the scenario's and stay with the plant.
        """
        return np.array([self._step_index, *self._held, *self._state])

    @state.setter
    def state(self, value: Floats) -> None:
        split = 1 + len(self._held)
        self._step_index = int(value[0])
        self._held = tuple(value[1:split].tolist())
        self._state = value[split:].tolist()
        self._fault = ""

    def advance(self, steps: int) -> None:
        """See `Plant.advance`."""
        state: Any = np.array(self._state) if self.engine == "native" else self._state
        try:
            state, self._held = self._advance(
                *(self._step_index, state, self._held, self._timestep, steps),
                *(self._control_steps, *self._law, self._disturbance),
            )
            self._state = list(map(float, state))  # numpy's own floats would warn of infinity
        except (ArithmeticError, ValueError):
            # Where floats raise, native code has NaN.
            self._state = [nan] * len(self._state)
            self._fault = "the control law left the range of floating-point numbers"
        self._step_index += steps

    def record(self, samples: int, steps: int) -> Floats | None:
        """See `Plant.record`."""
        if self.engine == "native":
            return self._record_natively(samples, steps)
        rows = []
        for _ in range(samples):
            self.advance(steps)
            rows.append((self.time, *self.observe()))
        return None if self.fault() else np.array(rows)

    def _record_natively(self, samples: int, steps: int) -> Floats | None:
        from tiltsim.native import Recorder

        recorder = Recorder(
            *(self._loop, samples, steps, steps, self._reference, self._follows_position),
            watched_now(self._loop, self._setup, self.observe()),
        )
        state, self._held = self._record(
            *(int(recorder.address), samples),
            *(self._step_index, np.array(self._state), self._held, self._timestep, steps),
            *(self._control_steps, *self._law, self._disturbance),
        )
        self._state = state.tolist()
        native_code_was_compiled(self._loop.native_name("thesis"))
        self._step_index += samples * steps
        return None if recorder.lost else recorder.samples

    def observe(self) -> tuple[float, ...]:
        """See `Plant.observe`."""
        setup = self._setup
        try:
            return self._equations.observe(
                self.time, self._state, self._inputs_in_force(), setup.parameters, setup.table
            )
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._loop.sample_fields) - 1)

    def _inputs_in_force(self) -> Sequence[float]:
        every = self._control_steps
        if every > 0 and self._step_index % every != 0:
            return self._held
        try:
            setup = self._setup
            return self._equations.inputs(self.time, self._state, setup.parameters, setup.table)
        except (ArithmeticError, ValueError):
            return [nan] * len(self._held)

    def fault(self) -> str:
        """See `Plant.fault`."""
        return self._fault
