"""Flights on equations of motion in JAX: the step and the sample of a loop as programs."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from tiltsim.arrays.jax_programs import InJax, require_jax
from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.limits import SINGULAR, WITHIN_LIMITS
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.equations.solvers import Integration, make_step
from tiltsim.system.files import one_thread_at_a_time
from tiltsim_controllers.mathematics.records import flatten, record_size, unflatten
from tiltsim_controllers.mathematics.scalar import Floats, Triple
from tiltsim_controllers.references.trajectories import ReferenceParameters


@contextmanager
def double_precision() -> Iterator[None]:
    """JAX with 64-bit numbers, which it has not by default."""
    import jax

    with jax.enable_x64(True):
        yield


class Course(NamedTuple):
    """Loop and settings that the flights of a batch share."""

    loop: ClosedLoop
    timestep: float  # s
    control_steps: int
    record_steps: int
    steps: int
    follows_position: bool
    dtype: str
    solver: str  # see `tiltsim.equations.solvers.SOLVERS`


class Carried(NamedTuple):
    """The state of a flight on arrays."""

    index: Any  # of the step
    state: tuple[Any, ...]
    held: tuple[Any, ...]  # inputs since the last control sample


class Recording(NamedTuple):
    """Samples of a flight on arrays."""

    samples: Any  # (samples, fields), the first at time zero
    alive: Any  # whether the flight had not ended at each sample
    last: Carried  # the state at the last sample before its end


class Kernel:
    """Step and sample of a loop's equations on arrays, for one flight.

    Args:
        course: Loop and settings of the flight.
        setup: Parameters and knots, which may be arrays.
        disturbance: m/s^2, world axes.
    """

    def __init__(self, course: Course, setup: ControlSetup, disturbance: Triple) -> None:
        import jax
        import jax.numpy as jnp

        loop, equations = course.loop, course.loop.required_equations
        self._jax, self._numpy, self.course, self.setup = jax, jnp, course, setup
        run = InJax(course.dtype)
        self._step = run(make_step(equations, course.solver))
        self._inputs = run(equations.inputs)
        self._observe = run(equations.observe)
        self._check = run(loop.sign_check_values)
        self._limit = run(loop.kind.limit_exceeded)
        self._integration = Integration(
            course.timestep, course.control_steps, setup.parameters, setup.knots, disturbance
        )
        self._inputs_size = equations.inputs_size

    def _floats(self, values: Iterable[Any]) -> tuple[Any, ...]:
        return tuple(self._numpy.asarray(value, self.course.dtype) for value in values)

    def _vector(self, values: Iterable[Any]) -> Any:
        return self._numpy.stack(self._floats(values))

    def start(self, state: Iterable[Any]) -> Carried:
        """A flight at time zero."""
        return self.at(0, state, [0.0] * self._inputs_size)

    def at(self, index: int, state: Iterable[Any], held: Iterable[Any]) -> Carried:
        """A flight at a step."""
        whole = self._numpy.asarray(index, "int32")
        return Carried(whole, self._floats(state), self._floats(held))

    def time(self, index: Any) -> Any:
        """The time (s) of a step, exact before it is rounded."""
        exact = index.astype(self._numpy.result_type(float)) * self.course.timestep
        return exact.astype(self.course.dtype)

    def _with_sampling(self, index: Any, act: Callable[[bool], Any]) -> Any:
        """The result of ``act(samples)``, with ``samples`` whether the controller samples."""
        every = self.course.control_steps
        if every == 0:
            return act(True)
        return self._jax.lax.cond(index % every == 0, lambda: act(True), lambda: act(False))

    def step(self, carried: Carried) -> Carried:
        """One step later."""

        def take(samples: bool) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
            time = self.time(carried.index)
            state, held = self._step(
                time, list(carried.state), carried.held, samples, self._integration
            )
            return self._floats(state), self._floats(held)

        return Carried(carried.index + 1, *self._with_sampling(carried.index, take))

    def steps(self, carried: Carried, count: int) -> Carried:
        """So many steps later."""
        if count == 1:
            return self.step(carried)
        now: Carried
        now, _ = self._jax.lax.scan(lambda c, _: (self.step(c), None), carried, length=count)
        return now

    def sample(self, carried: Carried) -> Any:
        """The fields of a sample, shape (fields,)."""
        time, (parameters, knots) = self.time(carried.index), self.setup

        def take(samples: bool) -> Any:
            held = carried.held
            if samples:
                held = self._inputs(time, carried.state, parameters, knots)
            values = self._observe(time, carried.state, held, parameters, knots)
            return self._vector((time, *values))

        return self._with_sampling(carried.index, take)

    def sides(self, sample: Any) -> Any:
        """The signs of the numbers that must keep them, 0 where one vanishes."""
        checked = self._vector(self._check(sample[0], tuple(sample[1:]), *self.setup))
        return self._numpy.where(abs(checked) < SINGULAR, 0.0, self._numpy.sign(checked))

    def goes_on(self, sample: Any, sides: Any, reference: Any) -> Any:
        """Whether a flight with this sample goes on; ``sides``: the signs of its first sample."""
        now = self.sides(sample)
        kept = ((now == sides) & (now != 0.0)).all()
        follows = self.course.follows_position
        code = self._limit(sample[0], tuple(sample[1:]), reference, self.setup.knots, follows)
        return self._numpy.isfinite(sample).all() & kept & (code == WITHIN_LIMITS)

    def samples(self, carried: Carried) -> Any:
        """Samples from a state to the end of the duration, shape (samples, fields).

        Its derivative in reverse mode keeps the states at the samples alone, and flies each
        interval between two of them again.
        """
        jax, every = self._jax, self.course.record_steps
        full, rest = divmod(self.course.steps, every)

        @partial(jax.checkpoint, prevent_cse=False)  # which a scan does not need
        def interval(now: Carried, _: None) -> tuple[Carried, Carried]:
            return self.steps(now, every), now

        last, before = jax.lax.scan(interval, carried, length=full)
        ends = [last, self.steps(last, rest)] if rest else [last]
        join, stack = self._numpy.concatenate, self._numpy.stack
        states = jax.tree.map(lambda first, *later: join([first, stack(later)]), before, *ends)
        return jax.lax.map(self.sample, states)

    def record(self, state: Iterable[Any], reference: Any) -> Recording:
        """A whole flight, as if nothing ended it."""
        jax, course, start = self._jax, self.course, self.start(state)
        first = self.sample(start)
        sides = self.sides(first)
        Progress = tuple[Carried, Any, Carried]

        def interval(progress: Progress, steps: int) -> tuple[Progress, tuple[Any, Any]]:
            now, alive, last = progress
            now = self.steps(now, steps)
            sample = self.sample(now)
            alive = alive & self.goes_on(sample, sides, reference)
            last = jax.tree.map(lambda new, old: self._numpy.where(alive, new, old), now, last)
            return (now, alive, last), (sample, alive)

        full, rest = divmod(course.steps, course.record_steps)
        begins = self.goes_on(first, sides, reference)
        progress = (start, begins, start)
        progress, (samples, alive) = jax.lax.scan(
            lambda p, _: interval(p, course.record_steps), progress, length=full
        )
        if rest:
            progress, (sample, on) = interval(progress, rest)
            samples = self._numpy.concatenate((samples, sample[None]))
            alive = self._numpy.append(alive, on)
        samples = self._numpy.concatenate((first[None], samples))
        return Recording(samples, self._numpy.append(begins, alive), progress[2])

    def approach(self, carried: Carried) -> Any:
        """Samples after each step of a recording interval, shape (steps, fields)."""

        def one(now: Carried, _: None) -> tuple[Carried, Any]:
            now = self.step(now)
            return now, self.sample(now)

        return self._jax.lax.scan(one, carried, length=self.course.record_steps)[1]


def kernel_of(course: Course, leaves: Iterable[Any], knots: Any, disturbance: Any) -> Kernel:
    """A kernel whose parameters are given as the floats or arrays of their record.

    Args:
        course: Loop and settings of the flight.
        leaves: The floats or arrays of the loop's record, in order.
        knots: Knots of the flight.
        disturbance: m/s^2, world axes.
    """
    parameters = unflatten(course.loop.parameters, leaves)
    return Kernel(course, ControlSetup(parameters, knots), tuple(disturbance))


class Batch:
    """Flights of one course that differ in numbers, as functions of arrays with one row per flight.

    Args:
        course: Loop and settings that they share.
        numbers: Parameters of the loop and of the reference, disturbance and initial state, one
            after the other; None where rows differ.
        knots: Common to all, or None.
    """

    def __init__(
        self, course: Course, numbers: tuple[float | None, ...], knots: tuple[float, ...] | None
    ) -> None:
        import jax

        self.course, self._numbers, self._knots = course, numbers, knots
        axes = (0, 0 if knots is None else None)
        self.record = jax.jit(jax.vmap(self._record, axes))
        self.approach = jax.jit(jax.vmap(self._approach, (*axes, 0)))

    def _kernel(self, row: Any, knots: Any) -> tuple[Kernel, list[Any], ReferenceParameters]:
        """The kernel of a flight, its initial state and its reference."""
        own = iter(row)
        numbers = [next(own) if number is None else number for number in self._numbers]
        parameters = record_size(self.course.loop.parameters)
        reference = parameters + record_size(ReferenceParameters)
        state = reference + 3
        knots = knots if self._knots is None else self._knots
        kernel = kernel_of(self.course, numbers[:parameters], knots, numbers[reference:state])
        own_reference = unflatten(ReferenceParameters, numbers[parameters:reference])
        return kernel, numbers[state:], own_reference

    def _record(self, row: Any, knots: Any) -> Recording:
        kernel, state, reference = self._kernel(row, knots)
        return kernel.record(state, reference)

    def _approach(self, row: Any, knots: Any, carried: Carried) -> Any:
        return self._kernel(row, knots)[0].approach(carried)


def compile_batch(
    course: Course, numbers: tuple[float | None, ...], knots: tuple[float, ...] | None
) -> Batch:
    """A `Batch`, whose compiled code is kept for these very numbers: 0.0 is not -0.0."""
    return _compiled(course, numbers, knots, repr((numbers, knots)))


@lru_cache(maxsize=64)
def _compiled(
    course: Course, numbers: tuple[float | None, ...], knots: tuple[float, ...] | None, _signs: str
) -> Batch:
    return Batch(course, numbers, knots)


def course_of(assembly: Assembly) -> Course:
    """The course of a planned flight, and of all that may share a batch with it."""
    simulation = assembly.scenario.simulation
    return Course(
        assembly.loop,
        simulation.timestep,
        simulation.control_steps,
        simulation.record_steps,
        simulation.steps,
        assembly.follows_position,
        simulation.precision,
        simulation.solver,
    )


@one_thread_at_a_time
@lru_cache(maxsize=64)
def _compiled_steps(
    course: Course, leaves: tuple[float, ...], knots: tuple[float, ...], disturbance: Triple
) -> Callable[[int, Floats, int], Any]:
    """Steps of one flight, whose state and held inputs are one array: each takes time to pass."""
    import jax
    import jax.numpy as jnp

    kernel = kernel_of(course, leaves, knots, disturbance)

    def many(index: Any, numbers: Any, steps: Any) -> Any:
        now = kernel.at(index, *_split(course, numbers))
        now = jax.lax.fori_loop(0, steps, lambda _, now: kernel.step(now), now)
        return jnp.stack([*now.state, *now.held])

    return jax.jit(many)


def _split(course: Course, numbers: Any) -> tuple[Any, Any]:
    """State and held inputs."""
    size = len(numbers) - course.loop.required_equations.inputs_size
    return numbers[:size], numbers[size:]


class JaxStepper:
    """Integrates one flight in JAX.

    Args:
        course: See there.
        setup: Parameters and knots.
        disturbance: m/s^2, world axes.
    """

    def __init__(self, course: Course, setup: ControlSetup, disturbance: Triple) -> None:
        require_jax('simulation.engine = "jax"')
        numbers = tuple(flatten(setup.parameters)), tuple(setup.knots), disturbance
        self._dtype = course.dtype
        self._many = partial(_compiled_steps, course, *numbers)

    def advance(self, step_index: int, now: Floats, steps: int) -> Floats:
        """State and inputs in force some steps later, see `tiltsim.engines.steppers`.

        Args:
            step_index: Number of steps so far.
            now: State and inputs in force, shape (states + inputs,).
            steps: How many steps to take.
        """
        with double_precision():
            later = self._many()(step_index, now.astype(self._dtype), steps)
            return np.asarray(later, float)
