"""The plant that integrates the thesis's own equations with its solver, ode3."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import Any

import numpy as np

from tiltsim.engines.base import EngineName
from tiltsim.engines.cache import mark_native_code_compiled
from tiltsim.equations import ode3 as thesis_plant
from tiltsim.laws.assembling import control_setup, loop_of
from tiltsim.plants.engine_choice import choose_engine
from tiltsim.plants.flight_model import disturbing_acceleration
from tiltsim.plants.mujoco_plant import watched_now
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.records import slotted
from tiltsim_controllers.mathematics.scalar import Floats


class ThesisPlant:
    """The thesis' equations with ode3; see `tiltsim.equations.ode3`."""

    def __init__(self, scenario: Scenario) -> None:
        simulation = scenario.simulation
        loop, setup = loop_of(scenario), control_setup(scenario)
        assert loop.equations is not None  # scenarios that ask for others are refused
        self._loop, self._equations, self._setup = loop, loop.equations, setup
        self._reference, _ = scenario.reference_and_knots()
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
        self._law: tuple[Any, Any]  # parameters and knots, as the stepper reads them
        if self.engine == "native":
            from tiltsim.engines.native_stepper import compile_stepper, native_record

            self._advance, self._record = compile_stepper(loop)
            self._law = native_record(loop, setup.userdata)
        else:
            self._advance = thesis_plant.make_stepper(self._equations)
            self._law = slotted(setup.parameters), setup.knots

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
        from tiltsim.engines.recorder import Recorder

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
        mark_native_code_compiled(self._loop.native_name("thesis"))
        self._step_index += samples * steps
        return None if recorder.lost else recorder.samples

    def observe(self) -> tuple[float, ...]:
        """See `Plant.observe`."""
        setup = self._setup
        try:
            return self._equations.observe(
                self.time, self._state, self._inputs_in_force(), setup.parameters, setup.knots
            )
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._loop.sample_fields) - 1)

    def _inputs_in_force(self) -> Sequence[float]:
        every = self._control_steps
        if every > 0 and self._step_index % every != 0:
            return self._held
        try:
            setup = self._setup
            return self._equations.inputs(self.time, self._state, setup.parameters, setup.knots)
        except (ArithmeticError, ValueError):
            return [nan] * len(self._held)

    def fault(self) -> str:
        """See `Plant.fault`."""
        return self._fault
