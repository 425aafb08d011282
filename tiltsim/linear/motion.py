"""A closed loop on its plant as functions of its state, for derivatives.

The state is a vector of the plant's own numbers. Whichever plant, `Motion` gives the rates of its
minimal coordinates at a time, and the state some physics steps later, as flights have it.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.assembly import Assembly, program_key
from tiltsim.closed_loop.loop import ClosedLoop, Equations
from tiltsim.engines.base import EngineName
from tiltsim.engines.programs import LoopPrograms
from tiltsim.laws.assembling import assemble
from tiltsim.linear import coordinates
from tiltsim.linear.hanging import hung_in
from tiltsim.plants.plant import EquationsPlant, Plant
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.code.arrays import program_of, xp
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.scalar import Floats, Values

LONG: Final = 1000
"""Steps, from which on a flight is long: worth a thread, and a derivative of fewer evaluations."""

THREADS: Final = os.cpu_count() or 1
PLANTS_PER_THREAD: Final = 4  # between reports of progress

RECORDS: Final = "among_state"
"""Beginning of the names of the largest contact force and the time in contact so far."""


class Motion(ABC):
    """A closed loop on its plant.

    Attributes:
        assembly: The flight; its controllers add the offsets to their commands to the vehicles.
        vehicles: The flight of each vehicle by the beginning of the names of its columns.
        aside: Names of coordinates on which nothing depends: turns of hung objects, and records.
        hung: Objects that hang on cables.
        prefixes: Beginnings of the names of companions' and objects' coordinates.
        coordinates: Coordinates of its state.
        inputs: Names of the vehicles' inputs.
        offsets: Offsets of the inputs, shape (inputs,); zero unless they are varied.

    Args:
        scenario: The scenario to fly.
        engine: The engine that flies it.
        late: Whether the controller is taken as it flies with a latency, though there may be none.
    """

    def __init__(self, scenario: Scenario, engine: EngineName | None, late: bool = False) -> None:
        self.scenario, self.engine, self._late = scenario, engine, late
        self._commanded: list[Values] = []  # of each vehicle
        self._inputs: tuple[coordinates.Input, ...] = ()
        self.offsets = np.zeros(0)
        self.assembly = assemble(scenario, self._adapted)
        self.vehicles = coordinates.vehicles_of(self.assembly, self._as_flown)
        self.prefixes = coordinates.prefixes_of(scenario)
        self.hung = hung_in(scenario)
        self.coordinates, self._inputs = self._names()
        self.inputs = tuple(each.name for each in self._inputs)
        turning = (name for each in self.hung for name in each.turning)
        records = (name for name in self.coordinates.names if name.startswith(RECORDS))
        self.aside = (*turning, *records)
        self.offsets = np.zeros(len(self._inputs))

    def _as_flown(self, loop: ClosedLoop) -> ClosedLoop:
        """A controller without layers, or its replacement for a flight with a latency."""
        return loop.with_latency() if self._late and loop.with_latency else loop

    @cached_property
    def _flown_assembly(self) -> Assembly:
        """The flight without offsets."""
        return assemble(self.scenario, self._as_flown)

    def _adapted(self, loop: ClosedLoop) -> ClosedLoop:
        """A loop without layers, with offsets of its commands, whose changes a trace would miss."""
        loop, number = self._as_flown(loop), len(self._commanded)
        self._commanded.append(())
        equations = loop.equations
        if equations is not None:
            equations = replace(equations, inputs=self._with_offsets(equations.inputs, number))
        controls = self._with_offsets(loop.controls, number)
        return replace(loop, controls=controls, equations=equations, traced=False)

    def _evaluated(self, function: Callable[..., Any], **sizes: int) -> Callable[..., Values]:
        """A function of the loop on Python's floats, at the offsets of the moment.

        Args:
            function: ``(setup, *arrays) -> numbers``, by functions of the varied loop.
            sizes: The size of every array, by name.
        """
        flown = self._flown_assembly
        if not flown.traced:
            return lambda *given: function(self.assembly.setup, *given)
        programs = LoopPrograms(program_key(flown))

        def once(*given: Any) -> Any:
            *vectors, offsets, user = given
            present, self.offsets = self.offsets, offsets  # traced
            try:
                return function(programs.setup(user), *vectors)
            finally:
                self.offsets = present

        program = program_of(once, **sizes, offsets=len(self.offsets), user=programs.user_size)
        run = python_function(program, fixed={"user": flown.setup.userdata.tolist()})
        return lambda *given: run(*given, self.offsets.tolist())

    def _with_offsets(self, function: Callable[..., Values], vehicle: int) -> Callable[..., Values]:
        """A control step that adds the offsets and remembers the commands without them."""

        def step(*args: Any) -> Values:
            self._commanded[vehicle] = function(*args)
            values = list(self._commanded[vehicle])
            for each, added in zip(self._inputs, self.offsets.tolist(), strict=True):
                if each.vehicle == vehicle:
                    values[each.place] = values[each.place] + added * each.per_unit
            return tuple(values)

        return step

    def commanded(self, time: float, state: Floats) -> Floats:
        """The inputs that the controller commands, shape (inputs,)."""
        self.observed(time, state)
        commanded = ((self._commanded[each.vehicle][each.place], each) for each in self._inputs)
        return np.array([value / each.per_unit for value, each in commanded])

    @abstractmethod
    def _names(self) -> tuple[coordinates.Coordinates, tuple[coordinates.Input, ...]]:
        """The coordinates, and the inputs."""

    def why_not_held(self, time: float, state: Floats) -> str:
        """Why a state at rest is none of objects on taut cables alone; empty if it is."""
        return ""

    def placed(self, state: Floats) -> Floats:
        """The state with the objects that hang where their cables are as long as they are."""
        return state

    @property
    def swing_names(self) -> list[str]:
        """Names of the angles of the cables and their rates."""
        return [name for each in self.hung for name in each.swings]

    def swings(self, state: Floats) -> Floats:
        """Angles of the cables and their rates, by `swing_names`."""
        return np.zeros(0)

    @property
    @abstractmethod
    def initial(self) -> Floats:
        """The state at time zero."""

    @abstractmethod
    def rates(self, time: float, state: Floats) -> Floats:
        """Rates of the coordinates at a time, shape (coordinates,)."""

    @abstractmethod
    def limited(self, state: Floats) -> Floats:
        """The state as the end of a step leaves it: no rotor beyond its limits."""

    @abstractmethod
    def _made(self, assembly: Assembly, engine: EngineName | None) -> Plant:
        """A plant that flies an assembly of the scenario."""

    @cached_property
    def _plant(self) -> Any:
        return self._made(self._flown_assembly, self.engine)

    @cached_property
    def _varied(self) -> Any:
        """The plant whose inputs have offsets."""
        return self._made(self.assembly, "python")

    @abstractmethod
    def _whole(self, step: int, state: Floats) -> Floats:
        """The state of the plant after ``step`` physics steps."""

    @abstractmethod
    def _read(self, whole: Floats) -> Floats:
        """The state that is part of the plant's."""

    def _end(self, plant: Plant) -> Floats:
        """The state that a plant has reached; NaN where the flight is lost."""
        return np.full(len(self.initial), np.nan) if plant.fault() else self._read(plant.state)

    def flown(self, step: int, state: Floats, steps: int) -> Floats:
        """The state some physics steps after a step."""
        plant = self._varied if self.offsets.any() else self._plant
        plant.state = self._whole(step, state)
        plant.advance(steps)
        return self._end(plant)

    def flown_each(self, step: int, states: Sequence[Floats], steps: int) -> Iterator[Floats]:
        """The states ``steps`` physics steps after ``step``; NaN where a flight is lost.

        Long native flights are flown on all cores.
        """
        if self.engine == "native" and len(states) > 1 and steps >= LONG and not self.offsets.any():
            size = PLANTS_PER_THREAD * THREADS
            for first in range(0, len(states), size):
                yield from self._together(step, states[first : first + size], steps)
            return
        for state in states:
            try:
                yield self.flown(step, state, steps)
            except (ArithmeticError, ValueError):
                yield np.full(len(state), np.nan)

    def _together(self, step: int, states: Sequence[Floats], steps: int) -> list[Floats]:
        """`flown_each`, each on its own plant."""
        self._plant.advance(0)  # compiles before threads do
        plants = [self._made(self._flown_assembly, self.engine) for _ in states]
        for plant, state in zip(plants, states, strict=True):
            plant.state = self._whole(step, state)
        with ThreadPoolExecutor(THREADS) as pool:
            list(pool.map(lambda plant: plant.advance(steps), plants))
        return [self._end(plant) for plant in plants]

    @abstractmethod
    def observed(self, time: float, state: Floats) -> Floats:
        """The fields of a sample after its time."""


class EquationMotion(Motion):
    """On equations of motion."""

    def _names(self) -> tuple[coordinates.Coordinates, tuple[coordinates.Input, ...]]:
        inputs = coordinates.equation_inputs(self.assembly)
        return coordinates.equation_coordinates(self.assembly, len(self.initial)), inputs

    @cached_property
    def _equations(self) -> Equations:
        return self.assembly.loop.required_equations

    def _made(self, assembly: Assembly, engine: EngineName | None) -> Plant:
        return EquationsPlant(assembly, engine)

    @property
    def initial(self) -> Floats:
        return np.array(self._equations.initial(self.assembly, self.assembly.setup), dtype=float)

    @cached_property
    def _moved(self) -> Callable[..., Values]:
        """Rates of the state at a time."""
        disturbance = self.scenario.disturbance_acceleration

        def rates(setup: Any, time: Any, state: Any) -> Any:
            inputs = xp.array(self._equations.inputs(time[0], state, *setup))
            return self._equations.rates(time[0], state, inputs, *setup, disturbance)

        return self._evaluated(rates, time=1, state=len(self.initial))

    def rates(self, time: float, state: Floats) -> Floats:
        moved = self._moved((time,), state.tolist())
        return self.coordinates.rates(state, np.array(moved))

    def limited(self, state: Floats) -> Floats:
        project = self._equations.project_onto_limits
        parameters, _ = self.assembly.setup
        return state if project is None else np.array(project(state.tolist(), parameters))

    def _whole(self, step: int, state: Floats) -> Floats:
        return np.array((step, *state, *(0.0,) * self._equations.inputs_size))  # a sample is due

    def _read(self, whole: Floats) -> Floats:
        return whole[1 : len(whole) - self._equations.inputs_size]

    def observed(self, time: float, state: Floats) -> Floats:
        values, setup = state.tolist(), self.assembly.setup
        inputs = self._equations.inputs(time, values, *setup)
        return np.array(self._equations.observe(time, values, inputs, *setup))
