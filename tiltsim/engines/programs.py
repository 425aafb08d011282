"""The functions of a closed loop as programs of a few vectors."""

from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from typing import Any, Final, NamedTuple

from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.traced_numbers import FUNCTIONS, trace_scalar_code
from tiltsim.closed_loop.choices import Choices, ProgramKey
from tiltsim.closed_loop.limits import SINGULAR, WITHIN_LIMITS
from tiltsim.closed_loop.userdata import (
    EVALUATIONS,
    EVALUATIONS_PER_STEP,
    HEADER_SIZE,
    TIMESTEP,
    evaluation_time,
)
from tiltsim.engines.base import Vectors
from tiltsim.equations.solvers import Integration, make_step
from tiltsim_controllers.code.program import InputVector, Program
from tiltsim_controllers.code.tracing import Number, make
from tiltsim_controllers.mathematics.records import record_size, unflatten
from tiltsim_controllers.references.trajectories import ReferenceParameters

Traced = Callable[..., Iterable[Number]]

KEPT: Final = 64
"""Programs of each kind that are kept; each closed loop, gait type and decoupler has its own."""

SIDES: Final = 17
"""Largest number of sign checks of a loop."""


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


class LoopPrograms:
    """Traces the functions of a loop, whose choices are constants.

    Args:
        key: See `tiltsim.closed_loop.choices`.
    """

    def __init__(self, key: ProgramKey) -> None:
        self._loop, self._key = key.loop, key

    def _setup(self, user: InputVector) -> tuple[Any, InputVector]:
        """Parameters and knots from their vector."""
        loop, choices = self._loop, self._key.parameters
        parameters = record_with_choices(loop.parameters, user, choices)
        return parameters, user[loop.record_size :]

    @property
    def user_size(self) -> int:
        """Number of parameters and knots."""
        return self._loop.record_size + self._key.knots

    def in_mujoco(self, *names: str) -> dict[str, Program]:
        """Programs of MuJoCo's vectors.

        Args:
            names: "controls" and "hold", the control step at and between the samples of the
                controller; "observe", the values of a sample; and "sample", a sample as the
                recorder takes it.
        """
        loop, sampling = self._loop, self._loop.sampling
        sizes = loop.dynamics.sizes._asdict()
        state = {name: sizes[name] for name in (*Vectors._fields, "ctrl")}
        vectors = {"header": HEADER_SIZE, **state, "user": self.user_size}

        def act_of(act: InputVector, *behind: InputVector) -> Any:
            seen = tuple(number for vector in behind for number in vector)
            return (*act, *seen) if seen else act

        def controls(lifting: Lifting, given: Sequence[InputVector]) -> Any:
            header, qpos, qvel, *act, _, user = given
            time = _next_time(lifting, header)
            return lifting(sampling.controls)(time, qpos, qvel, act_of(*act), *self._setup(user))

        def hold(lifting: Lifting, given: Sequence[InputVector]) -> Any:
            header, qpos, qvel, *act, ctrl, user = given
            time, (parameters, _) = _next_time(lifting, header), self._setup(user)
            held = tuple(ctrl)
            return lifting(sampling.hold)(time, qpos, qvel, act_of(*act), held, parameters)

        def sample(lifting: Lifting, given: Sequence[InputVector]) -> Iterable[Number]:
            header, qpos, qvel, *act, ctrl, user, recorder = given
            count, per_step = header[EVALUATIONS], header[EVALUATIONS_PER_STEP]
            start = make("mul", make("div", count, per_step), header[TIMESTEP])
            values = lifting(loop.columns.observe)(qpos, qvel, act_of(*act), tuple(ctrl))
            return self._checked(lifting, start, values, user, recorder)[0]

        def observe(lifting: Lifting, given: Sequence[InputVector]) -> Iterable[Number]:
            _, qpos, qvel, *act, ctrl, _ = given
            return lifting(loop.columns.observe)(qpos, qvel, act_of(*act), tuple(ctrl))

        functions = {"controls": controls, "hold": hold, "observe": observe, "sample": sample}
        sizes = {"sample": {**vectors, "recorder": HEAD_SIZE + SIDES}}
        return {n: trace_scalar_code(functions[n], **sizes.get(n, vectors)) for n in names}

    def on_equations(self, states: int, solver: str, held: bool, *names: str) -> dict[str, Program]:
        """Programs of the equations' state with the inputs in force.

        Args:
            states: Number of states.
            solver: See `tiltsim.equations.solvers.SOLVERS`.
            held: Whether the controller is sampled and held.
            names: "step_sampled" and "sample_sampled", a step and a sample of the flight at a
                sample of the controller; "step_held" and "sample_held", between two. The results
                of a sample are its fields, whether it ends the flight, and the signs that the
                next one has to keep.
        """
        equations = self._loop.equations
        assert equations is not None  # other loops do not fly on equations
        step, size = make_step(equations, solver), states + equations.inputs_size

        def stepped(samples: bool) -> Traced:
            def run(lifting: Lifting, given: Sequence[InputVector]) -> Iterable[Number]:
                (index,), now, (timestep, *disturbance), user = given
                setup = *self._setup(user), tuple(disturbance)
                integration = Integration(timestep, int(held), *setup)
                time, force = make("mul", index, timestep), tuple(now[states:])
                state, force = lifting(step)(time, list(now[:states]), force, samples, integration)
                return (*state, *force)

            return run

        def sampled(samples: bool) -> Traced:
            def run(lifting: Lifting, given: Sequence[InputVector]) -> Iterable[Number]:
                (index,), now, (timestep, *_), user, recorder = given
                time, setup = make("mul", index, timestep), self._setup(user)
                state, force = list(now[:states]), now[states:]
                if samples:
                    force = lifting(equations.inputs)(time, state, *setup)
                values = lifting(equations.observe)(time, state, tuple(force), *setup)
                sample, checked = self._checked(lifting, time, values, user, recorder)
                return *sample, *(make("copysign", 1.0, number) for number in checked)

            return run

        sizes = {"index": 1, "now": size, "settings": 4, "user": self.user_size}
        recorded = {**sizes, "recorder": HEAD_SIZE + SIDES}
        kinds = {"step": (stepped, sizes), "sample": (sampled, recorded)}

        def traced(name: str) -> Program:
            what, _, when = name.partition("_")
            function, vectors = kinds[what]
            return trace_scalar_code(function(when == "sampled"), **vectors)

        return {name: traced(name) for name in names}

    def _checked(
        self,
        lifting: Lifting,
        time: Number,
        values: Iterable[Number],
        user: InputVector,
        recorder: InputVector,
    ) -> tuple[tuple[Number, ...], tuple[Number, ...]]:
        """A sample and whether it ends the flight as the monitor would; numbers with sign checks.

        A sign that is zero in the recorder is not known yet.
        """
        loop, values, (parameters, knots) = self._loop, tuple(values), self._setup(user)
        reference = record_with_choices(
            ReferenceParameters, recorder[REFERENCE:], self._key.reference
        )
        checked = tuple(lifting(loop.monitoring.sign_check_values)(time, values, parameters, knots))
        follows = make("ne", recorder[REFERENCE - 1], 0.0)
        code = lifting(loop.kind.limit_exceeded)(time, values, reference, knots, follows)
        ends = make("ne", code, float(WITHIN_LIMITS))
        for value in values:
            ends = make("or", ends, make("not", FUNCTIONS[isfinite](value)))
        for number, before in zip(checked, recorder[HEAD_SIZE:]):
            vanishes = make("lt", make("abs", number), SINGULAR)
            differs = make("ne", make("copysign", 1.0, number), before)
            crossed = make("and", make("ne", before, 0.0), differs)
            ends = make("or", ends, make("or", vanishes, crossed))
        return (time, *values, ends), checked


def record_with_choices(
    record: type[tuple[Any, ...]], numbers: InputVector, choices: Choices
) -> Any:
    """A record whose choices are constants.

    Args:
        record: Its type.
        numbers: The numbers of the flattened record, or more.
        choices: See `tiltsim.closed_loop.choices`.
    """
    known = dict(choices)
    size = record_size(record)
    return unflatten(record, (known[i] if i in known else numbers[i] for i in range(size)))


def _next_time(lifting: Lifting, header: InputVector) -> Number:
    """The time (s) of the next evaluation of the control step."""
    numbers = header[EVALUATIONS], header[EVALUATIONS_PER_STEP], header[TIMESTEP]
    return lifting(evaluation_time)(*numbers)
