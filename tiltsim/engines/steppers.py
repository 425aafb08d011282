"""Integration of the equations of motion: as Python on floats, and as machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from tiltsim.closed_loop.choices import ProgramKey
from tiltsim.closed_loop.loop import Equations
from tiltsim.engines.glue import RECORDER, STEPPER, filled
from tiltsim.engines.machine_code import MachineCode
from tiltsim.engines.programs import HEAD_SIZE, SIDES, LoopPrograms
from tiltsim.engines.recorder import Recorder
from tiltsim.equations.solvers import Integration, make_step
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.code.llvm_text import llvm_functions
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.records import record_size, unflatten
from tiltsim_controllers.mathematics.scalar import Floats, Triple


class Integrated(NamedTuple):
    """A flight whose equations are integrated.

    Attributes:
        key: Of its programs.
        states: Number of states.
        solver: See `tiltsim.equations.solvers.SOLVERS`.
        timestep: s.
        control_steps: Steps for which the inputs are held; 0: evaluated at every stage.
        user: Parameters and knots, see `tiltsim.closed_loop.loop.ControlSetup.userdata`.
        disturbance: m/s^2, world axes.
        traced: See `tiltsim.closed_loop.assembly.Assembly`.
    """

    key: ProgramKey
    states: int
    solver: str
    timestep: float
    control_steps: int
    user: Floats
    disturbance: Triple
    traced: bool

    @property
    def equations(self) -> Equations:
        """Its equations."""
        equations = self.key.loop.equations
        assert equations is not None  # other loops do not fly on equations
        return equations

    @property
    def settings(self) -> tuple[float, ...]:
        """Time step and disturbance."""
        return (self.timestep, *self.disturbance)


class Stepper(Protocol):
    """Integrates the equations of a flight."""

    def advance(self, step_index: int, now: Floats, steps: int) -> Floats:
        """State and inputs in force, shape (states + inputs,), some steps later.

        Args:
            step_index: Number of steps so far.
            now: State and inputs in force.
            steps: How many steps to take.
        """


@one_thread_at_a_time
@cache
def _programs(key: ProgramKey, states: int, solver: str, held: bool) -> Mapping[str, Program]:
    return LoopPrograms(key).on_equations(states, solver, held)


class PythonStepper(Stepper):
    """Integrates on Python's floats."""

    def __init__(self, flight: Integrated) -> None:
        self._every = flight.control_steps or 1
        step = _traced_step if flight.traced else _plain_step
        self._sampled = step(flight, True)
        self._held = step(flight, False) if flight.control_steps else self._sampled

    def advance(self, step_index: int, now: Floats, steps: int) -> Floats:
        values: Any = now.tolist()
        for index in range(step_index, step_index + steps):
            step = self._held if index % self._every else self._sampled
            values = step((float(index),), values)
        return np.array(values)


Step = Callable[[tuple[float], list[float]], Sequence[float]]
"""``((index,), now) -> now``: one step."""


def _traced_step(flight: Integrated, samples: bool) -> Step:
    programs = _programs(flight.key, flight.states, flight.solver, flight.control_steps > 0)
    name = "step_sampled" if samples else "step_held"
    fixed = {"settings": flight.settings, "user": flight.user.tolist()}
    return python_function(programs[name], name, fixed=fixed)


def _plain_step(flight: Integrated, samples: bool) -> Step:
    one_step = make_step(flight.equations, flight.solver)
    record, size = flight.key.loop.parameters, record_size(flight.key.loop.parameters)
    numbers = flight.user.tolist()
    setup = unflatten(record, numbers), tuple(numbers[size:])
    timing = flight.timestep, flight.control_steps
    integration = Integration(*timing, *setup, flight.disturbance)

    def step(index: tuple[float], now: list[float]) -> list[float]:
        time, state, held = index[0] * flight.timestep, now[: flight.states], now[flight.states :]
        state, force = one_step(time, state, tuple(held), samples, integration)
        return [*state, *force]

    return step


@one_thread_at_a_time
@cache
def _compile(key: ProgramKey, states: int, solver: str, held: bool) -> Any:
    kind = "held" if held else "sampled"
    glue = filled(
        STEPPER + RECORDER,
        step_held=f"step_{kind}",
        sample_held=f"sample_{kind}",
        width=len(key.loop.sample_fields),
        rows_at=HEAD_SIZE + SIDES,
    )
    code = MachineCode(llvm_functions(_programs(key, states, solver, held)) + glue)
    return code.function("advance", None, *[ctypes.c_int64] * 3, *[ctypes.c_void_p] * 5)


class NativeStepper(Stepper):
    """Integrates as machine code, without holding Python's lock."""

    def __init__(self, flight: Integrated) -> None:
        held = flight.control_steps > 0
        self._advance = _compile(flight.key, flight.states, flight.solver, held)
        self._every = flight.control_steps or 1
        self._settings, self._user = np.array(flight.settings), np.ascontiguousarray(flight.user)

    def advance(self, step_index: int, now: Floats, steps: int) -> Floats:
        return self.record(step_index, now, 1, steps, None)[1]

    def record(
        self, step_index: int, now: Floats, samples: int, steps: int, recorder: Recorder | None
    ) -> tuple[int, Floats]:
        """Integrate some intervals; a recorder takes a sample after each and may stop it early.

        Args:
            step_index: Number of steps so far.
            now: State and inputs in force.
            samples: Number of intervals.
            steps: Steps of an interval.
            recorder: Takes samples, or None.

        Returns:
            The number of steps so far, and state and inputs in force.
        """
        index, now = np.array([float(step_index)]), now.copy()
        memory = None if recorder is None else int(recorder.address)
        arrays = (index, now, self._settings, self._user)
        self._advance(samples, steps, self._every, *(a.ctypes.data for a in arrays), memory)
        return int(index[0]), now
