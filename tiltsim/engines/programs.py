"""The functions of a closed loop as programs of a few vectors; memory for recorded samples."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import copysign, inf
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly, Choices, ProgramKey
from tiltsim.closed_loop.limits import SINGULAR, WITHIN_LIMITS
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.closed_loop.userdata import (
    EVALUATIONS,
    EVALUATIONS_PER_STEP,
    HEADER_SIZE,
    TIMESTEP,
    evaluation_time,
)
from tiltsim.engines.base import Vectors
from tiltsim.equations.solvers import Integration, make_step
from tiltsim.scenario.interaction import MAX_COMPANIONS
from tiltsim.system.files import one_thread_at_a_time
from tiltsim_controllers.code.arrays import as_arrays, program_of, xp
from tiltsim_controllers.code.arrays import flatten as flattened
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.mathematics.records import flatten, record_size, unflatten
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.references.trajectories import ReferenceParameters

KEPT: Final = 64
"""Programs of each kind that are kept; each closed loop, gait type and decoupler has its own."""

SIDES: Final = 17 * (1 + MAX_COMPANIONS)  # largest number of sign checks of a loop


class RecorderHead(NamedTuple):
    """The head of a recorder's memory; `SIDES` floats and the samples follow."""

    left: float  # evaluations before the next sample
    interval: float  # evaluations between samples
    last_interval: float  # evaluations between the last two samples
    samples: float  # taken so far
    capacity: float  # maximum number of samples
    terminated: float  # 1 once a sample has ended the flight
    follows_position: float  # whether the horizontal position has a limit
    reference: ReferenceParameters


HEAD_SIZE: Final = record_size(RecorderHead)
REFERENCE: Final = HEAD_SIZE - record_size(ReferenceParameters)


class LoopFunction(NamedTuple):
    """A function of vectors."""

    call: Callable[..., Any]  # returns numbers, arrays and tuples of them
    sizes: dict[str, int]  # sizes of its vectors, by name; ``user`` are parameters and knots

    def traced(self) -> Program:
        """Its program."""
        return program_of(self.call, **self.sizes)

    def plain(self, setup: ControlSetup, **fixed: Sequence[float]) -> Callable[..., list[float]]:
        """The function itself, where it cannot be traced, with some of its vectors bound."""
        bound = {"user": as_arrays(setup), **as_arrays(fixed)}

        def call(*vectors: Sequence[float]) -> list[float]:
            rest = iter(vectors)
            given = [bound[n] if n in bound else np.array(next(rest), float) for n in self.sizes]
            with np.errstate(all="ignore"):  # infinity and NaN, as in a program
                return [float(value) for value in flattened(self.call(*given))[0]]

        return call


class LoopPrograms:
    """Traces the functions of a loop, whose choices are constants.

    Args:
        key: See `tiltsim.closed_loop.assembly`.
    """

    def __init__(self, key: ProgramKey) -> None:
        self._loop, self._key = key.loop, key

    def setup(self, user: Any) -> tuple[Any, Any]:
        """Parameters and knots from their vector, or as they are."""
        if isinstance(user, ControlSetup):
            return user
        loop, choices = self._loop, self._key.parameters
        parameters = record_with_choices(loop.parameters, user, choices)
        return parameters, user[loop.record_size :]

    @property
    def user_size(self) -> int:
        """Number of parameters and knots."""
        return self._loop.record_size + self._key.knots

    def functions_in_mujoco(self) -> dict[str, LoopFunction]:
        """Functions of MuJoCo's vectors.

        "controls" and "hold" are the control step at and between the samples of the controller,
        "observe" the values of a sample, "sample" a sample as the recorder takes it.
        """
        loop = self._loop
        sizes = loop.sizes._asdict()
        state = {name: sizes[name] for name in (*Vectors._fields, "ctrl")}
        vectors = {"header": HEADER_SIZE, **state, "user": self.user_size}

        def controls(header: Any, qpos: Any, qvel: Any, *given: Any) -> Any:
            *act, _, user = given
            return loop.controls(_next_time(header), qpos, qvel, xp.hstack(act), *self.setup(user))

        def hold(header: Any, qpos: Any, qvel: Any, *given: Any) -> Any:
            (*act, ctrl, user), time = given, _next_time(header)
            return loop.hold(time, qpos, qvel, xp.hstack(act), ctrl, self.setup(user)[0])

        def observe(_header: Any, qpos: Any, qvel: Any, *given: Any) -> Any:
            *act, ctrl, _ = given
            return loop.observe(qpos, qvel, xp.hstack(act), ctrl)

        def sample(header: Any, *given: Any) -> Any:
            *_, user, recorder = given
            start = header[EVALUATIONS] / header[EVALUATIONS_PER_STEP] * header[TIMESTEP]
            return self._checked(start, observe(header, *given[:-1]), user, recorder)[0]

        functions = {"controls": controls, "hold": hold, "observe": observe}
        recorded = {**vectors, "recorder": HEAD_SIZE + SIDES}
        found = {name: LoopFunction(function, vectors) for name, function in functions.items()}
        return {**found, "sample": LoopFunction(sample, recorded)}

    def on_equations(self, states: int, solver: str, *, held: bool) -> dict[str, LoopFunction]:
        """Functions of the equations' state with the inputs in force.

        "step_sampled" and "sample_sampled" are a step and a sample of the flight at a sample of the
        controller, "step_held" and "sample_held" between two. The results of a sample are its
        fields, whether it ends the flight, and the signs that the next one has to keep.

        Args:
            states: Number of states.
            solver: See `tiltsim.equations.solvers.SOLVERS`.
            held: Whether the controller is sampled and held.
        """
        equations = self._loop.required_equations
        step, size = make_step(equations, solver), states + equations.inputs_size

        def stepped(samples: bool) -> Callable[..., Any]:
            def run(index: Any, now: Any, settings: Any, user: Any) -> Any:
                timestep, setup = settings[0], self.setup(user)
                integration = Integration(timestep, int(held), *setup, settings[1:])
                return step(index[0] * timestep, now[:states], now[states:], samples, integration)

            return run

        def sampled(samples: bool) -> Callable[..., Any]:
            def run(index: Any, now: Any, settings: Any, user: Any, recorder: Any) -> Any:
                time, setup = index[0] * settings[0], self.setup(user)
                state, force = now[:states], now[states:]
                if samples:
                    force = equations.inputs(time, state, *setup)
                values = equations.observe(time, state, force, *setup)
                sample, checked = self._checked(time, values, user, recorder)
                return sample, xp.copysign(1.0, checked)

            return run

        sizes = {"index": 1, "now": size, "settings": 4, "user": self.user_size}
        recorded = {**sizes, "recorder": HEAD_SIZE + SIDES}
        kinds = {"step": (stepped, sizes), "sample": (sampled, recorded)}

        return {
            f"{what}_{when}": LoopFunction(make(when == "sampled"), vectors)
            for what, (make, vectors) in kinds.items()
            for when in ("sampled", "held")
        }

    def _checked(self, time: Any, values: Any, user: Any, recorder: Any) -> tuple[Any, Any]:
        """A sample and whether it ends the flight as the monitor would; numbers with sign checks.

        A sign that is zero in the recorder is not known yet.
        """
        limit, checked = self._checks(time, values, user, recorder[REFERENCE - 1 : HEAD_SIZE])
        before = recorder[HEAD_SIZE : HEAD_SIZE + len(checked)]
        crossed = (before != 0.0) & (xp.copysign(1.0, checked) != before)
        ends = limit != float(WITHIN_LIMITS)
        for has_ended in (*~xp.isfinite(values), *((abs(checked) < SINGULAR) | crossed)):
            ends = ends | has_ended
        return xp.hstack([time, values, ends]), checked

    def _checks(self, time: Any, values: Any, user: Any, head: Any) -> tuple[Any, Any]:
        """The code of the limit that a sample exceeds, and the numbers whose signs are checked.

        ``head`` is whether the horizontal position has a limit, and the reference.
        """
        loop, (parameters, knots) = self._loop, self.setup(user)
        reference = record_with_choices(ReferenceParameters, head[1:], self._key.reference)
        limit = loop.kind.limit_exceeded(time, values, reference, knots, head[0] != 0.0)
        checked = loop.sign_check_values(time, values, parameters, knots)
        return limit, xp.array(checked)

    def checks(self) -> Program:
        """The program of `_checks`, of the vectors time, values, head and user."""

        def run(time: Any, values: Any, head: Any, user: Any) -> Any:
            limit, checked = self._checks(time[0], values, user, head)
            return xp.hstack([limit, checked])

        sizes = {"values": len(self._loop.sample_fields) - 1, "head": HEAD_SIZE - REFERENCE + 1}
        return program_of(run, time=1, **sizes, user=self.user_size)


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def control_program(key: ProgramKey, name: str) -> Program:
    """The program of a function of `LoopPrograms.functions_in_mujoco`."""
    return LoopPrograms(key).functions_in_mujoco()[name].traced()


def setup_of(loop: ClosedLoop, user: Sequence[float]) -> ControlSetup:
    """Parameters and knots of a loop from their vector."""
    return ControlSetup(unflatten(loop.parameters, user), tuple(user[loop.record_size :]))


def record_with_choices(record: type[tuple[Any, ...]], numbers: Any, choices: Choices) -> Any:
    """A record of a type whose choices are constants, from the numbers of the flattened record."""
    known = dict(choices)
    size = record_size(record)
    return unflatten(record, (known[i] if i in known else numbers[i] for i in range(size)))


def _next_time(header: Any) -> Any:
    """The time (s) of the next evaluation of the control step."""
    return evaluation_time(header[EVALUATIONS], header[EVALUATIONS_PER_STEP], header[TIMESTEP])


SAMPLES, TERMINATED = map(RecorderHead._fields.index, ("samples", "terminated"))

UNLIMITED: Final = (inf, inf, inf, 0.0, inf)
"""The head, up to its capacity, of a recorder that never takes a sample."""


def recorder_head(
    assembly: Assembly, left: int, samples: int, interval: int, last_interval: int
) -> list[float]:
    """The head of a recorder.

    Args:
        assembly: The flight.
        left: Evaluations of the control step before the first sample.
        samples: How many to take.
        interval, last_interval: Evaluations between samples, and between the last two.
    """
    head = RecorderHead(
        left=left,
        interval=interval,
        last_interval=last_interval,
        samples=0.0,
        capacity=samples,
        terminated=0.0,
        follows_position=assembly.follows_position,
        reference=assembly.reference,
    )
    return [*flatten(head)]


class Recorder:
    """Memory for the samples of one flight, to which native code writes.

    The callback takes a sample before the step that ends an interval, the first after a full one.
    Once there is no room for more, or a sample ends the flight, it returns NaN controls.

    Args:
        assembly: The flight.
        samples: How many to take.
        interval: Evaluations of the control step between samples.
        checked: The numbers that must keep their signs, as they are now; see `ClosedLoop`.

    Attributes:
        head: The head and the signs to keep, shape (HEAD_SIZE + SIDES,).
        rows: All samples, shape (samples, len(loop.sample_fields)).
    """

    def __init__(
        self, assembly: Assembly, samples: int, interval: int, checked: Sequence[float]
    ) -> None:
        loop = assembly.loop
        width = len(loop.sample_fields)
        # After the last row there is room for the number that shows whether it ends the flight.
        self._memory = np.zeros(HEAD_SIZE + SIDES + samples * width + 1)
        self.head = self._memory[: HEAD_SIZE + SIDES]
        self.rows = self._memory[HEAD_SIZE + SIDES : -1].reshape(samples, width)
        self.head[:HEAD_SIZE] = recorder_head(assembly, interval, samples, interval, interval)
        if len(checked) > SIDES:
            raise ValueError(f"{loop.model}: {len(checked)} sign checks, at most {SIDES}")
        for index, value in enumerate(checked):
            self.head[HEAD_SIZE + index] = copysign(1.0, value)

    @property
    def address(self) -> float:
        """For the `Header` in `userdata`; exact, since addresses are below 2^53."""
        return float(self._memory.ctypes.data)

    @property
    def samples(self) -> Floats:
        """The samples so far that do not end the flight, shape (N, len(loop.sample_fields))."""
        return self.rows[: int(self.head[SAMPLES]) - self.terminated]

    @property
    def terminated(self) -> bool:
        """Whether the last sample ends the flight."""
        return bool(self.head[TERMINATED])
