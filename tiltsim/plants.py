"""The two plants behind one interface: MuJoCo, and the thesis' own equations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import nan
from typing import Any, Final, Protocol

import mujoco
import numpy as np

from controllers.gaits import tilt_reference
from controllers.records import slotted
from controllers.rotation import quaternion_from_euler
from controllers.scalar import Triple
from tiltsim import thesis_plant
from tiltsim.cache import native_code_is_cached
from tiltsim.engine import EngineName, control_callback, make_engine
from tiltsim.errors import InputError
from tiltsim.loop import ControlSetup, Floats
from tiltsim.loops import control_setup, loop_of
from tiltsim.model import Pod, RotorLimits, TiltServo, compile_model
from tiltsim.scenario import Scenario

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

    def observe(self) -> tuple[float, ...]:
        """What a sample holds after the time; see `tiltsim.loop.Loop.sample_fields`."""

    def fault(self) -> str:
        """What the physics engine has found wrong so far, in a few words; else empty."""


def make_plant(scenario: Scenario) -> Plant:
    """The plant that a scenario asks for, at its initial state."""
    return ThesisPlant(scenario) if scenario.simulation.plant == "thesis" else MujocoPlant(scenario)


def choose_engine(scenario: Scenario) -> EngineName:
    """The engine a scenario asks for; ``auto`` weighs the flight's length against start-up."""
    simulation = scenario.simulation
    if simulation.engine != "auto":
        return simulation.engine
    cheap = STEPS_WORTH_LOADING if native_code_is_cached() else STEPS_WORTH_COMPILING
    return "native" if simulation.steps >= cheap else "python"


class MujocoPlant:
    """The compiled MJCF model in MuJoCo, with the control step in its control callback."""

    def __init__(self, scenario: Scenario) -> None:
        self._loop, self._setup = loop_of(scenario), control_setup(scenario)
        self.model = build_model(scenario, userdata_size=len(self._setup.userdata))
        # A diverged state must stay visible; by default MuJoCo would silently start over.
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.data = mujoco.MjData(self.model)
        self._control_steps = scenario.simulation.control_steps
        self._set_initial_state(scenario, self._setup)
        self.engine: EngineName = choose_engine(scenario)
        self._engine = make_engine(self.engine, self._loop, self.model, self.data)

    def _set_initial_state(self, scenario: Scenario, setup: ControlSetup) -> None:
        initial, data = scenario.initial, self.data
        data.userdata[:] = setup.userdata
        data.qpos[:3] = initial.position
        data.qpos[3:7] = quaternion_from_euler(*initial.attitude)
        gait = scenario.gait.plan(scenario.vehicle.resolve())
        data.qpos[7:] = tilt_reference(0.0, gait.parameters, gait.table)[: self.model.nq - 7]
        data.qvel[:3] = initial.velocity
        data.qvel[3:6] = initial.angular_velocity
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

    @property
    def _steps_taken(self) -> int:
        return round(float(self.data.time) / float(self.model.opt.timestep))

    def advance(self, steps: int) -> None:
        """See `Plant.advance`."""
        model, data, every = self.model, self.data, self._control_steps
        if every == 0:
            with control_callback(self._engine.continuous()), quiet_warnings():
                mujoco.mj_step(model, data, nstep=steps)
            return
        with control_callback(self._engine.held()), quiet_warnings():
            while steps > 0:
                since_sample = self._steps_taken % every
                if since_sample == 0:
                    self._engine.sample(model, data)
                chunk = min(steps, every - since_sample)
                mujoco.mj_step(model, data, nstep=chunk)
                steps -= chunk

    def observe(self) -> tuple[float, ...]:
        """See `Plant.observe`."""
        data = self.data
        state = data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        return self._loop.observe(*state, self._controls_in_force)

    def _controls_in_force(self) -> Sequence[float]:
        """The controls at the present state; MuJoCo keeps those of its last integrator stage."""
        data, every = self.data, self._control_steps
        if every > 0 and self._steps_taken % every != 0:
            return list(data.ctrl.tolist())
        state = data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
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
    vehicle, simulation, loop = scenario.vehicle, scenario.simulation, loop_of(scenario)
    try:
        model = compile_model(
            vehicle.model,
            vehicle.resolve(),
            timestep=simulation.timestep,
            integrator=simulation.integrator,
            userdata_size=userdata_size,
            tilt_servo=TiltServo(**vehicle.tilt_servo.model_dump(exclude={"max_rate"})),
            pod=Pod(**vehicle.pod.model_dump()),
            rotor_limits=RotorLimits(vehicle.min_rotor_speed, vehicle.max_rotor_speed),
            law_states=loop.law_states,
            extra_actuators=loop.extra_actuators,
            visuals=visuals,
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
        self._equations, self._setup = loop.equations, setup
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

            self._advance = compile_stepper(self._equations)
            self._law = native_record(loop, setup.userdata)
        else:
            self._advance = thesis_plant.make_stepper(self._equations.inputs, self._equations.rates)
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
        native = self.engine == "native"
        state = np.array(self._state) if native else self._state
        try:
            state, self._held = self._advance(
                *(self._step_index, state, self._held, self._timestep, steps),
                *(self._control_steps, *self._law, self._disturbance),
            )
            self._state = list(state)
        except (ArithmeticError, ValueError):
            self._fault = "the control law left the range of floating-point numbers"
        self._step_index += steps

    def observe(self) -> tuple[float, ...]:
        """See `Plant.observe`."""
        return self._equations.observe(self.time, self._state, self._inputs_in_force, self._setup)

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
