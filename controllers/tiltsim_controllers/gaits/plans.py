"""Planned gaits with name, source and properties, and their constructors.

A `Gait` combines the parameters and knots of `tiltsim_controllers.gaits.motion` with the gait's
name and source, and computes its period, amplitude, continuity and largest rate. Every constructor
makes pieces of polynomials or a harmonic motion, so that a new type of gait needs no code that
evaluates it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.code.arrays import as_number, is_known, xp
from tiltsim_controllers.gaits.cat import FOOTFALLS, cat_keyframes
from tiltsim_controllers.gaits.motion import (
    CUBIC,
    FIXED,
    HARMONIC,
    LINEAR,
    NO_KNOTS,
    POWERS,
    GaitParameters,
    check_phases,
    planned_tilts,
)
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.mathematics.splines import spline_knots

_JUMP: Final = 1e-9
"""Change of an angle (rad) between two pieces that is more than rounding."""

_AFTER: Final = 1.0 + 2.0**-52
"""Factor that moves a time just beyond itself: a trot's half period includes its end (ch. 4)."""


@dataclass(frozen=True)
class Gait:
    """A gait ready to be flown."""

    name: str  # name of the gait
    parameters: GaitParameters  # first argument of `planned_tilts`
    knots: tuple[float, ...] = NO_KNOTS  # its table data
    source: str = ""  # where it comes from
    tilts: int = 4  # number of tilt angles

    @property
    def is_constant(self) -> bool:
        """Whether the tilt angles never change."""
        return self.parameters.type == FIXED

    @property
    def period(self) -> float | None:
        """Seconds after which the gait repeats; None for a constant gait.

        For a table that does not repeat, its length.
        """
        return None if self.is_constant else self.parameters.period

    @property
    def is_continuous(self) -> bool:
        """Whether the tilt angles are continuous in time (ch. 6, Definition 1)."""
        if self.is_constant or self.parameters.type == HARMONIC:
            return True
        starts, spans, pieces = self._pieces()
        stops = np.array([np.polyval(piece, span) for piece, span in zip(pieces, spans)])
        jumps = np.abs(np.roll(pieces[:, -1], -1, axis=0) - stops) > _JUMP
        return not jumps[: None if self.parameters.repeats else len(starts) - 1].any()

    @property
    def amplitude(self) -> float:
        """The largest magnitude (rad) of any tilt angle."""
        return self._largest(0)

    @property
    def max_rate(self) -> float:
        """The largest magnitude (rad/s) of any tilt rate; infinite where angles jump."""
        return self._largest(1) if self.is_continuous else inf

    @property
    def min_segment_time(self) -> float:
        """The shortest time (s) between two corners; infinite without corners, 0 with jumps."""
        if not self.is_continuous:
            return 0.0
        return float(self._pieces()[1].min()) if self.parameters.type == LINEAR else inf

    def jets(self, time: float) -> Any:
        """Tilt angles (rad), rates (rad/s) and accelerations (rad/s^2) at a time (s), by tilt."""
        return planned_tilts(time, self.parameters, self.knots, self.tilts)

    def angles(self, time: ArrayLike) -> Floats:
        """Tilt angles (rad) at times (s) of shape (...), as an array of shape (..., tilts)."""
        return self._evaluate(time)[..., 0]

    def rates(self, time: ArrayLike) -> Floats:
        """Tilt rates (rad/s) at times (s) of shape (...), as an array of shape (..., tilts)."""
        return self._evaluate(time)[..., 1]

    def sample_times(self, samples: int = 201) -> Floats:
        """Times (s) over one period, with ends and corners; only 0 for a constant gait."""
        if self.is_constant:
            return np.zeros(1)
        times = np.linspace(0.0, 1.0, samples) * self.parameters.period
        if self.parameters.type == LINEAR:
            times = np.union1d(times, self._pieces()[0])
        # The end of the period belongs to the next one, past the jump.
        return times if self.is_continuous else times[:-1]

    def scaled(self, divisor: float) -> Gait:
        """The gait with all tilt angles divided by ``divisor`` (ch. 5, Eq. 16).

        Raises:
            ValueError: If the divisor is not positive and finite.
        """
        if is_known(divisor) and not (isfinite(divisor) and divisor > 0.0):
            raise ValueError(f"scale 1/{divisor}: must be positive and finite")
        # Also where the number is 1: the result depends on it, which gradients need.
        parameters = self.parameters._replace(scale=self.parameters.scale / divisor)
        scales = is_known(divisor) and divisor != 1.0
        name = f"{self.name} / {divisor:g}" if scales else self.name
        return replace(self, name=name, parameters=parameters)

    def biased(self, eta: float) -> Gait:
        """The gait with ``alpha_3`` and ``alpha_4`` multiplied by ``eta`` (ch. 6, Eqs. 12-15)."""
        parameters = self.parameters._replace(bias=self.parameters.bias * eta)
        biases = is_known(eta) and eta != 1.0
        name = f"{self.name}, biased {eta:.0%}" if biases else self.name
        return replace(self, name=name, parameters=parameters)

    def _factors(self) -> Floats:
        """Scale and bias of every tilt angle, shape (tilts,)."""
        back = (np.arange(self.tilts) >= 2) & (self.tilts == 4)
        return self.parameters.scale * np.where(back, self.parameters.bias, 1.0)

    def _pieces(self) -> tuple[Floats, Floats, Floats]:
        """Starts and lengths (s) of the pieces, and polynomials, shape (pieces, powers, tilts)."""
        powers, count = POWERS[self.parameters.type], int(self.parameters.keyframes)
        size = 1 + powers * self.tilts
        rows = np.reshape(self.knots[: count * size], (count, size))
        starts = rows[:, 0]
        spans = np.diff([*starts, max(self.parameters.period, starts[-1])])
        pieces = rows[:, 1:].reshape(count, self.tilts, powers).swapaxes(1, 2)
        return starts, spans, pieces * self._factors()

    def _largest(self, order: int) -> float:
        """The largest magnitude of the angles, or of their derivatives of first order."""
        if not self.tilts:
            return 0.0
        if self.parameters.type == HARMONIC:
            mean, *sides = np.reshape(self.knots[: 3 * self.tilts], (-1, 3)).T
            turning = (2.0 * pi / self.parameters.period) ** order
            extremes = turning * np.hypot(*sides) + (np.abs(mean) if order == 0 else 0.0)
            return float(np.abs(self._factors() * extremes).max())
        _, spans, pieces = self._pieces()
        found = [0.0]
        for span, piece in zip(spans, pieces):
            for polynomial in map(np.poly1d, piece.T):
                curve = polynomial.deriv(order)
                turns = curve.deriv().roots if curve.order > 1 else ()
                inner = (t.real for t in turns if t.imag == 0.0 and 0.0 < t.real < span)
                found += [abs(curve(t)) for t in (0.0, span, *inner)]
        return (
            inf if not (self.parameters.repeats or order) and pieces[-1][:-1].any() else max(found)
        )

    def _evaluate(self, time: ArrayLike) -> Floats:
        times = np.asarray(time, dtype=float)
        motion = planned_tilts(times, self.parameters, np.array(self.knots), self.tilts)
        return np.moveaxis(motion, (0, 1), (-2, -1))


def fixed(angles: Sequence[float], *, name: str = "fixed", source: str = "") -> Gait:
    """Constant tilt angles (rad) (ch. 3; ch. 4, Eq. 32), of any number of tilts."""
    knots = (0.0, *map(as_number, angles))
    return Gait(name, GaitParameters(FIXED), knots, source, len(angles))


def _swinging(
    name: str, source: str, period: float, signs: Sequence[float], pieces: Sequence[Sequence[float]]
) -> Gait:
    """A gait whose tilt angles move together, up to their signs.

    Args:
        name, source: Name of the gait, and its place in the thesis.
        period: s
        signs: Signs of the tilt angles.
        pieces: Start (s), rate (rad/s) and value (rad) of each.
    """
    knots = [
        (start, *[entry for sign in signs for entry in (sign * rate, sign * value)])
        for start, rate, value in pieces
    ]
    parameters = GaitParameters(LINEAR, period=_positive(period), keyframes=float(len(pieces)))
    return Gait(name, parameters, tuple([v for row in knots for v in row]), source, len(signs))


_TROT: Final = (-1.0, -1.0, 1.0, 1.0)
"""Diagonal symmetry, ``-alpha_1 = -alpha_2 = alpha_3 = alpha_4 = rho`` (ch. 4, Eqs. 21-24)."""


def instant_trot(amplitude: float, period: float) -> Gait:
    """``rho`` switches between plus and minus the amplitude (rad) (ch. 4, Eq. 33)."""
    pieces = [(0.0, 0.0, amplitude), (0.5 * period * _AFTER, 0.0, -amplitude)]
    return _swinging("trot_instant", "ch. 4, Sec. 4.2", period, _TROT, pieces)


def continuous_trot(amplitude: float, period: float) -> Gait:
    """``rho`` moves from plus to minus the amplitude (rad) and back (ch. 4, Eq. 34)."""
    rate = 4.0 * amplitude / _positive(period)
    pieces = [(0.0, -rate, amplitude), (0.5 * period * _AFTER, rate, -amplitude)]
    return _swinging("trot_continuous", "ch. 4, Sec. 4.3", period, _TROT, pieces)


def penguin(name: str, amplitude: float, period: float) -> Gait:
    """A swing of one tilt between minus and plus the amplitude (rad) (ch. 11, Sec. 3)."""
    pieces = [(0.0, 0.0, -amplitude), (0.5 * period, 0.0, amplitude)]
    return _swinging(name, "ch. 11, Sec. 3, Figs. 7 and 8", period, (1.0,), pieces)


def rotating(start: float, rate: float) -> Gait:
    """A tilt that grows from ``start`` (rad) at a constant rate (rad/s) (ch. 10, Eq. 18)."""
    period = _positive(2.0 * pi / abs(xp.where(rate == 0.0, 2.0 * pi, rate)))
    gait = _swinging("rotating", "ch. 10, Eq. (18)", period, (1.0,), [(0.0, rate, start)])
    return replace(gait, parameters=gait.parameters._replace(repeats=0.0))


def cat(name: str, amplitude: float, period: float, lean: float = 0.0) -> Gait:
    """A cat gait (ch. 5, Sec. 3.2).

    Args:
        name: a name in `FOOTFALLS`
        amplitude, lean: The legs swing by ``amplitude`` to either side of ``lean`` (forward), rad;
            `tiltsim_controllers.gaits.cat.SWINGS` has the values reconstructed from ch. 5.
        period: s

    Raises:
        ValueError: If there is no cat gait of this name.
    """
    if name not in FOOTFALLS:
        raise ValueError(f"{name!r} is not a cat gait; choose {', '.join(FOOTFALLS)}")
    rows = cat_keyframes(FOOTFALLS[name], amplitude, lean)
    return keyframes(rows, period, name=name, source="ch. 5, Sec. 3.2; keyframes reconstructed")


def waypoints(
    angles: Sequence[Sequence[float]],
    period: float,
    phases: Sequence[float] | None = None,
    tilts: int = 4,
) -> Gait:
    """A closed, piecewise linear gait through the given tilt angles.

    Args:
        angles: waypoints of ``tilts`` angles, rad; the last segment leads back to the first
        period: s
        phases: when each waypoint is reached, as a fraction of the period; evenly spaced by default
        tilts: number of tilts

    Raises:
        ValueError: If the numbers of waypoints and phases differ, or as `keyframes`.
    """
    count = len(angles)
    if phases is None:
        phases = [index / count for index in range(count)] if count else []
    if len(phases) != count:
        raise ValueError(f"{count} waypoints but {len(phases)} phases")
    rows = [(phase, *point) for phase, point in zip(phases, angles, strict=True)]
    rows += [(1.0, *point) for _, *point in rows[:1]]
    return keyframes(rows, period, name="waypoints", tilts=tilts)


def keyframes(
    rows: Iterable[Sequence[float]],
    period: float,
    *,
    name: str = "keyframes",
    source: str = "",
    tilts: int = 4,
) -> Gait:
    """A gait through keyframes, linear in between.

    Args:
        rows: ``(phase, alpha_1, ...)``, phase from 0 to 1, angles in rad
        period: s
        name, source: name and origin of the gait
        tilts: number of tilts

    Raises:
        ValueError: If a row has another number of entries or non-finite ones, the phases do not run
            from 0 to 1 or decrease, three rows share a phase (two make a jump), or the period is
            not positive.
    """
    frames = [tuple(map(as_number, row)) for row in rows]
    for frame in frames:
        if len(frame) != 1 + tilts or not all(map(isfinite, filter(is_known, frame))):
            count = "four" if tilts == 4 else tilts
            raise ValueError(
                f"keyframe {list(frame)}: needs a phase and {count} finite tilt angles"
            )
    phases = [frame[0] for frame in frames]
    if all(map(is_known, phases)):
        check_phases(phases)
    pieces = []
    for (phase, *angles), (end, *ends) in itertools.pairwise(frames):
        # Two rows at one phase make a jump, whose piece is never in force.
        span = xp.maximum(end - phase, 1e-12)
        lines = (((after - before) / span / period, before) for before, after in zip(angles, ends))
        pieces.append((phase * period, *itertools.chain.from_iterable(lines)))
    knots = tuple([value for row in pieces for value in row])
    parameters = GaitParameters(LINEAR, period=_positive(period), keyframes=float(len(pieces)))
    return Gait(name, parameters, knots, source, tilts)


def table(times: Sequence[float], angles: Sequence[Sequence[float]], *, repeats: bool) -> Gait:
    """A gait through the rows of a table along a cubic spline, whose acceleration is continuous.

    Times (s) increase from 0; angles (rad) have a row each, at least 2. A gait that repeats starts
    over after the last row, smoothly; else it holds it.

    Raises:
        ValueError: If a gait that repeats does not end where it begins.
    """
    ends = "periodic" if repeats else None
    degree = 3 if repeats else min(3, len(times) - 1)
    knots = spline_knots(times, angles, POWERS[CUBIC], degree=degree, ends=ends)
    parameters = GaitParameters(
        CUBIC,
        period=_positive(times[-1]),
        keyframes=float(len(times) - repeats),
        repeats=float(repeats),
    )
    return Gait("table", parameters, knots, tilts=len(angles[0]))


def harmonic(knots: Sequence[float], period: float, name: str, source: str = "") -> Gait:
    """A harmonic motion about the means of the tilts.

    Args:
        knots: mean, cosine and sine (rad) of each tilt, one after the other
        period: s
        name, source: name and origin of the gait
    """
    parameters = GaitParameters(HARMONIC, period=_positive(period))
    return Gait(name, parameters, tuple(knots), source, len(knots) // 3)


def _positive(period: Any) -> Any:
    if is_known(period) and not (isfinite(period) and period > 0.0):
        raise ValueError(f"period = {period}: must be positive and finite")
    return as_number(period)
