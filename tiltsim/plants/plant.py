"""The interface of plants, the choice of their engine, and equations of motion as a plant."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property
from math import nan
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from tiltsim.closed_loop.assembly import Assembly, program_key
from tiltsim.engines.base import EngineName
from tiltsim.engines.programs import Recorder
from tiltsim.engines.sample_evaluation import termination_checks
from tiltsim.engines.steppers import Integrated, Layout, NativeStepper, PythonStepper, observation
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats, Values

if TYPE_CHECKING:
    from tiltsim.arrays.flying import JaxStepper


class Plant(Protocol):
    """A vehicle under control, advanced step by step and restartable from its state."""

    _assembly: Assembly
    engine: EngineName
    state: Floats
    """Everything that the future depends on, as a vector; assign it to restart there."""

    @property
    def time(self) -> float:
        """Simulated time, s."""

    def advance(self, steps: int) -> None:
        """Take physics steps."""

    def record(self, samples: int, steps: int) -> Floats:
        """Take samples, one every ``steps`` physics steps, on the native engine.

        Returns:
            ``samples`` rows, all but the last checked, shape (samples, fields). Fewer where the
            flight ended on the way; the state of the plant is then undefined.
        """

    @cached_property
    def _checks(self) -> Callable[[float, Values], Values]:
        return termination_checks(self._assembly)

    def observe(self) -> tuple[float, ...]:
        """The present values of a sample's fields after the time: `ClosedLoop.sample_fields`."""

    def fault(self) -> str:
        """The fault that the physics engine has reported so far, in a few words; else empty."""


def take_sample(plant: Plant) -> Floats:
    """The present sample, shape (fields,); see `ClosedLoop.sample_fields`."""
    return np.array([plant.time, *plant.observe()])


MIN_STEPS_TO_COMPILE: Final = 4_000
"""Flights of at least this many steps repay compiling the native engine: it takes 0.1 to 0.4 s of
CPU, a step in Python 0.05 to 0.3 ms longer."""


def choose_engine(assembly: Assembly, engine: EngineName | None = None) -> EngineName:
    """The engine of a flight.

    ``auto`` weighs the flight's length against the time to compile. A user's own controller that is
    called at control samples, and a law that cannot be traced, always fly in Python.

    Args:
        assembly: The flight.
        engine: Engine in place of the scenario's.
    """
    scenario = assembly.scenario
    if scenario.controller.is_external or not assembly.loop.is_traceable:
        return "python"
    if engine is not None:
        return engine
    if scenario.simulation.engine != "auto":
        return scenario.simulation.engine
    return "native" if native_pays_off([scenario]) else "python"


def native_pays_off(scenarios: Iterable[Scenario]) -> bool:
    """Whether flights are together long enough for the native engine."""
    return sum(scenario.simulation.steps for scenario in scenarios) >= MIN_STEPS_TO_COMPILE


def with_engine(scenario: Scenario, engine: EngineName) -> Scenario:
    """The scenario with another engine; a user's own controller keeps its own, Python."""
    if scenario.controller.is_external:
        return scenario
    simulation = scenario.simulation.model_copy(update={"engine": engine})
    return scenario.model_copy(update={"simulation": simulation})


def initial_state(assembly: Assembly) -> list[float]:
    """The state at time zero of a flight whose loop has equations."""
    initial = assembly.loop.required_equations.initial(assembly, assembly.setup)
    return [*map(float, initial)]


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

    Its state is the step count, the state of the equations, and the inputs in force, as lanes save
    it; the parameters are not part of it.

    Args:
        assembly: The flight; its loop has equations.
        engine: Default: the one that the scenario requests.
    """

    def __init__(self, assembly: Assembly, engine: EngineName | None = None) -> None:
        scenario, loop, setup = assembly.scenario, assembly.loop, assembly.setup
        self._assembly = assembly
        start = initial_state(assembly)
        self.state = np.array([0.0, *start, *(0.0,) * loop.required_equations.inputs_size])
        self.engine: EngineName = choose_engine(assembly, engine)
        self._timestep = scenario.simulation.timestep
        flight = integrated(assembly, layout_of(assembly, len(start)))
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
    def _step_index(self) -> int:
        return int(self.state[0])

    @property
    def time(self) -> float:
        return self._step_index * self._timestep

    def advance(self, steps: int) -> None:
        now = self._stepper.advance(self._step_index, self.state[1:], steps)
        self.state = np.array([self._step_index + steps, *now])

    def record(self, samples: int, steps: int) -> Floats:
        checked = self._checks(self.time, self.observe())[1:]
        recorder = Recorder(self._assembly, samples, steps, checked)
        found = self._native.record(self._step_index, self.state[1:], samples, steps, recorder)
        self.state = np.array([found[0], *found[1]])
        return recorder.samples

    def observe(self) -> tuple[float, ...]:
        try:
            return self._observe(self._step_index, self.state[1:])
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._assembly.loop.sample_fields) - 1)

    def fault(self) -> str:
        return ""
