"""Equations of motion as the plant, either the thesis's equations or a rigid body's."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING

import numpy as np

from tiltsim.closed_loop.assembly import Assembly, program_key
from tiltsim.engines.base import EngineName
from tiltsim.engines.steppers import Integrated, Layout, NativeStepper, PythonStepper, observation
from tiltsim.plants.plant import Plant, choose_engine
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.arrays.flying import JaxStepper


def initial_state(assembly: Assembly) -> list[float]:
    """The state at time zero of a flight whose loop has equations."""
    equations = assembly.loop.equations
    assert equations is not None  # other scenarios are refused
    return [*map(float, equations.initial(assembly, assembly.setup))]


def layout_of(assembly: Assembly, states: int) -> Layout:
    """The layout of a flight whose loop has equations, by its number of states."""
    simulation = assembly.scenario.simulation
    key = program_key(assembly)
    held = simulation.control_steps > 0
    return Layout(key, states, simulation.solver, held, simulation.batch_functions)


def integrated(assembly: Assembly, layout: Layout) -> Integrated:
    """A flight as steppers need it."""
    simulation = assembly.scenario.simulation
    return Integrated(
        layout,
        simulation.timestep,
        simulation.control_steps,
        assembly.setup.userdata,
        assembly.scenario.disturbance_acceleration,
        assembly.traced,
    )


class EquationsPlant(Plant):
    """The equations of a loop, integrated by a solver of `tiltsim.equations.solvers`.

    Args:
        assembly: The flight; its loop has equations.
        engine: Default: the one that the scenario requests.
    """

    def __init__(self, assembly: Assembly, engine: EngineName | None = None) -> None:
        scenario, loop, setup = assembly.scenario, assembly.loop, assembly.setup
        assert loop.equations is not None  # other scenarios are refused
        self._assembly = assembly
        self._step_index = 0
        self._state = initial_state(assembly)
        self._held = (0.0,) * loop.equations.inputs_size
        self.engine: EngineName = choose_engine(assembly, engine)
        self._timestep = scenario.simulation.timestep
        flight = integrated(assembly, layout_of(assembly, len(self._state)))
        self._observe = observation(flight)
        self._stepper: PythonStepper | NativeStepper | JaxStepper
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

    def restart(self, saved: Floats) -> None:
        """Go to a state as lanes save it: the step count, the state and the inputs in force."""
        self._step_index, self._now = int(saved[0]), saved[1:]

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
        from tiltsim.engines.programs import Recorder

        checked = self._assembly.sign_check_values(self.time, self.observe())
        recorder = Recorder(self._assembly, samples, steps, steps, checked)
        found = self._native.record(self._step_index, self._now, samples, steps, recorder)
        self._step_index, self._now = found
        return None if recorder.terminated else recorder.samples

    def observe(self) -> tuple[float, ...]:
        try:
            return self._observe(self._step_index, self._now)
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._assembly.loop.sample_fields) - 1)

    def fault(self) -> str:
        return ""
