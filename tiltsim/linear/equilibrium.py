"""Rest points and periodic orbits of closed loops."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.linear import newton
from tiltsim.linear.coordinates import PLANE, parted, vehicles_of
from tiltsim.linear.forcing import Forcing, forcing_of
from tiltsim.linear.motion import LONG, Motion
from tiltsim.linear.mujoco_motion import SETTLING_TIME, make_motion
from tiltsim.plants.plant import MIN_STEPS_TO_COMPILE
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats

REST: Final = 1e-6  # largest rate, in SI units, that counts as rest; solutions end far below
ORBIT: Final = 1e-7  # largest difference after a period, in SI units, that counts as periodic
RETURNS: Final = 10
"""Periods, flown at most to approach a long orbit: a derivative takes two for each state."""

SETTLED: Final = 1e-9
"""Change over a period below which more of them gain nothing: the derivative is the orbit's."""

MOST_STEPS: Final = 200_000
"""Longest orbit: some 250 flights over it take a quarter of an hour with compiled steps."""

INDEPENDENT: Final = 1e-6  # part of an angle (rad) that no other coordinate determines

FLIGHTS: Final = 150  # over a period, that an orbit takes to find
SAMPLES: Final = 1000  # flown, that a rest point of a sampled controller takes


class Minimal(NamedTuple):
    """Coordinates of a state in which cables are taut, as linear functions of the plant's."""

    names: tuple[str, ...]
    rows: Floats  # these coordinates by the plant's, shape (these, plant's)
    columns: Floats  # the plant's by these, shape (plant's, these)


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A state to which a closed loop returns: at once, after a control sample or after a period."""

    motion: Motion  # the closed loop on its plant
    forcing: Forcing  # its dependence on time
    root: newton.Root
    """The state at ``step``, the residual of its rates or of its change over ``steps``, and the
    derivative of the residual."""
    step: int  # the physics step at which it is considered
    steps: int  # physics steps after which it returns; 0 where it rests in continuous time
    left_out: tuple[str, ...] = ()
    """Names of coordinates that nothing holds and that no other depends on: they move on while the
    others rest."""

    @property
    def time(self) -> float:
        """When it is considered, s."""
        return self.step * self.motion.assembly.scenario.simulation.timestep

    @property
    def timestep(self) -> float | None:
        """Seconds after which it returns; None where it rests in continuous time."""
        timestep = self.motion.assembly.scenario.simulation.timestep
        return self.steps * timestep if self.steps else None

    @property
    def is_orbit(self) -> bool:
        """Whether it is a periodic orbit, not a rest point."""
        return self.forcing.period is not None

    @cached_property
    def kept(self) -> Any:
        """Indices of the plant's coordinates that are kept as they are.

        They are not left out, no cable binds them, and something depends on them: an integral
        without a gain is dropped; a position is kept even if no law follows it.
        """
        motion, derivative = self.motion, self.root.derivative
        names = motion.coordinates.names
        used = [
            parted(name, motion.prefixes)[1] in (*"xyz", "angle") or column.any()
            for name, column in zip(names, derivative.T, strict=True)
        ]
        bound = {name for each in motion.hung for name in each.places}
        return np.flatnonzero(
            np.array(used) & ~np.isin(names, (*self.left_out, *motion.aside, *bound))
        )

    @cached_property
    def minimal(self) -> Minimal:
        """The coordinates that are analyzed.

        Hung objects have the angles of their first cable and their rates, but for angles that
        further cables determine: the most independent ones are taken.
        """
        motion, coordinates, state = self.motion, self.motion.coordinates, self.root.state
        names = tuple(coordinates.names[index] for index in self.kept)
        kept = np.eye(coordinates.size)[self.kept]
        if not motion.hung:
            return Minimal(names, kept, kept.T)
        # Changes of the state, by changes of any coordinate, that keep the cables taut.
        taut = newton.derivative_at(
            lambda at: coordinates.between(state, motion.placed(at)), coordinates, state
        )
        swings = newton.derivative_at(motion.swings, coordinates, state) @ taut
        with_kept = kept @ taut
        alone = swings - swings @ np.linalg.pinv(with_kept) @ with_kept
        chosen = independent(alone)
        names += tuple(motion.swing_names[index] for index in chosen)
        rows = np.vstack((kept, swings[chosen]))
        return Minimal(names, rows, taut @ np.linalg.pinv(rows @ taut))

    @property
    def values(self) -> Floats:
        """The coordinates, of the plant's from level at the origin, shape (coordinates,)."""
        coordinates, state = self.motion.coordinates, self.root.state
        found = dict(zip(self.motion.swing_names, self.motion.swings(state), strict=True))
        found |= zip(coordinates.names, coordinates.between(coordinates.level(state), state))
        return np.array([found[name] for name in self.minimal.names])

    @property
    def corners(self) -> tuple[str, ...]:
        """Names of the coordinates kept that are at a limit, or whose rates have a corner there."""
        rates = self.root.corners[np.ix_(self.kept, self.kept)].any(axis=1)
        corner = self.kept[self._at_limits[self.kept] | rates]
        return tuple(self.motion.coordinates.names[index] for index in corner)

    @property
    def _at_limits(self) -> NDArray[np.bool_]:
        """Whether coordinates would pass a limit in the shortest step of a difference."""
        coordinates, state = self.motion.coordinates, self.root.state
        steps = newton.SHORTER[-1] * newton.coordinate_steps(coordinates, state)
        moved = [coordinates.moved(state, by) for step in (steps, -steps) for by in np.diag(step)]
        kept = [coordinates.between(at, self.motion.limited(at)) for at in moved]
        passed = np.abs(kept).max(axis=1) > 0.1 * np.concatenate((steps, steps))
        return np.asarray(passed.reshape(2, -1).any(axis=0))

    @property
    def matrix(self) -> Floats:
        """The linear system: rates by coordinates, or in discrete time the state by the last."""
        change = self.minimal.rows @ self.root.derivative @ self.minimal.columns
        return change if not self.steps else change + np.eye(len(change))


def independent(rows: Floats) -> list[int]:
    """Indices of a largest set of independent rows, in order."""
    left, chosen = rows.copy(), []
    while len(left) and (sizes := np.linalg.norm(left, axis=1)).max() > INDEPENDENT:
        chosen.append(int(sizes.argmax()))
        unit = left[chosen[-1]] / sizes.max()
        left = left - np.outer(left @ unit, unit)
    return sorted(chosen)


def equilibrium_of(
    scenario: Scenario,
    *,
    at_rest: bool = False,
    late: bool = False,
    near: Floats | None = None,
    progress: Callable[[int], None] = lambda _flights: None,
) -> Equilibrium:
    """The rest point or the periodic orbit of a scenario.

    Args:
        scenario: The scenario.
        at_rest: Whether it must be a rest point.
        late: Whether the controller is taken as it flies with a latency; see
            `tiltsim.linear.motion.Motion`.
        near: A state near the orbit, such as the result of a neighboring scenario; tried first.
        progress: Called with the number of periods or samples flown so far.

    Raises:
        InputError: If it has none, or if its orbit takes more than `MOST_STEPS`.
    """
    forcing = forcing_of(vehicles_of(assemble(scenario)))
    if forcing.period is not None:
        if at_rest:
            raise InputError(
                f"{scenario.address or 'scenario'}: moves with a period of {forcing.period:g} s; "
                "a linear system needs a fixed gait and a set point or a line (tiltsim.stability "
                "also takes periodic flights)"
            )
        scenario = _in_whole_steps(scenario, forcing.period)
    simulation = scenario.simulation
    steps = simulation.control_steps
    if forcing.period is not None:
        steps = round(forcing.period / simulation.timestep)
        if steps > MOST_STEPS:
            raise InputError(
                f"{scenario.address or 'scenario'}: gait and reference repeat after "
                f"{forcing.period:g} s, {steps} steps of simulation.timestep = "
                f"{simulation.timestep:g}; an orbit has at most {MOST_STEPS}"
            )
    flights = FLIGHTS if forcing.period is not None else SAMPLES
    settling = ceil(min(SETTLING_TIME, simulation.duration) / simulation.timestep)
    motion = make_motion(scenario, _engine(scenario, max(settling, flights * steps)), late)
    step = ceil(forcing.start / simulation.timestep - 1e-9)
    step = ceil(step / steps) * steps if steps else step
    fewest = 1 if forcing.period is None else RETURNS
    returns = max(fewest, settling // max(1, steps))
    search = _Search(motion, forcing, step, steps, returns, progress)
    if forcing.period is None or (near is not None and near.shape != motion.initial.shape):
        near = None  # at rest, neutral states stay where the scenario puts them
    root, left_out = search.root(near)
    return Equilibrium(motion, forcing, root, step, steps, left_out)


def _engine(scenario: Scenario, steps: int) -> EngineName:
    """The engine for this number of steps."""
    engine = scenario.simulation.engine
    if engine == "python" or engine == "native":
        return engine
    return "native" if steps >= MIN_STEPS_TO_COMPILE else "python"


def _in_whole_steps(scenario: Scenario, period: float) -> Scenario:
    """The scenario with time steps that divide a period: all shorter by less than one in it."""
    simulation = scenario.simulation
    whole = simulation.control_timestep or simulation.timestep
    count = ceil(period / whole - 1e-6)
    keys = ("timestep", "control_timestep", "control_latency", "duration")
    shorter = {key: getattr(simulation, key) * period / (count * whole) for key in keys}
    changed = simulation.model_copy(update=shorter)
    return scenario.model_copy(update={"simulation": changed})


@dataclass
class _Search:
    """The search for a state that returns, by the attributes of an `Equilibrium`."""

    motion: Motion
    forcing: Forcing
    step: int
    steps: int
    returns: int  # at most, until the flight has settled
    progress: Callable[[int], None]

    def __post_init__(self) -> None:
        self._flights, self._timestep = 0, self.motion.assembly.scenario.simulation.timestep
        self._start = self.step * self._timestep
        self._held = np.ones(self.motion.coordinates.size, dtype=bool)
        self._sides = self._signs(self.motion.initial)

    def root(self, near: Floats | None = None) -> tuple[newton.Root, tuple[str, ...]]:
        """The state, sought near another one first, and names left out, or an `InputError`.

        Where no law holds x and y, a vehicle that drifts rests in its other coordinates: in air in
        all but these, for its airspeed becomes steady, else in all but these and their rates.
        """
        assembly, aside = self.motion.assembly, self.motion.aside
        tolerance = ORBIT if self.forcing.period is not None else REST
        drifting = tuple(
            prefix + name
            for prefix, each in self.motion.vehicles.items()
            if not each.follows_position
            for name in (PLANE[:2] if each.scenario.has_air else PLANE)
        )
        best, unheld = None, ""
        for left_out in ((), drifting) if drifting else ((),):
            self._held = ~np.isin(self.motion.coordinates.names, (*left_out, *aside))
            for state in self._starts(near):
                root = self._solve(state, tolerance)
                if root is None:
                    continue
                reason = self.motion.why_not_held(self._start, root.state)
                if not reason and root.residual <= tolerance and self._is_apart(root):
                    return root, left_out
                if best is None or root.residual < best.residual:
                    best, unheld = root, reason
        address = assembly.scenario.address or "scenario"
        what = "rest point" if self.forcing.period is None else "periodic orbit"
        left = "" if best is None else f" (the best leaves {best.residual:.2g}, in SI units)"
        drifts = "" if not drifting else ", also without x and y, which nothing holds"
        raise InputError(f"{address}: {unheld or f'found no {what} near its flight{drifts}{left}'}")

    def _is_apart(self, root: newton.Root) -> bool:
        """Whether no other coordinate depends on those left out."""
        rows = np.abs(root.derivative[self._held])
        largest = np.maximum(1.0, rows.max(axis=1, keepdims=True))
        return bool((rows[:, ~self._held] < REST * largest).all())

    def _solve(self, state: Floats, tolerance: float) -> newton.Root | None:
        of_period = newton.CENTRAL if self.steps > LONG else newton.AVERAGED
        stencil = newton.HALF_STENCIL if self.forcing.period is None else of_period
        root = newton.solve(
            self._changes, self.motion.coordinates, state, 1e-4 * tolerance, stencil
        )
        regular = np.array_equal(self._signs(root.state), self._sides)
        passed = self.motion.coordinates.between(root.state, self.motion.limited(root.state))
        if not (regular and np.abs(passed).max() <= REST and np.isfinite(root.derivative).all()):
            return None  # beyond a singular attitude or a limit, or a rotor turns backwards
        return root

    def _starts(self, near: Floats | None) -> Iterator[Floats]:
        """States to start from: the initial one first, if it may be at rest in continuous time."""
        initial = self.motion.initial
        if near is not None:
            yield near
        at_once = self.forcing.period is None and self.step == 0 and self.steps == 0
        if at_once:
            yield initial
        yield self._settled()
        if not at_once:
            yield initial

    def _settled(self) -> Floats:
        """The state at which the flight, once steady, changes least from a return to the next."""
        state, step = self.motion.initial, self.step
        if step:
            state = self.motion.flown(0, state, step)
        between = self.steps or ceil(1.0 / self._timestep)
        count = self.returns if self.steps else ceil(self.returns / between)
        best, least = state, np.inf
        for _ in range(count):
            (after,) = self.motion.flown_each(step, [state], between)
            self._count()
            moved = self._frame(step * self._timestep, (step + between) * self._timestep)
            apart = self.motion.coordinates.between(state, after) - moved
            change = np.linalg.norm(apart * self._held)
            step += between
            state = after
            if not np.isfinite(change):
                break
            if change < least:
                back = self._frame(step * self._timestep, self._start)
                best, least = self.motion.coordinates.moved(after, back), float(change)
            if change < SETTLED:
                break
        return best

    def _frame(self, start: float, end: float) -> Floats:
        """Motion of the moving frame from one time (s) to another."""
        return self.forcing.motion(self.motion.coordinates.names, start, end)

    def _changes(self, states: list[Floats]) -> Iterator[Floats]:
        """Rates, or the changes over the steps, in the moving frame."""
        motion, start = self.motion, self._start
        if self.steps == 0:
            frame = self.forcing.rates(motion.coordinates.names, start)
            yield from ((self._rates(state) - frame) * self._held for state in states)
            return
        moved = self._frame(start, start + self.steps * self._timestep)
        ends = motion.flown_each(self.step, states, self.steps)
        for state, after in zip(states, ends, strict=True):
            self._count()
            yield (motion.coordinates.between(state, after) - moved) * self._held

    def _rates(self, state: Floats) -> Floats:
        try:
            return self.motion.rates(self._start, state)
        except (ArithmeticError, ValueError):
            return np.full(self.motion.coordinates.size, np.nan)

    def _count(self) -> None:
        """Report one more flight."""
        self._flights += 1
        self.progress(self._flights)

    def _signs(self, state: Floats) -> Floats:
        """Signs that the flight keeps: of the determinant and of the rotors' speeds."""
        try:
            sample = self.motion.observed(self._start, state)
            values = self.motion.assembly.sign_check_values(self._start, tuple(sample.tolist()))
        except (ArithmeticError, ValueError):
            return np.full(1, np.nan)
        return np.sign(values)
