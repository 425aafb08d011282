"""The two plants behind one interface: MuJoCo, and the thesis' own equations."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Protocol

import mujoco
import numpy as np
import numpy.typing as npt

from controllers.gaits import tilt_reference
from controllers.records import slotted
from controllers.rotation import quaternion_from_euler
from controllers.vehicle import SPIN
from tiltsim import thesis_plant
from tiltsim.cache import native_code_is_cached
from tiltsim.control import TILTROTOR, tiltrotor_state
from tiltsim.engine import EngineName, control_callback, make_engine
from tiltsim.errors import InputError
from tiltsim.model import Pod, RotorLimits, TiltServo, compile_model
from tiltsim.parameters import ControlSetup, control_setup
from tiltsim.scenario import Scenario

Floats = npt.NDArray[np.float64]

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
        """The vehicle's state in the order of `STATE_FIELDS`, then the four tilt rates (rad/s)."""

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
        setup = control_setup(scenario)
        self.model = build_model(scenario, userdata_size=len(setup.userdata))
        # A diverged state must stay visible; by default MuJoCo would silently start over.
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.data = mujoco.MjData(self.model)
        self._control_steps = scenario.simulation.control_steps
        self._set_initial_state(scenario, setup)
        self.engine: EngineName = choose_engine(scenario)
        self._engine = make_engine(self.engine, TILTROTOR, self.model, self.data)

    def _set_initial_state(self, scenario: Scenario, setup: ControlSetup) -> None:
        initial, data = scenario.initial, self.data
        data.userdata[:] = setup.userdata
        data.qpos[:3] = initial.position
        data.qpos[3:7] = quaternion_from_euler(*initial.attitude)
        data.qpos[7:] = tilt_reference(0.0, setup.parameters.law.gait, setup.table)[:4]
        data.qvel[:3] = initial.velocity
        data.qvel[3:6] = initial.angular_velocity
        data.act[:] = np.multiply(SPIN, initial.rotor_speeds)
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
        self._engine = make_engine(self.engine, TILTROTOR, self.model, self.data)

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
        velocities = data.qvel.tolist()
        state = tiltrotor_state(data.qpos.tolist(), velocities, data.act.tolist())
        return (*state, *velocities[6:])

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


def build_model(
    scenario: Scenario, *, userdata_size: int = 0, visuals: bool = False
) -> mujoco.MjModel:
    """Compile the scenario's vehicle, with what is drawn of it only if asked.

    Raises `InputError` where MuJoCo cannot build it.
    """
    vehicle, simulation = scenario.vehicle, scenario.simulation
    try:
        return compile_model(
            vehicle.model,
            vehicle.resolve(),
            timestep=simulation.timestep,
            integrator=simulation.integrator,
            userdata_size=userdata_size,
            tilt_servo=TiltServo(**vehicle.tilt_servo.model_dump()),
            pod=Pod(**vehicle.pod.model_dump()),
            rotor_limits=RotorLimits(vehicle.min_rotor_speed, vehicle.max_rotor_speed),
            visuals=visuals,
        )
    except ValueError as error:
        raise InputError(f"{scenario.address or 'scenario'}: vehicle: {error}") from error


class ThesisPlant:
    """The thesis' equations with ode3; see `tiltsim.thesis_plant`."""

    def __init__(self, scenario: Scenario) -> None:
        simulation, initial = scenario.simulation, scenario.initial
        self._setup = control_setup(scenario)
        self._law = slotted(self._setup.parameters.law)
        self._timestep = simulation.timestep
        self._control_steps = simulation.control_steps
        self._step_index = 0
        self._state: list[float] = thesis_plant.plant_state(
            (
                *(*initial.position, *initial.velocity),
                *(*initial.attitude, *initial.angular_velocity, 0.0, 0.0, 0.0, 0.0),
                *(sign * speed for sign, speed in zip(SPIN, initial.rotor_speeds, strict=True)),
            )
        )
        self._fault = ""
        self.engine: EngineName = choose_engine(scenario)

    @property
    def time(self) -> float:
        """See `Plant.time`."""
        return self._step_index * self._timestep

    @property
    def state(self) -> Floats:
        """See `Plant.state`: the step count and the state of `tiltsim.thesis_plant`.

        The parameters are the scenario's and stay with the plant.
        """
        return np.array([self._step_index, *self._state])

    @state.setter
    def state(self, value: Floats) -> None:
        self._step_index = int(value[0])
        self._state = value[1:].tolist()
        self._fault = ""

    def advance(self, steps: int) -> None:
        """See `Plant.advance`."""
        if self.engine == "native":
            from tiltsim.native import advance_thesis_plant

            self._state = advance_thesis_plant(
                *(self._step_index, self._state, self._timestep, steps, self._control_steps),
                self._setup.userdata,
            )
        else:
            try:
                self._state = thesis_plant.advance(
                    *(self._step_index, self._state, self._timestep, steps, self._control_steps),
                    *(self._law, self._setup.table),
                )
            except (ArithmeticError, ValueError):
                self._fault = "the control law left the range of floating-point numbers"
        self._step_index += steps

    def observe(self) -> tuple[float, ...]:
        """See `Plant.observe`."""
        gait, table = self._setup.parameters.law.gait, self._setup.table
        state: tuple[float, ...] = thesis_plant.vehicle_state(self.time, self._state, gait, table)
        return (*state, *tilt_reference(self.time, gait, table)[4:])

    def fault(self) -> str:
        """See `Plant.fault`."""
        return self._fault
