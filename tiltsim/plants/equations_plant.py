"""Equations of motion as the plant: the thesis's own, or those of a rigid body."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import Any

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.choices import program_key
from tiltsim.engines.base import EngineName
from tiltsim.equations.solvers import Integration, Stepper, make_stepper
from tiltsim.plants.engine_choice import choose_engine
from tiltsim.plants.flight_model import disturbance_acceleration
from tiltsim.plants.plant import Plant
from tiltsim_controllers.mathematics.records import slotted
from tiltsim_controllers.mathematics.scalar import Floats, Values


class EquationsPlant(Plant):
    """The equations of a loop, integrated by a solver of `tiltsim.equations.solvers`.

    Args:
        assembly: The flight; its loop has equations.
        engine: Default: the one that the scenario requests.
    """

    def __init__(self, assembly: Assembly, engine: EngineName | None = None) -> None:
        scenario, loop, setup = assembly.scenario, assembly.loop, assembly.setup
        assert loop.equations is not None  # other scenarios are refused
        self._assembly, self._equations, self._setup = assembly, loop.equations, setup
        self._step_index = 0
        self._state = list(map(float, self._equations.initial(assembly, setup)))
        self._held = (0.0,) * self._equations.inputs_size
        self._fault = ""
        self.engine: EngineName = engine or choose_engine(scenario)
        simulation, disturbance = scenario.simulation, disturbance_acceleration(scenario)
        solver, numbers = simulation.solver, (simulation.timestep, simulation.control_steps)
        record: tuple[Any, Any] = setup
        self._advance: Stepper
        if self.engine == "native":
            from tiltsim.engines.native_stepper import NativeStepper

            states = len(self._state)
            self._native = NativeStepper(
                program_key(assembly), states, solver, *numbers, setup.userdata, disturbance
            )
            self._advance = self._advance_natively
        elif self.engine == "jax":
            from tiltsim.arrays.flying import course_of, stepper_on_arrays

            self._advance = stepper_on_arrays(course_of(assembly))
        else:
            self._advance = make_stepper(self._equations, solver)
            record = slotted(setup.parameters), setup.knots
        self._integration = Integration(*numbers, *record, disturbance)

    @property
    def time(self) -> float:
        return self._step_index * self._integration.timestep

    @property
    def state(self) -> Floats:
        """The step count, the inputs held and the state of the equations.

        The parameters are not part of it.
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
        try:
            state, self._held = self._advance(
                self._step_index, self._state, self._held, steps, self._integration
            )
            self._state = list(map(float, state))  # numpy's own floats would warn of infinity
        except (ArithmeticError, ValueError):
            # Where floats raise, native code has NaN.
            self._state = [nan] * len(self._state)
            self._fault = "the control law left the range of floating-point numbers"
        self._step_index += steps

    def record(self, samples: int, steps: int) -> Floats | None:
        if self.engine == "native":
            return self._record_natively(samples, steps)
        return super().record(samples, steps)

    def _record_natively(self, samples: int, steps: int) -> Floats | None:
        from tiltsim.engines.recorder import Recorder

        checked = self._assembly.sign_check_values(self.time, self.observe())
        recorder = Recorder(self._assembly, samples, steps, steps, checked)
        now = np.array([*self._state, *self._held])
        self._step_index = self._native.advance(self._step_index, now, samples, steps, recorder)
        self._state, self._held = self._split(now)
        return None if recorder.terminated else recorder.samples

    def _advance_natively(
        self, step_index: int, state: list[float], held: Values, steps: int, _: Integration
    ) -> tuple[list[float], Values]:
        now = np.array([*state, *held])
        self._native.advance(step_index, now, 1, steps, None)
        return self._split(now)

    def _split(self, now: Floats) -> tuple[list[float], Values]:
        """State and inputs in force."""
        values = now.tolist()
        return values[: len(self._state)], tuple(values[len(self._state) :])

    def observe(self) -> tuple[float, ...]:
        setup = self._setup
        try:
            return self._equations.observe(
                self.time, self._state, self._inputs_in_force(), setup.parameters, setup.knots
            )
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._assembly.loop.sample_fields) - 1)

    def _inputs_in_force(self) -> Sequence[float]:
        every = self._integration.control_steps
        if every > 0 and self._step_index % every != 0:
            return self._held
        try:
            setup = self._setup
            return self._equations.inputs(self.time, self._state, setup.parameters, setup.knots)
        except (ArithmeticError, ValueError):
            return [nan] * len(self._held)

    def fault(self) -> str:
        return self._fault
