"""Margins of a closed loop: how much gain, phase, delay and uncertainty it bears, and where.

The loop is broken at one place at a time, all other feedback closed: at an input of the vehicle or
at a measured state. At all inputs together, a common gain or delay acts on the eigenvalues of the
loop's transfer matrix: ``det(I + g exp(-i w tau) L(i w)) = 0`` where one of them is -1.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import atan, inf, isfinite, pi
from os import PathLike
from typing import Any, Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from tiltsim.errors import InputError
from tiltsim.linear.coordinates import is_of_vehicle
from tiltsim.linear.equilibrium import equilibrium_of
from tiltsim.linear.linearization import Linearization, linearization_at
from tiltsim.linear.modes import NEUTRAL, exponents
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.body import BODY_FIELDS

TOGETHER: Final = "all inputs"
PER_DECADE: Final = 100  # frequencies
DECADES_BEYOND: Final = 1.0  # of the slowest and of the fastest pole
GROWTH: Final = 1e-4  # rad/s; slower growth is the rounding of a multiple pole at zero
NEGLIGIBLE: Final = 1e-6  # a loop's transfer below this is rounding, one above its inverse a pole
BISECTIONS: Final = 48
REFINED: Final = np.linspace(-1.0, 1.0, 21)  # frequencies about a peak, between two of the grid
REFINEMENTS: Final = 5  # each ten times finer
NEAR_WORST: Final = 0.9  # of the largest value, smaller peaks are not refined
REGULAR: Final = 1e12  # condition of a matrix whose inverse is more than rounding


@dataclass(frozen=True)
class Margin:
    """Stability margins of a loop broken at one place."""

    place: str  # an input, a measured state, or all inputs together
    gain: tuple[float, float]
    """Factors of the loop's gain between which it stays stable; 0 and infinity without limit."""
    phase: float  # smallest lag or lead at which it becomes unstable, rad; infinite if none does
    delay: float  # smallest further delay at which it becomes unstable, s
    frequency: float  # frequency of the smallest phase margin, rad/s; nan if there is none
    disk: float
    """Largest alpha of the disk of factors ``(1 + alpha d / 2) / (1 - alpha d / 2)``, any complex
    ``|d| < 1``; 2 and more: any phase. At all inputs together d is any matrix smaller than 1,
    so the disk holds for independent factors, which may bear more."""

    @property
    def disk_gain(self) -> float:
        """The largest gain factor in the disk; one over it is the smallest."""
        half = 0.5 * self.disk
        return (1.0 + half) / (1.0 - half) if half < 1.0 else inf

    @property
    def disk_phase(self) -> float:
        """The largest phase in the disk, rad."""
        return 2.0 * atan(min(1.0, 0.5 * self.disk))

    def report(self) -> dict[str, Any]:
        """Entries of the JSON report; null stands for no limit."""
        low, high = self.gain
        numbers = {
            "gain_low": low or None,
            "gain_high": high,
            "phase": self.phase,
            "delay": self.delay,
            "frequency": self.frequency,
            "disk": self.disk,
        }
        known = {
            key: value if value is not None and isfinite(value) else None
            for key, value in numbers.items()
        }
        return {"place": self.place, **known}


@dataclass(frozen=True, eq=False)
class BrokenLoop:
    """A loop broken at a place, as ``L = -C (s I - A)^-1 B``."""

    place: str
    A: Floats
    B: Floats
    C: Floats
    timestep: float | None

    def transfer(self, frequencies: Floats) -> Any:
        """The loop's transfer matrix at frequencies (rad/s), shape (frequencies, m, m)."""
        s = 1j * frequencies
        if self.timestep is not None:
            s = np.exp(s * self.timestep)
        pencil = s[:, None, None] * np.eye(len(self.A)) - self.A
        try:
            return -self.C @ np.linalg.solve(pencil, self.B.astype(complex))
        except np.linalg.LinAlgError:  # one of them is a pole, which is seen from beside it
            return self.transfer(frequencies * (1.0 + 1e-9))


def broken_loops(system: Linearization) -> Iterator[BrokenLoop]:
    """The closed loop of a linear system, broken at all inputs, each input, each measured state."""
    gains, b, timestep = system.feedback, system.B, system.timestep
    memory = [i for i, signal in enumerate(system.states) if not is_of_vehicle(signal.bare)]
    driven = [index for index in range(len(gains)) if np.abs(gains[index]).max() > 0.0]
    if driven:
        these, rows = b[:, driven], gains[driven]
        yield BrokenLoop(TOGETHER, system.A - these @ rows, these, rows, timestep)
    for index in driven:
        column, row = b[:, [index]], gains[[index]]
        yield BrokenLoop(system.inputs[index].name, system.A - column @ row, column, row, timestep)
    for index, signal in enumerate(system.states):
        measured = signal.bare in BODY_FIELDS or signal.bare.startswith("rotation_")
        if measured and np.abs(gains[:, index]).max() > 0.0:
            column = b @ gains[:, [index]]
            column[memory] = system.A[np.ix_(memory, [index])]
            row = np.zeros((1, len(system.states)))
            row[0, index] = 1.0
            yield BrokenLoop(signal.name, system.A - column @ row, column, row, timestep)


def frequency_grid(system: Linearization) -> Floats:
    """Frequencies (rad/s) from far below the slowest to far above the fastest pole."""
    sizes = np.abs(exponents(system.poles, system.timestep))
    sizes = sizes[np.isfinite(sizes) & (sizes > 1e3 * NEUTRAL)]
    low, high = np.log10(sizes.min()) - DECADES_BEYOND, np.log10(sizes.max()) + DECADES_BEYOND
    if system.timestep is not None:
        high = min(high, float(np.log10(pi / system.timestep)))
    grid = np.logspace(low, high, int((high - low) * PER_DECADE))
    # A lightly damped pole is a peak that is narrower than the grid.
    poles = exponents(system.poles, system.timestep).imag
    within = poles[(poles > grid[0]) & (poles < grid[-1])]
    return np.unique(np.concatenate((grid, within)))


def margins(scenario: Scenario | str | PathLike[str] | Mapping[str, Any]) -> list[Margin]:
    """The margins of a scenario's closed loop at rest: all inputs, each input, each measured state.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes.

    Raises:
        InputError: If it is invalid, has no rest point, or is unstable there.
    """
    return margins_of(loop_for_margins(load_scenario(scenario)))


def loop_for_margins(scenario: Scenario) -> Linearization:
    """The closed loop at rest, broken where a latency acts, at the commands to the vehicle.

    Measures of the controller against a latency, such as a model of its rotors, are part of it.
    """
    return linearization_at(equilibrium_of(scenario, at_rest=True, late=True))


def margins_of(system: Linearization) -> list[Margin]:
    """The margins of a closed loop at all places. Raises `InputError` if it is unstable."""
    grows = exponents(system.poles, system.timestep).real.max()
    if grows > GROWTH:
        raise InputError(f"margins: the closed loop is unstable, with a pole at {grows:.3g} rad/s")
    grid = frequency_grid(system)
    return [_margin(loop, grid) for loop in broken_loops(system)]


def _margin(loop: BrokenLoop, grid: Floats) -> Margin:
    disk = 2.0 / _largest(lambda frequencies: _skewed_sensitivity(loop.transfer(frequencies)), grid)
    low, high, phase, delay, at = 0.0, inf, inf, inf, float("nan")
    loci = _tracked(np.linalg.eigvals(loop.transfer(grid)))
    for locus in loci.T:
        for frequency, value in _crossings(loop, grid, locus, np.abs(locus) - 1.0, _size):
            from_minus_one = abs(np.angle(-value))
            if from_minus_one < phase:
                phase, at = float(from_minus_one), frequency
            lag = float(np.angle(value)) + pi  # until it arrives at -1
            delay = min(delay, (lag if lag > 0.0 else 2.0 * pi) / frequency)
        real = [value for _, value in _crossings(loop, grid, locus, locus.imag, np.imag)]
        low, high = _between_gains((low, high), real)
    low, high = _between_gains((low, high), _real_ends(loop))
    return Margin(loop.place, (low, high), phase, delay, at, disk)


def _skewed_sensitivity(transfer: Any) -> Floats:
    """The size of the sensitivity less its complement, of transfer matrices."""
    eye = np.eye(transfer.shape[-1])
    difference = 2.0 * np.linalg.inv(eye + transfer) - eye
    return np.asarray(np.linalg.norm(difference, ord=2, axis=(1, 2)))


def _largest(function: Callable[[Floats], Floats], grid: Floats) -> float:
    """The largest value of a function of frequency, also between the frequencies of a grid."""
    values = function(grid)
    padded = np.pad(values, 1)
    peak = (values >= padded[:-2]) & (values >= padded[2:]) & (values > NEAR_WORST * values.max())
    found = float(values.max())
    for index in np.flatnonzero(peak):
        middle, reach = grid[index], np.ptp(grid[max(index - 1, 0) : index + 2])
        for _ in range(REFINEMENTS):
            near = np.clip(middle + reach * REFINED, grid[0], grid[-1])
            values = function(near)
            middle, reach = near[values.argmax()], 0.1 * reach
            found = max(found, float(values.max()))
    return found


def _between_gains(
    between: tuple[float, float], crossings: Iterable[complex]
) -> tuple[float, float]:
    """Gain factors nearest to one, from ``between`` and from the crossings taken to -1."""
    low, high = between
    for value in crossings:
        if -1.0 / NEGLIGIBLE < value.real < -NEGLIGIBLE:
            factor = float(-1.0 / value.real)
            low, high = (max(low, factor), high) if factor < 1.0 else (low, min(high, factor))
    return low, high


def _real_ends(loop: BrokenLoop) -> list[complex]:
    """Loci at the ends of all frequencies, where they are real without a change of sign.

    At zero, and of a sampled loop at the Nyquist frequency ``z = -1``; none where it has a pole.
    """
    ends = (0.0,) if loop.timestep is None else (1.0, -1.0)
    values: list[complex] = []
    for end in ends:
        pencil = end * np.eye(len(loop.A)) - loop.A
        if np.linalg.cond(pencil) < REGULAR:
            transfer = -loop.C @ np.linalg.solve(pencil, loop.B)
            found = np.linalg.eigvals(transfer)
            values += found[np.abs(found.imag) <= NEGLIGIBLE * np.abs(found)].tolist()
    return values


def _size(value: complex) -> float:
    return abs(value) - 1.0


def _tracked(eigenvalues: Any) -> Any:
    """Eigenvalues over frequency, each column a continuous locus."""
    tracked = eigenvalues.copy()
    for before, here in pairwise(tracked):
        here[:] = here[linear_sum_assignment(np.abs(before[:, None] - here))[1]]
    return tracked


def _crossings(
    loop: BrokenLoop, grid: Floats, locus: Any, signs: Floats, measure: Any
) -> Iterator[tuple[float, complex]]:
    """Frequencies (rad/s) and values of a locus at which ``measure(value)`` vanishes."""
    for index in np.flatnonzero(np.sign(signs[1:]) != np.sign(signs[:-1])):
        low, high = first, last = float(grid[index]), float(grid[index + 1])
        value, rise = complex(locus[index]), complex(locus[index + 1] - locus[index])
        rising = signs[index + 1] > signs[index]
        for _ in range(BISECTIONS):
            middle = (low * high) ** 0.5
            values = np.linalg.eigvals(loop.transfer(np.array([middle]))[0])
            expected = locus[index] + rise * (middle - first) / (last - first)
            value = complex(values[np.argmin(np.abs(values - expected))])
            if (measure(value) > 0.0) == rising:
                high = middle
            else:
                low = middle
        yield low, value
