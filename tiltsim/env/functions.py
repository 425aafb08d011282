"""Environments as pure functions in JAX, on the equations instead of in MuJoCo.

`EnvFunctions` makes them for one environment; ``jax.vmap`` makes many of it, and ``jax.grad``
differentiates through their episodes. `tiltsim.env.VectorEnv` is made of them.
"""

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.arrays.jax_programs import InJax, require_jax
from tiltsim.closed_loop.limits import WITHIN_LIMITS
from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.env.task import Task
from tiltsim.equations.actuator_level import rigid_body
from tiltsim.equations.solvers import make_implicitfast_step
from tiltsim.errors import InputError
from tiltsim.laws.assembling import commanded_parameters, loop_of, with_command
from tiltsim.laws.layers.layer import on_equations
from tiltsim.plants.command import Observation, Reference
from tiltsim.scenario.documents import split_key, value_at, with_value
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.surroundings import SensorTable
from tiltsim.scenario.vehicle import PodTable, VehicleTable
from tiltsim.simulation.vectorized import ArrayPlan, PlannedFlight
from tiltsim.system.text import short_repr
from tiltsim.vehicles.rotorcraft import QW, TILT_1, TILT_RATE_1
from tiltsim_controllers.mathematics.attitude import euler_angles, rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.references.trajectories import attitude_reference, reference_derivatives

NOT_FINITE: Final = -1  # in place of the code of a limit
LEAST_THRUST: Final = 1e-30  # N; a root has no derivative at zero


def loop_on_equations(scenario: Scenario) -> ClosedLoop:
    """The loop of a rotorcraft under commands, as a rigid body."""
    loop = loop_of(scenario)
    return on_equations(loop, rigid_body(loop, scenario.any_rotorcraft))


class Episode(NamedTuple):
    """An episode on arrays."""

    numbers: Any  # drawn for it, shape (numbers,)
    index: Any  # of the physics step
    state: tuple[Any, ...]  # MuJoCo's qpos, qvel and act


class Outcome(NamedTuple):
    """The result of a step, in arrays."""

    observation: Any  # (entries,), from -1 to 1
    reward: Any
    terminated: Any  # whether the vehicle is lost
    truncated: Any  # whether the time is over
    limit: Any  # the code of the limit exceeded, of `tiltsim.closed_loop.limits`, or `NOT_FINITE`
    distance: Any  # m, from the reference


def check_precision(precision: object) -> None:
    """Raise `InputError` unless it is one that arrays have."""
    if not isinstance(precision, str) or precision not in ("float32", "float64"):
        shown = short_repr(precision)
        raise InputError(f"environment: precision = {shown}: must be 'float32' or 'float64'")


class EnvFunctions:
    """An environment as pure functions of arrays: `reset` and `step`.

    They match `tiltsim.env.gymnasium.GymnasiumEnv` with ``flat=True``. The vehicle is
    integrated as MuJoCo does with ``implicitfast``, but its pods are massless.

    Args:
        task: With any rotorcraft and ``simulation.integrator = "implicitfast"``; without errors of
            sensors, latency, faults, rotor inertia and ground.
        precision: "float32" or, if JAX has 64-bit numbers enabled, "float64".

    Attributes:
        scenario: The scenario of the task, before any draws.
        keys: Keys of the scenario that a domain draws for an episode.
        actions, observations: Numbers of entries of an action and of an observation.

    Raises:
        InputError: If the task is none of these, or draws anything but numbers of a flight.
    """

    def __init__(self, task: Task, precision: str = "float32") -> None:
        require_jax("tiltsim.env.VectorEnv")
        import jax
        import jax.numpy as jnp

        check_precision(precision)
        self._jax, self._numpy, self._dtype, self._task = jax, jnp, precision, task
        self.scenario = scenario = task.scenario
        _check_supported(scenario)
        self._simulation = scenario.simulation
        loop = loop_on_equations(scenario)
        self._follows = loop.follows_position(scenario)
        self._plan = ArrayPlan(scenario, loop, precision)
        rotorcraft = scenario.any_rotorcraft
        self._rotors, self._tilts = rotorcraft.rotor_count, rotorcraft.tilt_count
        self._spins = np.array(rotorcraft.spins)
        self._coefficients = np.array(rotorcraft.thrust_coefficients)
        self._slowest, self._fastest = rotorcraft.speeds_along_spin
        self._qvel = TILT_1 + self._tilts
        self._act = self._qvel + TILT_RATE_1 + self._tilts
        # A command is written to the speeds, or to the speeds that they follow with a lag.
        lags = rotorcraft.rotor_time_constant is not None
        self._commanded = self._act + self._rotors * lags
        equations = loop.required_equations
        run = InJax(precision)
        self._advance = run(make_implicitfast_step(equations, self._tilts))
        self._inputs, self._sample = run(equations.inputs), run(equations.observe)
        self._limit = run(loop.kind.limit_exceeded)
        self._reference_at, self._attitude_at = run(reference_derivatives), run(attitude_reference)
        self._euler, self._rotation = map(run, (euler_angles, rotation_of_quaternion))
        first = {} if task.domain is None else task.domain.values(np.random.default_rng(0))
        self.keys = tuple(first)
        self._widths = [None if np.ndim(value) == 0 else len(value) for value in first.values()]
        for key, value in first.items():
            self._check_key(key, value)
        spec = task.action_spec()
        self._low, self._high = spec.minimum, spec.maximum
        bounds = task.observation_spec().values()
        self._bounds = np.concatenate([entry.maximum * np.ones(entry.shape) for entry in bounds])
        self.actions, self.observations = len(self._low), len(self._bounds)

    def draw(self, generators: Sequence[np.random.Generator]) -> Floats:
        """Numbers for `reset`, a row for each generator; they draw as a single environment does."""
        domain = self._task.domain
        return np.empty((len(generators), 0)) if domain is None else domain.sample(generators)

    def reset(self, numbers: Any) -> tuple[Episode, Any]:
        """Begin an episode with numbers of `draw`; the observation is the second.

        Args:
            numbers: A row, shape (numbers,).
        """
        planned, floats = self._planned(numbers), self._numpy.asarray
        state = tuple(floats(value, self._dtype) for value in planned.state)
        episode = Episode(floats(numbers, self._dtype), floats(0, "int32"), state)
        return episode, self._flat(self._observed(episode, planned))

    def step(self, episode: Episode, action: Any) -> tuple[Episode, Outcome]:
        """Hold an action for one control step.

        Args:
            episode: From `reset` or `step`.
            action: Entries from -1 to 1, as in `tiltsim.env.gymnasium.GymnasiumEnv`.
        """
        jnp, planned = self._numpy, self._planned(episode.numbers)
        middle, half = 0.5 * (self._high + self._low), 0.5 * (self._high - self._low)
        action = jnp.asarray(action, self._dtype)
        clipped = jnp.clip(
            jnp.asarray(middle, self._dtype) + jnp.asarray(half, self._dtype) * action,
            jnp.asarray(self._low, self._dtype),
            jnp.asarray(self._high, self._dtype),
        )
        now = self._flown(episode, clipped, planned)
        finite = jnp.stack([jnp.isfinite(value) for value in now.state]).all()
        kept = tuple(
            jnp.where(finite, new, old) for new, old in zip(now.state, episode.state, strict=True)
        )
        now = now._replace(state=kept)
        observation = self._observed(now, planned)
        code, distance = self._limits(now, planned)
        lost = ~finite | (code != WITHIN_LIMITS) | (distance > self._task.max_position_error)
        limit = jnp.where(finite, code, NOT_FINITE)
        reward = jnp.where(lost, 0.0, self._task.reward(observation, clipped))
        truncated = ~lost & (now.index >= self._simulation.steps)
        return now, Outcome(self._flat(observation), reward, lost, truncated, limit, distance)

    def _planned(self, numbers: Any) -> PlannedFlight:
        """The plan of an episode."""
        tree, place = self._plan.parameters, 0
        for key, width in zip(self.keys, self._widths, strict=True):
            value = numbers[place] if width is None else tuple(numbers[place : place + width])
            tree, place = with_value(tree, split_key(key), value), place + (width or 1)
        return self._plan(tree)

    def _flown(self, episode: Episode, action: Any, planned: PlannedFlight) -> Episode:
        """An episode after a control step."""
        jnp, knots, timestep = self._numpy, planned.knots, self._simulation.timestep
        parameters, count = planned.parameters, self._simulation.control_steps
        vehicle, rotors = commanded_parameters(parameters.inner).vehicle, self._rotors
        per_square = getattr(vehicle, "thrust_coefficient", None)  # which may be drawn
        if per_square is None:
            per_square = jnp.asarray(self._coefficients, self._dtype)
        thrusts = action[:rotors]
        sizes = jnp.sqrt(jnp.maximum(abs(thrusts), LEAST_THRUST) / per_square)
        speeds = jnp.clip(jnp.copysign(sizes, thrusts), self._slowest, self._fastest)
        speeds = speeds * jnp.asarray(self._spins, self._dtype)
        parameters = with_command(parameters, (*action[rotors:], *(0.0,) * rotors))
        state = [*episode.state]
        state[self._commanded : self._commanded + rotors] = [*speeds]
        held = self._inputs(self._time(episode.index), state, parameters, knots)

        def one(now: tuple[Any, ...], step: Any) -> tuple[tuple[Any, ...], None]:
            time = self._time(episode.index + step)
            new = self._advance(
                time, [*now], held, timestep, parameters, knots, planned.disturbance
            )
            return tuple(jnp.asarray(value, self._dtype) for value in new), None

        last, _ = self._jax.lax.scan(one, tuple(state), jnp.arange(count))
        return Episode(episode.numbers, episode.index + count, last)

    def _time(self, index: Any) -> Any:
        return index.astype(self._dtype) * self._simulation.timestep

    def _observed(self, episode: Episode, planned: PlannedFlight) -> dict[str, Any]:
        """The arrays of an observation."""
        jnp, state, time = self._numpy, episode.state, self._time(episode.index)
        qvel, act, names = self._qvel, self._act, self._task.observed.bounds
        quaternion = state[QW : QW + 4]
        rotation = self._rotation(quaternion)
        reference, spins = planned.reference, jnp.asarray(self._spins, self._dtype)
        none, tilts = jnp.zeros(0, self._dtype), self._tilts  # a stack of none is an error
        motion = jnp.asarray(self._reference_at(time, reference, planned.knots)[:9])
        unseen = np.full(3, np.nan)  # values that are not observed, as the gait
        seen = Observation(
            time=time,
            position=jnp.stack(state[:3]),
            velocity=jnp.stack(state[qvel : qvel + 3]),
            attitude=jnp.stack(self._euler(quaternion)) if "attitude" in names else unseen,
            quaternion=jnp.stack(quaternion),
            body_rates=jnp.stack(state[qvel + 3 : qvel + 6]),
            tilt_angles=jnp.stack(state[TILT_1:qvel]) if tilts else none,
            tilt_rates=jnp.stack(state[act - tilts : act]) if tilts else none,
            rotor_speeds=spins * jnp.stack(state[act : act + self._rotors]),
            reference=Reference(
                position=motion[:3],
                velocity=motion[3:6],
                acceleration=motion[6:],
                attitude=jnp.asarray(self._attitude_at(time, reference, planned.knots)),
                tilt_angles=unseen,
                tilt_rates=unseen,
            ),
            vehicle=commanded_parameters(planned.parameters.inner).vehicle,
        )
        return self._task.observed.arrays(seen, jnp.array(rotation), jnp)

    def _limits(self, episode: Episode, planned: PlannedFlight) -> tuple[Any, Any]:
        """The code of the limit of all flights that a state exceeds, and its `Outcome.distance`."""
        episode = self._jax.lax.stop_gradient(episode)
        time, parameters, knots = self._time(episode.index), planned.parameters, planned.knots
        inputs = self._inputs(time, episode.state, parameters, knots)
        values = self._sample(time, episode.state, inputs, parameters, knots)
        reference = planned.reference
        code = self._limit(time, values, reference, knots, self._follows)
        target = self._reference_at(time, reference, knots)
        squares = sum((episode.state[axis] - target[axis]) ** 2 for axis in range(3))
        return code, self._numpy.sqrt(squares)

    def _flat(self, observation: Mapping[str, Any]) -> Any:
        jnp = self._numpy
        every = jnp.concatenate([*observation.values()])
        return (every / jnp.asarray(self._bounds, self._dtype)).astype("float32")

    def _check_key(self, key: str, value: Any) -> None:
        """Refuse to draw anything but numbers of a flight."""
        found = value_at(self._plan.parameters, key)
        if found is None or np.shape(found) != np.shape(value):
            names = ", ".join(self._plan.parameters)
            raise InputError(
                f"environment: domain: {key}: arrays draw numbers on which a flight depends, of "
                f"{names}"
            )


def _check_supported(scenario: Scenario) -> None:
    """Refuse features that these equations do not have."""
    allowed: dict[str, object] = {
        "vehicle.rotor_inertia": 0.0,
        "ground": None,
        "object": (),
        "tool": None,
        "payload": None,
        "fault": (),
        "sensors": SensorTable(),
        "simulation.control_latency": 0.0,
        "simulation.integrator": "implicitfast",
    }
    if isinstance(scenario.vehicle, VehicleTable):  # else they are in its file
        allowed["vehicle.pod"] = PodTable()
    for key, value in allowed.items():
        found = attrgetter(key)(scenario)
        if found != value:
            shown = short_repr(found)
            only = f"only {value!r} flies" if isinstance(value, str) else "does not fly"
            raise InputError(f"environment: {key} = {shown}: {only} on arrays; use GymnasiumEnv")
    file = scenario.any_rotorcraft.user_vehicle
    if file is not None and file.unmodeled_properties:
        raise InputError(
            f"environment: vehicle.mjcf = {short_repr(scenario.any_rotorcraft.mjcf)}: "
            f"{file.unmodeled_properties} does not fly on arrays; use GymnasiumEnv"
        )
