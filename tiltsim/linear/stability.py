"""Stability of rest points and periodic orbits, over values of a key, and their slowest mode."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, exp, log
from os import PathLike
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.linear.coordinates import vehicles_of
from tiltsim.linear.equilibrium import Equilibrium, equilibrium_of
from tiltsim.linear.forcing import forcing_of
from tiltsim.linear.modes import KINDS, Mode, exponents, is_stable, labeled, modes_of, spectrum
from tiltsim.linear.newton import ERROR
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.arguments import check_function
from tiltsim.system.text import html_table, short_repr
from tiltsim_controllers.mathematics.scalar import Floats

RESOLVED: Final = 1e-8
"""Modes of an orbit with a smaller multiplier are lost in the rounding of a period."""

ON_AXIS: Final = 1e-6  # multipliers with a smaller imaginary part are real


@dataclass(frozen=True, eq=False)
class Stability:
    """Whether small disturbances of a rest point or of a periodic orbit die out."""

    kind: str  # ``"rest"`` or ``"orbit"``
    period: float | None  # period of the orbit, s; None at rest
    residual: float  # largest entry of the rates (rest) or of the change over a period, SI units
    stable: bool  # whether small disturbances stay small
    neutral: int
    """Number of poles at zero or multipliers of one: states that stay where they are put."""
    poles: Floats | None
    """Poles at rest, rad/s, complex, from fastest growth to fastest decay; ``log(mu) /
    control_timestep`` for a sampled controller. None for an orbit."""
    multipliers: Floats | None
    """Floquet multipliers of an orbit, complex, the largest first; None at rest."""
    modes: tuple[Mode, ...]
    """In the same order, but for states that are forgotten within a period or sample."""
    states: tuple[str, ...]  # names of the coordinates
    matrix: Floats
    """The linear system, shape (states, states): rates by coordinates, or the coordinates after a
    control sample or period by the coordinates before it."""
    equilibrium: Equilibrium  # the state itself
    left_out: tuple[str, ...] = ()
    """Names of states that nothing holds and that no other depends on, x and y of a vehicle that
    drifts: they are not analyzed."""
    corners: tuple[str, ...] = ()
    """Names of states whose rates have a corner there, at a limit or at the edge of a dead zone:
    the matrix is the mean of both sides, and poles say little."""

    def __repr__(self) -> str:
        """The verdict, in one line."""
        return f"<Stability of {self._verdict}>"

    def _repr_html_(self) -> str:
        """The verdict and the modes, as a table for notebooks."""
        columns = ("mode", "frequency, rad/s", "damping", "count", "states")
        rows = [
            (m.name, f"{m.frequency:.5g}", f"{m.damping:.4f}", m.count, ", ".join(m.states[:6]))
            for m in self.modes
        ]
        notes = [
            text + ", ".join(names)
            for text, names in (
                ("left out, since nothing holds them: ", self.left_out),
                ("at a corner, so that poles say little: ", self.corners),
            )
            if names
        ]
        return html_table("Stability", [self._verdict, *notes], rows, columns)

    @property
    def _verdict(self) -> str:
        kind = "a rest point" if self.period is None else f"an orbit of {self.period:g} s"
        verdict = "stable" if self.stable else "unstable"
        return f"{kind}: {verdict}, {self.neutral} neutral of {len(self.states)} states"

    @property
    def growth(self) -> float:
        """Factor by which the slowest disturbance grows in a period, at rest in one second."""
        if self.multipliers is not None:
            return float(np.abs(self.multipliers).max())
        assert self.poles is not None  # it is a rest point
        return float(np.exp(self.poles.real.max()))

    def report(self) -> dict[str, Any]:
        """Entries of the JSON report."""
        name = "poles" if self.multipliers is None else "multipliers"
        values = self.poles if self.multipliers is None else self.multipliers
        assert values is not None
        return {
            "kind": self.kind,
            "period": self.period,
            "residual": self.residual,
            "stable": self.stable,
            "neutral": self.neutral,
            name: [[float(value.real), float(value.imag)] for value in values],
            "modes": [mode.report() for mode in self.modes],
            "states": list(self.states),
            "left_out": list(self.left_out),
            "corners": list(self.corners),
        }


def stability(
    scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
    *,
    near: Stability | None = None,
    progress: Callable[[int], None] = lambda _flights: None,
) -> Stability:
    """Poles of a scenario's rest point, or Floquet multipliers of its periodic orbit.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes.
        near: Result of a neighboring scenario, whose orbit is followed to this one's.
        progress: Called with the number of periods or samples flown so far.

    Raises:
        InputError: If it is invalid, neither at rest nor periodic, or has no such state nearby.
    """
    if not (near is None or isinstance(near, Stability)):
        raise InputError(f"near = {short_repr(near)}: must be a result of tiltsim.stability")
    check_function("progress", progress)
    state = None if near is None else near.equilibrium.root.state
    return stability_at(equilibrium_of(load_scenario(scenario), near=state, progress=progress))


def stability_at(found: Equilibrium) -> Stability:
    """The stability of a rest point or orbit."""
    matrix, timestep = found.matrix, found.timestep
    error = 0.0 if found.is_orbit else ERROR
    eigenvalues, _, _ = spectrum(matrix, error)
    eigenvalues = eigenvalues[np.argsort(-np.abs(eigenvalues), kind="stable")]
    poles = exponents(eigenvalues, timestep)
    finite = poles[np.isfinite(poles)]
    modes = modes_of(matrix, found.minimal.names, timestep, error, found.motion.prefixes)
    if found.is_orbit and timestep is not None:
        fastest = log(RESOLVED) / timestep
        modes = tuple(mode for mode in modes if mode.growth_rate > fastest)
    return Stability(
        kind="orbit" if found.is_orbit else "rest",
        period=found.timestep if found.is_orbit else None,
        residual=found.root.residual,
        stable=is_stable(matrix, poles, timestep),
        neutral=sum(mode.count for mode in modes if mode.frequency == 0.0),
        poles=None if found.is_orbit else finite[np.argsort(-finite.real, kind="stable")],
        multipliers=eigenvalues if found.is_orbit else None,
        modes=modes,
        states=found.minimal.names,
        matrix=matrix,
        equilibrium=found,
        left_out=found.left_out,
        corners=found.corners,
    )


@dataclass(frozen=True)
class Point:
    """A value of the key and its result."""

    value: float
    found: Stability | None  # None where there is no orbit
    reason: str = ""  # why there is none

    @property
    def largest(self) -> float | None:
        """The size of the largest multiplier; of a rest point, in one second."""
        return None if self.found is None else self.found.growth

    def report(self) -> dict[str, Any]:
        """As JSON."""
        report: dict[str, Any] = {"value": self.value, "largest": self.largest}
        if self.found is None:
            return {**report, "stable": None, "multipliers": None, "reason": self.reason}
        of_it = self.found.report()
        return {**report, **{key: of_it.get(key) for key in ("stable", "multipliers", "poles")}}


@dataclass(frozen=True)
class Crossing:
    """A value at which the largest multiplier leaves or enters the unit circle."""

    value: float
    leaves: bool  # for larger values, else it enters
    how: str

    def report(self) -> dict[str, Any]:
        """As JSON."""
        return dict(vars(self))


def sweep_stability(
    scenario: Scenario,
    key: str,
    values: Iterable[float],
    seen: Callable[[Point], None] = lambda _point: None,
) -> list[Point]:
    """The stability for each value of a key.

    An orbit is followed from value to value: where several exist, it is the same one as long as it
    changes steadily, also where it has become unstable and no flight approaches it.

    Args:
        scenario: The scenario.
        key: Dotted, of a number.
        values: For the key.
        seen: Called with each point when it is found.
    """
    points: list[Point] = []
    last: Stability | None = None
    every = [(value, scenario.replace({key: value})) for value in values]  # refused: a mistake
    for value, changed in every:
        try:
            last = stability(changed, near=last)
            point = Point(value, last)
        except InputError as error:
            point = Point(value, None, str(error))
        points.append(point)
        seen(point)
    return points


def crossings(points: Iterable[Point]) -> list[Crossing]:
    """Where the largest multiplier crosses the unit circle, between points of a sweep."""
    found = []
    for before, after in pairwise(points):
        low, high = before.largest, after.largest
        if low is None or high is None or (low > 1.0) == (high > 1.0):
            continue
        share = log(low) / (log(low) - log(high))
        outside = before if low > 1.0 else after
        assert outside.found is not None  # it has a largest multiplier
        value = before.value + share * (after.value - before.value)
        found.append(Crossing(value, high > 1.0, _how(outside.found)))
    return found


def _how(found: Stability) -> str:
    if found.multipliers is None:
        pole = max(found.poles, key=lambda value: value.real) if found.poles is not None else 0.0
        return "at a rest point, with a swing" if abs(pole.imag) > ON_AXIS else "at a rest point"
    largest = complex(found.multipliers[0])
    if abs(largest.imag) > ON_AXIS:
        return "as a pair: a slow swing about the orbit"
    if largest.real < 0.0:
        return "at -1: the orbit's period doubles"
    return "at +1: it leaves the orbit to one side"


MOST_STEPS: Final = 5_000
"""Longest orbit that is sought for its modes alone: some seconds of compiled steps."""


class SlowestMode(NamedTuple):
    """The mode of attitude and position that decays most slowly."""

    name: str
    decay_rate: float  # 1/s


def slowest_mode(scenario: Scenario) -> SlowestMode | None:
    """The slowest mode of a flight, as `tiltsim.linear.stability` has it.

    Horizontal motion counts if the law follows the reference's. None without a decaying mode, and
    for flights that are neither at rest nor periodic or that take more than `MOST_STEPS` a period.
    """
    vehicles = vehicles_of(assemble(scenario))
    without = {
        labeled(prefix, name)
        for prefix, each in vehicles.items()
        for name in (
            *KINDS.values(),
            *(name for extra in each.loop.extra_actuators for name in extra.names),
            *(() if each.follows_position else ("x", "y")),
        )
    }
    try:
        period = forcing_of(vehicles).period or 0.0
        if period > MOST_STEPS * scenario.simulation.timestep:
            return None
        modes = stability(scenario).modes
    except InputError:
        return None
    named = [(mode.growth_rate, mode.name) for mode in modes if mode.frequency > 0.0]
    decaying = [(r, name) for r, name in named if r < 0.0 and not {*name.split(", ")} <= without]
    if not decaying:
        return None
    rate, name = max(decaying)
    return SlowestMode(name, -rate)


def advice_on_duration(slowest: SlowestMode, duration: float, near: float, mean: float) -> str:
    """One line if a flight is too short to tell what comes back; empty if it is long enough.

    Args:
        slowest: Its slowest mode.
        duration: Duration of the flight, s.
        near: Admissible remainder of a disturbance of 1 m or rad.
        mean: Seconds at the end over which the mean is taken.
    """
    left = exp(-slowest.decay_rate * max(0.0, duration - mean))
    if left <= near:
        return ""
    enough = ceil(-log(near) / slowest.decay_rate + mean)
    return (
        f"simulation.duration = {duration:g} s is short: the slowest mode, {slowest.name}, decays "
        f"as exp(-{slowest.decay_rate:.3g} t) and leaves {100.0 * left:.2g} % of a disturbance, "
        f"more than the {100.0 * near:g} % that count as back; take {enough} s"
    )
