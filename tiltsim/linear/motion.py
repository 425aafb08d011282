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
from math import ceil
from typing import Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly, program_key
from tiltsim.closed_loop.loop import ClosedLoop, Equations
from tiltsim.closed_loop.userdata import EVALUATIONS, EVALUATIONS_PER_STEP, HEADER_SIZE
from tiltsim.engines.base import EngineName
from tiltsim.engines.control import control_callback
from tiltsim.engines.programs import LoopPrograms
from tiltsim.laws.assembling import assemble
from tiltsim.linear import coordinates
from tiltsim.linear.hanging import Hanging, hung_in
from tiltsim.models.objects import FORCE
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.plant import EquationsPlant
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.code.arrays import program_of, xp
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.scalar import Floats, Values

LONG: Final = 1000
"""Steps, from which on a flight is long: worth a thread, and a derivative of fewer evaluations."""

SLACK: Final = 1e-9  # N

RECORDS: Final = "among_state"
"""Beginning of the names of the largest contact force and the time in contact so far."""

READINGS: Final = 3
"""Evaluations in which a controller finds the contact force that it makes."""

SETTLING_TIME: Final = 40.0  # s, flown at most to approach an orbit or a rest point
THREADS: Final = os.cpu_count() or 1
ROWS_PER_THREAD: Final = 4  # flights of a thread between reports of progress


class Motion(ABC):
    """A closed loop on its plant.

    Attributes:
        assembly: The flight; its controllers add the offsets to their commands to the vehicles.
        vehicles: The flight of each vehicle by the beginning of the names of its columns.
        aside: Names of coordinates on which nothing depends: turns of what hangs, and records.
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

    def swings(self, state: Floats) -> Floats:
        """Angles of the cables and their rates, in the order of ``hung``."""
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
    def flown(self, step: int, state: Floats, steps: int) -> Floats:
        """The state some physics steps after a step."""

    def flown_each(self, step: int, states: Sequence[Floats], steps: int) -> Iterator[Floats]:
        """The states ``steps`` physics steps after ``step``; NaN where a flight is lost.

        Long native flights are flown on all cores.
        """
        if self.engine == "native" and len(states) > 1 and steps >= LONG and not self.offsets.any():
            size = ROWS_PER_THREAD * THREADS
            for start in range(0, len(states), size):
                yield from self._together(step, states[start : start + size], steps)
            return
        for state in states:
            try:
                yield self.flown(step, state, steps)
            except (ArithmeticError, ValueError):
                yield np.full(len(state), np.nan)

    @abstractmethod
    def _together(self, step: int, states: Sequence[Floats], steps: int) -> list[Floats]:
        """`flown_each`, natively and on all cores."""

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

    @cached_property
    def _plant(self) -> EquationsPlant:
        return EquationsPlant(self._flown_assembly, self.engine)

    @cached_property
    def _varied(self) -> EquationsPlant:
        return EquationsPlant(self.assembly, "python")

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

    def flown(self, step: int, state: Floats, steps: int) -> Floats:
        plant = self._varied if self.offsets.any() else self._plant
        return self._flown_by(plant, step, state, steps)

    def _flown_by(self, plant: EquationsPlant, step: int, state: Floats, steps: int) -> Floats:
        held = self._equations.inputs_size
        plant.state = np.array((step, *state, *(0.0,) * held))  # a sample is due
        plant.advance(steps)
        return plant.state[1 : 1 + len(state)]

    def _together(self, step: int, states: Sequence[Floats], steps: int) -> list[Floats]:
        self._plant.advance(0)  # compiles before threads do

        def fly(state: Floats) -> Floats:
            plant = EquationsPlant(self._flown_assembly, self.engine)
            return self._flown_by(plant, step, state, steps)

        with ThreadPoolExecutor(THREADS) as pool:
            return list(pool.map(fly, states))

    def observed(self, time: float, state: Floats) -> Floats:
        values, setup = state.tolist(), self.assembly.setup
        inputs = self._equations.inputs(time, values, *setup)
        return np.array(self._equations.observe(time, values, inputs, *setup))


class MujocoMotion(Motion):
    """In MuJoCo; a state is `qpos`, `qvel` and `act`, of hung objects relative to a vehicle."""

    def _names(self) -> tuple[coordinates.Coordinates, tuple[coordinates.Input, ...]]:
        found = coordinates.mujoco_coordinates(self.assembly.loop, self.vehicles, self.scenario)
        inputs = [
            each._replace(name=prefix + each.name, vehicle=number)
            for number, (prefix, own) in enumerate(self.vehicles.items())
            for each in coordinates.control_inputs(own)
        ]
        return found, tuple(inputs)

    @cached_property
    def _hanging(self) -> Hanging:
        return Hanging(self._varied.model, self.hung)

    @cached_property
    def _varied(self) -> MujocoPlant:
        return MujocoPlant(self.assembly, engine="python")

    @cached_property
    def _plant(self) -> MujocoPlant:
        return MujocoPlant(self._flown_assembly, self._varied.model, self.engine)

    @cached_property
    def _whole(self) -> Floats:
        """An integration state: time, `qpos`, `qvel`, `act` and more."""
        return self._varied.state

    @cached_property
    def initial(self) -> Floats:
        return self._read(self._whole)

    @property
    def _part(self) -> slice:
        model = self._varied.model
        return slice(1, 1 + model.nq + model.nv + model.na)

    def _read(self, whole: Floats) -> Floats:
        """The state of an integration state."""
        return self.placed(self._hanging.moved(whole[self._part], self._hanging.of_state, -1.0))

    def _split(self, state: Floats) -> list[Floats]:
        model = self._varied.model
        return np.split(state, (model.nq, model.nq + model.nv))

    def _set(self, state: Floats, lengths: Floats | None = None) -> Any:
        """MuJoCo's data with a state, the objects on cables of given lengths (m) or their own."""
        data = self._varied.data
        whole = self._hanging.moved(state, self._hanging.of_state, 1.0)
        data.qpos[:], data.qvel[:], data.act[:] = self._split(whole)
        self._hanging.place(data, self._hanging.lengths if lengths is None else lengths)
        return data

    def placed(self, state: Floats) -> Floats:
        return self._hanging.moved(self._whole_part(state), self._hanging.of_state, -1.0)

    def _whole_part(self, state: Floats, lengths: Floats | None = None) -> Floats:
        """MuJoCo's `qpos`, `qvel` and `act` of a state; see `_set`."""
        data = self._set(state, lengths)
        return np.concatenate((data.qpos, data.qvel, data.act))

    def swings(self, state: Floats) -> Floats:
        return self._hanging.swings(self._set(state))

    def why_not_held(self, time: float, state: Floats) -> str:
        data, tensions, _, _ = self._forward(time, state)
        touching = self._varied.model.geom_bodyid[data.contact.geom]
        for name, tension in zip(self._hanging.names, tensions, strict=True):
            if tension <= SLACK:
                return f"{name} is slack at rest: let it end, or shorten it"
        for each, body in zip(self.hung, self._hanging.bodies, strict=True):
            if body in touching:
                return f"{each.prefix[:-1]} hangs and touches something at rest; part them"
        return ""

    @cached_property
    def _stretched(self) -> Floats | None:
        """Lengths (m) of stretched cables, after a flight, which is then steady if at rest."""
        if not self.hung:
            return None
        plant = self._plant
        plant.state = self._whole
        plant.advance(ceil(SETTLING_TIME / self.scenario.simulation.timestep))
        return None if plant.fault() else self._hanging.distances(plant.data)

    def _seen(self, readings: Floats) -> list[list[float]]:
        """Arguments of the functions of the loop: the vehicles' `qpos` and `qvel`, and `act`."""
        sizes, data = self.assembly.loop.sizes, self._varied.data
        act = np.concatenate((data.act, data.qpos[sizes.qpos :], readings))
        return [each.tolist() for each in (data.qpos[: sizes.qpos], data.qvel[: sizes.qvel], act)]

    def _readings(self, tensions: Floats) -> Floats:
        """The memories of the sensors of contact forces and tensions (N), as of this instant."""
        model, data = self._varied.model, self._varied.data
        found = np.zeros(model.nhistory)
        for sensor in np.flatnonzero(model.sensor_history[:, 0]):
            first, size = model.sensor_historyadr[sensor] + FORCE, model.sensor_dim[sensor]
            found[first : first + size] = data.sensordata[model.sensor_adr[sensor] :][:size]
            if model.sensor_objtype[sensor] == mujoco.mjtObj.mjOBJ_TENDON:
                found[first] = tensions[self._hanging.tendons == model.sensor_objid[sensor]].sum()
        return found

    @cached_property
    def _all_controls(self) -> Callable[..., Values]:
        """The controls at a time and state, and the controller's commands without offsets."""
        loop = self.assembly.loop

        def controls(setup: Any, time: Any, *parts: Any) -> Any:
            values = loop.controls(time[0], *parts, *setup)
            return (*values, *(each for own in self._commanded for each in own))

        qpos, qvel, act, _, *behind = loop.sizes
        return self._evaluated(controls, time=1, qpos=qpos, qvel=qvel, act=act + sum(behind))

    def _controls(self, time: float, readings: Floats) -> Values:
        values, first = self._all_controls((time,), *self._seen(readings)), self._varied.model.nu
        for number, own in enumerate(self._commanded):
            self._commanded[number] = values[first : first + len(own)]
            first += len(own)
        return values[: self._varied.model.nu]

    def rates(self, time: float, state: Floats) -> Floats:
        data, _, accelerations, _ = self._forward(time, state)
        rates = np.concatenate((data.qvel, accelerations, data.act_dot))
        return self._hanging.moved(rates, self._hanging.of_rates, -1.0)

    def _forward(self, time: float, state: Floats) -> tuple[Any, Floats, Floats, Floats]:
        """MuJoCo's data, tensions of the cables (N), accelerations, and readings of the sensors.

        A controller reads the contact forces of the last step, in the limit those of this instant.
        """
        model, data = self._varied.model, self._set(state)
        limited, tensions = model.tendon_limited.copy(), np.zeros(len(self._hanging.tendons))
        data.qacc_warmstart[:] = 0.0
        readings = np.zeros(model.nhistory)
        for _ in range(READINGS):
            data.ctrl[:] = self._controls(time, readings)
            model.tendon_limited[:] = 0  # `Hanging` holds the objects instead
            with control_callback(None):
                mujoco.mj_forward(model, data)
            model.tendon_limited[:] = limited
            before, readings = readings, self._readings(tensions)
            if np.allclose(readings, before, rtol=0.0, atol=1e-12):
                break
        accelerations, tensions = self._hanging.hold(data)
        return data, tensions, accelerations, self._readings(tensions)

    def limited(self, state: Floats) -> Floats:
        model, parts = self._varied.model, self._split(state)
        own = model.actuator_actadr[model.actuator_actlimited > 0]
        low, high = model.actuator_actrange[model.actuator_actlimited > 0].T
        activations = parts[-1].copy()
        activations[own] = np.clip(activations[own], low, high)
        return np.concatenate((*parts[:-1], activations))

    def flown(self, step: int, state: Floats, steps: int) -> Floats:
        plant = self._varied if self.offsets.any() else self._plant
        plant.state = self._whole_at(step, state)
        plant.advance(steps)
        if plant.fault():  # MuJoCo has reset the state
            return np.full(len(state), np.nan)
        return self._read(plant.state)

    def _whole_at(self, step: int, state: Floats) -> Floats:
        """An integration state after ``step`` physics steps."""
        whole = self._whole.copy()
        whole[self._part] = self._whole_part(state, self._stretched)
        if self.scenario.object:
            readings = self._forward(step * self.scenario.simulation.timestep, state)[3]
            memory = whole[self._part.stop :][: len(readings)]
            memory[readings != 0.0] = readings[readings != 0.0]
        header = whole[self._varied.header_offset :][:HEADER_SIZE]
        header[EVALUATIONS] = step * header[EVALUATIONS_PER_STEP]
        return whole

    def _together(self, step: int, states: Sequence[Floats], steps: int) -> list[Floats]:
        batch, places = self._batch, np.arange(len(states), dtype=np.int32)
        for place, state in enumerate(states):
            batch.state[place] = self._whole_at(step, state)
        batch.warning[:] = 0
        with control_callback(self._plant.callback):
            batch.rollout(steps, record=(), ids=places)
        lost = batch.warning[places].reshape(len(states), -1).any(axis=1)
        ends = [self._read(whole) for whole in batch.state[places]]
        return [np.full(len(end), np.nan) if fell else end for end, fell in zip(ends, lost)]

    @cached_property
    def _batch(self) -> Any:
        from mujoco.batch import Batch

        return Batch(self._plant.model, ROWS_PER_THREAD * THREADS, THREADS)

    def observed(self, time: float, state: Floats) -> Floats:
        data, _, _, readings = self._forward(time, state)
        return np.array(self.assembly.loop.observe(*self._seen(readings), data.ctrl.tolist()))


def make_motion(scenario: Scenario, engine: EngineName | None = None, late: bool = False) -> Motion:
    """The motion of a scenario on the plant that it requests; see `Motion`."""
    kind = MujocoMotion if scenario.simulation.plant == "mujoco" else EquationMotion
    return kind(scenario, engine, late)
