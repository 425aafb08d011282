"""Equations of motion as the plant: the thesis's own, or those of a rigid body."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.choices import program_key
from tiltsim.engines.base import EngineName
from tiltsim.engines.steppers import Integrated, NativeStepper, PythonStepper, Stepper
from tiltsim.plants.engine_choice import choose_engine
from tiltsim.plants.flight_model import disturbance_acceleration
from tiltsim.plants.plant import Plant
from tiltsim_controllers.mathematics.scalar import Floats


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
        self.engine: EngineName = engine or choose_engine(scenario)
        simulation = scenario.simulation
        self._timestep, self._every = simulation.timestep, simulation.control_steps
        flight = Integrated(
            program_key(assembly),
            len(self._state),
            simulation.solver,
            self._timestep,
            self._every,
            setup.userdata,
            disturbance_acceleration(scenario),
            assembly.traced,
        )
        self._stepper: Stepper
        if self.engine == "native":
            self._native = self._stepper = NativeStepper(flight)
        elif self.engine == "jax":
            from tiltsim.arrays.flying import JaxStepper, course_of

            self._stepper = JaxStepper(course_of(assembly), setup, flight.disturbance)
        else:
            self._stepper = PythonStepper(flight)

    @property
    def time(self) -> float:
        return self._step_index * self._timestep

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

    @property
    def _now(self) -> Floats:
        """State and inputs in force."""
        return np.array([*self._state, *self._held])

    @_now.setter
    def _now(self, values: Floats) -> None:
        numbers, size = values.tolist(), len(self._state)
        self._state, self._held = numbers[:size], tuple(numbers[size:])

    def advance(self, steps: int) -> None:
        self._now = self._stepper.advance(self._step_index, self._now, steps)
        self._step_index += steps

    def record(self, samples: int, steps: int) -> Floats | None:
        if self.engine == "native":
            return self._record_natively(samples, steps)
        return super().record(samples, steps)

    def _record_natively(self, samples: int, steps: int) -> Floats | None:
        from tiltsim.engines.recorder import Recorder

        checked = self._assembly.sign_check_values(self.time, self.observe())
        recorder = Recorder(self._assembly, samples, steps, steps, checked)
        found = self._native.record(self._step_index, self._now, samples, steps, recorder)
        self._step_index, self._now = found
        return None if recorder.terminated else recorder.samples

    def observe(self) -> tuple[float, ...]:
        setup = self._setup
        try:
            return self._equations.observe(
                self.time, self._state, self._inputs_in_force(), setup.parameters, setup.knots
            )
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._assembly.loop.sample_fields) - 1)

    def _inputs_in_force(self) -> Sequence[float]:
        every = self._every
        if every > 0 and self._step_index % every != 0:
            return self._held
        try:
            setup = self._setup
            return self._equations.inputs(self.time, self._state, setup.parameters, setup.knots)
        except (ArithmeticError, ValueError):
            return [nan] * len(self._held)

    def fault(self) -> str:
        return ""
