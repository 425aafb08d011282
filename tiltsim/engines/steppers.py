"""Integration of the equations of motion: as Python on floats, and as machine code."""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, lru_cache, partial
from typing import Any, Literal, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import ProgramKey
from tiltsim.closed_loop.loop import Equations
from tiltsim.engines.glue import stepper_text
from tiltsim.engines.machine_code import MachineCode, lane_math
from tiltsim.engines.programs import (
    HEAD_SIZE,
    KEPT,
    SIDES,
    UNLIMITED,
    LoopFunction,
    LoopPrograms,
    Recorder,
    setup_of,
)
from tiltsim.system.files import one_thread_at_a_time
from tiltsim_controllers.code.llvm_text import llvm_functions
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values


class Layout(NamedTuple):
    """Flights with equal layouts can fly side by side."""

    key: ProgramKey  # key of their programs
    states: int  # number of states
    solver: str  # see `tiltsim.equations.solvers.SOLVERS`
    held: bool  # whether the controller is sampled and held
    functions: Literal["exact", "quick"] = "exact"
    """Sines and their inverses of several lanes: exact or quick."""

    @property
    def equations(self) -> Equations:
        """The equations of the loop."""
        return self.key.loop.required_equations

    @property
    def size(self) -> int:
        """Number of states and inputs in force."""
        return self.states + self.equations.inputs_size


class Integrated(NamedTuple):
    """A flight whose equations are integrated."""

    layout: Layout  # layout of its programs
    timestep: float  # s
    control_steps: int  # steps for which the inputs are held; 0: evaluated at every stage
    user: Floats  # parameters and knots, see `tiltsim.closed_loop.loop.ControlSetup.userdata`
    disturbance: Triple  # m/s^2, world axes
    traced: bool  # see `tiltsim.closed_loop.assembly.Assembly`

    @property
    def settings(self) -> tuple[float, ...]:
        """Time step and disturbance."""
        return (self.timestep, *self.disturbance)


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def _program(layout: Layout, name: str) -> Program:
    return _functions(layout)[name].traced()


def _functions(layout: Layout) -> dict[str, LoopFunction]:
    programs = LoopPrograms(layout.key)
    return programs.on_equations(layout.states, layout.solver, held=layout.held)


def _in_python(flight: Integrated, name: str, **fixed: Sequence[float]) -> Callable[..., Any]:
    """A function ``((index,), now) -> numbers`` of `LoopPrograms.on_equations`."""
    user, fixed = flight.user.tolist(), {"settings": flight.settings, **fixed}
    if flight.traced:
        return python_function(_program(flight.layout, name), name, fixed={"user": user, **fixed})
    return _functions(flight.layout)[name].plain(setup_of(flight.layout.key.loop, user), **fixed)


class PythonStepper:
    """Integrates on Python's floats."""

    def __init__(self, flight: Integrated) -> None:
        self._every = flight.control_steps or 1
        self._sampled = self._held = _in_python(flight, "step_sampled")
        if flight.control_steps:
            self._held = _in_python(flight, "step_held")

    def advance(self, step_index: int, now: Floats, steps: int) -> Floats:
        """State and inputs in force, shape (states + inputs,), some steps later.

        Args:
            step_index: Number of steps so far.
            now: State and inputs in force.
            steps: Number of steps to take.
        """
        values: Any = now.tolist()
        for index in range(step_index, step_index + steps):
            step = self._held if index % self._every else self._sampled
            values = step((float(index),), values)
        return np.array(values)


def observation(flight: Integrated) -> Callable[[int, Floats], Values]:
    """Samples without their time: ``(step_index, now) -> values``, as machine code takes them.

    ``now`` are the state and the inputs in force, shape (states + inputs,).
    """
    every, fields = flight.control_steps or 1, len(flight.layout.key.loop.sample_fields)
    sample = cache(partial(_in_python, flight, recorder=[0.0] * (HEAD_SIZE + SIDES)))

    def observe(index: int, now: Floats) -> Values:
        name = "sample_held" if index % every else "sample_sampled"
        return tuple(sample(name)((float(index),), now.tolist()))[1:fields]

    return observe


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def compile_stepper(layout: Layout, lanes: int) -> Any:
    """The function `tiltsim.engines.glue.STEPPER`."""
    whens = ("sampled", "held") if layout.held else ("sampled",)
    names = [f"{what}_{when}" for what in ("step", "sample") for when in whens]
    programs = {name: _program(layout, name) for name in names}
    width = len(layout.key.loop.sample_fields)
    checks = len(programs["sample_sampled"].block.results) - width - 1
    glue = stepper_text(layout.held, lanes, layout.size, width, checks)
    functions = lane_math(quick=layout.functions == "quick")
    code = MachineCode(llvm_functions(programs, lanes, functions) + glue)
    return code.function("advance", None, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 9)


class LaneStepper:
    """Flights side by side in the lanes of machine code, which does not hold Python's lock.

    Args:
        layout: That of all flights.
        lanes: Number of lanes.
        rows: Number of samples of a flight, at most.

    Attributes:
        now: State and inputs in force, shape (states + inputs, lanes).
        index: Number of steps so far, shape (1, lanes).
        heads: Heads of the recorders and signs to keep, shape (HEAD_SIZE + SIDES, lanes).
        saved: Index, state and inputs in force at the last sample, shape (1 + size, lanes).
    """

    def __init__(self, layout: Layout, lanes: int) -> None:
        self._advance = compile_stepper(layout, lanes)
        key, size = layout.key, layout.size
        self.index, self._every = np.zeros((1, lanes)), np.ones((1, lanes))
        self.now, self._other = np.zeros((size, lanes)), np.zeros((size, lanes))
        self._settings = np.zeros((4, lanes))
        self._user = np.zeros((key.loop.record_size + key.knots, lanes))
        self.heads, self.rows = np.zeros((HEAD_SIZE + SIDES, lanes)), np.zeros(lanes, np.int64)
        self.saved = np.zeros((1 + size, lanes))
        state = self.index, self._every, self.now, self._other
        arrays = *state, self._settings, self._user, self.heads, self.rows, self.saved
        self._addresses = [array.ctypes.data for array in arrays]

    def place(
        self,
        lane: int,
        flight: Integrated,
        now: Sequence[float],
        head: Sequence[float],
        rows: Floats | None,
    ) -> None:
        """Put a flight at its first step into a lane.

        Args:
            lane: Number of the lane, from 0.
            flight: The flight.
            now: State and inputs in force.
            head: Head of its recorder; see `tiltsim.engines.programs.recorder_head`.
            rows: Memory for its samples, which has to live as long as it is in the lane.
        """
        self.index[:, lane] = 0.0
        self._every[:, lane] = flight.control_steps or 1
        self.now[:, lane], self._settings[:, lane] = now, flight.settings
        self._user[:, lane] = flight.user
        self.heads[:, lane] = 0.0
        self.heads[: len(head), lane] = head
        self.rows[lane] = 0 if rows is None else rows.ctypes.data

    def advance(self, steps: int, *, until_one_is_over: bool = False) -> None:
        """Take some steps; less if all recordings are over, or if requested once one is."""
        self._advance(steps, until_one_is_over, *self._addresses)


class NativeStepper:
    """Integrates one flight as machine code, without holding Python's lock."""

    def __init__(self, flight: Integrated) -> None:
        self._lane = LaneStepper(flight.layout, 1)
        self._lane.place(0, flight, [0.0] * flight.layout.size, UNLIMITED, None)
        self._unlimited = self._lane.heads.copy()

    def advance(self, step_index: int, now: Floats, steps: int) -> Floats:
        """See `PythonStepper.advance`."""
        self._lane.heads[:] = self._unlimited
        self._lane.index[:], self._lane.now[:, 0] = step_index, now
        self._lane.advance(steps)
        return self._lane.now[:, 0].copy()

    def record(
        self, step_index: int, now: Floats, samples: int, steps: int, recorder: Recorder
    ) -> tuple[int, Floats]:
        """Integrate some intervals; a recorder takes a sample after each and may stop it early.

        Args:
            step_index: Number of steps so far.
            now: State and inputs in force.
            samples: Number of intervals.
            steps: Steps of an interval.
            recorder: Takes samples.

        Returns:
            The number of steps so far, and state and inputs in force.
        """
        lane = self._lane
        lane.index[:], lane.now[:, 0] = step_index, now
        lane.heads[:, 0] = recorder.head
        lane.rows[0] = recorder.rows.ctypes.data
        lane.advance(samples * steps)
        recorder.head[:] = lane.heads[:, 0]
        return int(lane.index[0, 0]), lane.now[:, 0].copy()
