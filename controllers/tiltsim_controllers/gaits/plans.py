"""Planned gaits with name, source and properties, and their constructors.

A `Gait` combines the parameters and knots of `tiltsim_controllers.gaits.tilts.tilt_reference` with
the gait's name and source, and computes its period, amplitude, continuity and largest rate.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim_controllers.gaits import tabulated
from tiltsim_controllers.gaits.any_tilts import Jets, tilt_motion_of
from tiltsim_controllers.gaits.cat import FOOTFALLS, cat_keyframes
from tiltsim_controllers.gaits.parameters import (
    FIXED,
    KEYFRAMES,
    NO_KNOTS,
    PENGUIN,
    ROTATING,
    TABLE,
    TROT_CONTINUOUS,
    TROT_INSTANT,
    TWO_COLOR_CIRCLE,
    GaitParameters,
)
from tiltsim_controllers.gaits.two_color import COLORS
from tiltsim_controllers.mathematics.splines import spline_knots
from tiltsim_controllers.vehicle.parameters import drag_ratio

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike

    from tiltsim_controllers.mathematics.scalar import Floats
    from tiltsim_controllers.vehicle.parameters import Vehicle


_TABLE_SAMPLES: Final = 20_000
"""Samples in which the extremes of a table are sought."""


@dataclass(frozen=True)
class Gait:
    """A gait ready to be flown: pass `parameters` and `knots` to `tilt_reference`.

    Another number of tilts than four has `tilt_motion_of`.
    """

    name: str
    parameters: GaitParameters
    knots: tuple[float, ...] = NO_KNOTS
    source: str = ""
    tilts: int = 4

    @property
    def is_constant(self) -> bool:
        """Whether the tilt angles never change."""
        return self.parameters.type == FIXED

    @property
    def period(self) -> float | None:
        """Seconds after which the gait repeats; None for a constant gait.

        Of a table that does not repeat, its length.
        """
        return None if self.is_constant else self.parameters.period

    @property
    def is_continuous(self) -> bool:
        """Whether the tilt angles are continuous in time (ch. 6, Definition 1)."""
        if self.parameters.type in {TROT_INSTANT, PENGUIN}:
            return self.parameters.amplitude * self.parameters.scale == 0.0
        rows = self._rows()
        if rows is None:
            return True
        closed = bool(np.array_equal(rows[0, 1:], rows[-1, 1:]))
        jumps = np.diff(rows[:, 0]) == 0.0
        return closed and not np.diff(rows[:, 1:], axis=0)[jumps].any()

    @property
    def amplitude(self) -> float:
        """The largest magnitude (rad) of any tilt angle."""
        if self.parameters.type == ROTATING:
            return inf
        rows = self._rows()
        if rows is not None:
            return float(np.abs(rows[:, 1:]).max())
        if self.parameters.type == TABLE:
            return float(np.abs(self._table_motion()[0]).max())
        # The other types reach their extremes at quarters of the period.
        quarters = np.arange(4) / 4.0 * self.parameters.period
        return float(np.abs(self.angles(quarters)).max())

    @property
    def max_rate(self) -> float:
        """The largest magnitude (rad/s) of any tilt rate; infinite where angles jump."""
        if not self.is_continuous:
            return inf
        rows = self._rows()
        if rows is not None:
            steps = np.diff(rows, axis=0)
            steps = steps[steps[:, 0] > 0.0]
            slopes = steps[:, 1:] / steps[:, :1] / self.parameters.period
            return float(np.abs(slopes).max())
        if self.parameters.type == TABLE:
            return float(np.abs(self._table_motion()[1]).max())
        eighths = np.arange(8) / 8.0 * self.parameters.period
        return float(np.abs(self.rates(eighths)).max())

    @property
    def min_segment_time(self) -> float:
        """The shortest time (s) between two corners; infinite without corners, 0 with jumps."""
        if not self.is_continuous:
            return 0.0
        rows = self._rows()
        if rows is not None:
            return float(np.diff(rows[:, 0]).min()) * self.parameters.period
        return 0.5 * self.parameters.period if self.parameters.type == TROT_CONTINUOUS else inf

    def jets(self, time: float) -> Jets:
        """Tilt angles (rad), rates (rad/s) and accelerations (rad/s^2) at a time (s), by tilt."""
        return tilt_motion_of(self.tilts).planned(time, self.parameters, self.knots)

    def angles(self, time: ArrayLike) -> Floats:
        """Tilt angles (rad) at times (s) of shape (...), as an array of shape (..., tilts)."""
        return self._evaluate(time)[..., 0]

    def rates(self, time: ArrayLike) -> Floats:
        """Tilt rates (rad/s) at times (s) of shape (...), as an array of shape (..., tilts)."""
        return self._evaluate(time)[..., 1]

    def sample_times(self, samples: int = 201) -> Floats:
        """Times (s) over one period, with ends and keyframes; only 0 for a constant gait."""
        if self.is_constant:
            return np.zeros(1)
        phases = np.linspace(0.0, 1.0, samples)
        rows = self._rows()
        if rows is not None:
            phases = np.union1d(phases, rows[:, 0])
        if not self.is_continuous:
            # The end of the period belongs to the next one, past the jump.
            phases = phases[:-1]
        return np.asarray(phases * self.parameters.period)

    def scaled(self, divisor: float) -> Gait:
        """The gait with all tilt angles divided by ``divisor`` (ch. 5, Eq. 16).

        Raises:
            ValueError: If the divisor is not positive and finite.
        """
        if not (isfinite(divisor) and divisor > 0.0):
            raise ValueError(f"scale 1/{divisor}: must be positive and finite")
        # Also where the number is 1: the result depends on it, which gradients need.
        parameters = self.parameters._replace(scale=self.parameters.scale / divisor)
        name = self.name if divisor == 1.0 else f"{self.name} / {divisor:g}"
        return replace(self, name=name, parameters=parameters)

    def biased(self, eta: float) -> Gait:
        """The gait with ``alpha_3`` and ``alpha_4`` multiplied by ``eta`` (ch. 6, Eqs. 12-15)."""
        parameters = self.parameters._replace(bias=self.parameters.bias * eta)
        name = self.name if eta == 1.0 else f"{self.name}, biased {eta:.0%}"
        return replace(self, name=name, parameters=parameters)

    def _rows(self) -> Floats | None:
        """The keyframes as flown, shape (N, 1 + tilts); None for gaits without them."""
        if self.parameters.type != KEYFRAMES:
            return None
        rows = np.reshape(self.knots, (-1, 1 + self.tilts))[: int(self.parameters.keyframes)].copy()
        rows[:, 1:] *= self.parameters.scale
        rows[:, 3:] *= self.parameters.bias
        return rows

    def _table_motion(self) -> tuple[Floats, Floats]:
        """Tilt angles and rates of a table as flown, close together, each of shape (..., tilts)."""
        rows = np.reshape(self.knots, (-1, 1 + self.tilts * tabulated.COEFFICIENTS))
        pieces = rows[:-1, 1:].reshape(len(rows) - 1, 1, self.tilts, tabulated.COEFFICIENTS)
        third, second, first, value = np.moveaxis(pieces, -1, 0)
        parts = np.linspace(0.0, 1.0, 2 + _TABLE_SAMPLES // len(rows))
        since = (np.diff(rows[:, 0])[:, np.newaxis] * parts)[..., np.newaxis]
        angles = ((third * since + second) * since + first) * since + value
        rates = (3.0 * third * since + 2.0 * second) * since + first
        back = np.arange(self.tilts) >= 2
        scale = self.parameters.scale * np.where(back, self.parameters.bias, 1.0)
        return scale * angles, scale * rates

    def _evaluate(self, time: ArrayLike) -> Floats:
        times = np.asarray(time, dtype=float)
        jets = [self.jets(t) for t in times.ravel().tolist()]
        return np.reshape(np.asarray(jets, dtype=float), (*times.shape, self.tilts, 3))


def fixed(angles: Sequence[float], *, name: str = "fixed", source: str = "") -> Gait:
    """Constant tilt angles (rad) (ch. 3; ch. 4, Eq. 32), of any number of tilts."""
    values = tuple(map(float, angles))
    if len(values) == 4:
        return Gait(name, GaitParameters(FIXED, *values), source=source)
    return Gait(name, GaitParameters(FIXED), values or NO_KNOTS, source, len(values))


def instant_trot(amplitude: float, period: float) -> Gait:
    """The trot that jumps between plus and minus the amplitude (rad) (ch. 4, Eq. 33)."""
    parameters = GaitParameters(TROT_INSTANT, amplitude=amplitude, period=_positive(period))
    return Gait("trot_instant", parameters, source="ch. 4, Sec. 4.2")


def continuous_trot(amplitude: float, period: float) -> Gait:
    """The trot at constant rate between plus and minus the amplitude (rad) (ch. 4, Eq. 34)."""
    parameters = GaitParameters(TROT_CONTINUOUS, amplitude=amplitude, period=_positive(period))
    return Gait("trot_continuous", parameters, source="ch. 4, Sec. 4.3")


def penguin(name: str, amplitude: float, period: float) -> Gait:
    """The tilt-car's swing between minus and plus the amplitude (rad) (ch. 11, Sec. 3)."""
    parameters = GaitParameters(PENGUIN, amplitude=amplitude, period=_positive(period))
    return Gait(name, parameters, source="ch. 11, Sec. 3, Figs. 7 and 8")


def rotating(start: float, rate: float) -> Gait:
    """A tilt that grows from ``start`` (rad) at a constant rate (rad/s) (ch. 10, Eq. 18)."""
    period = _positive(2.0 * pi / abs(rate)) if rate else 1.0
    parameters = GaitParameters(ROTATING, angle_1=start, rate=rate, period=period)
    return Gait("rotating", parameters, source="ch. 10, Eq. (18)")


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
        ValueError: If a row is not as many finite numbers, the phases do not run from 0 to 1 or
            decrease, three rows share a phase (two make a jump), or the period is not positive.
    """
    frames = [tuple(map(float, row)) for row in rows]
    for frame in frames:
        if len(frame) != 1 + tilts or not all(map(isfinite, frame)):
            count = "four" if tilts == 4 else tilts
            raise ValueError(
                f"keyframe {list(frame)}: needs a phase and {count} finite tilt angles"
            )
    phases = [frame[0] for frame in frames]
    if len(phases) < 2 or phases[0] != 0.0 or phases[-1] != 1.0:
        raise ValueError(f"keyframe phases {phases}: must start at 0 and end at 1")
    if any(later < earlier for earlier, later in itertools.pairwise(phases)):
        raise ValueError(f"keyframe phases {phases}: must not decrease")
    if phases[1] == 0.0 or phases[-2] == 1.0:
        raise ValueError(f"keyframe phases {phases}: only one row may be at 0 and one at 1")
    if any(third == first for first, third in zip(phases, phases[2:], strict=False)):
        raise ValueError(f"keyframe phases {phases}: at most two rows may share a phase")
    parameters = GaitParameters(KEYFRAMES, period=_positive(period), keyframes=float(len(frames)))
    knots = tuple(value for frame in frames for value in frame)
    return Gait(name, parameters, knots, source, tilts)


def table(times: Sequence[float], angles: Sequence[Sequence[float]], *, repeats: bool) -> Gait:
    """A gait through the rows of a table along a cubic spline, whose acceleration is continuous.

    Args:
        times: s, from 0 and increasing, at least 2
        angles: the tilt angles at each, rad
        repeats: whether the gait starts over after the last row, smoothly, or holds it

    Raises:
        ValueError: If a gait that repeats does not end where it begins.
    """
    ends = "periodic" if repeats else None
    degree = 3 if repeats else min(3, len(times) - 1)
    knots = spline_knots(times, angles, tabulated.COEFFICIENTS, degree=degree, ends=ends)
    parameters = GaitParameters(
        TABLE,
        period=_positive(times[-1]),
        keyframes=float(len(times) - repeats),
        repeats=float(repeats),
    )
    return Gait("table", parameters, knots, tilts=len(angles[0]))


def two_color_circle(
    centre: tuple[float, float],
    radius: float,
    color: str,
    period: float,
    vehicle: Vehicle,
    *,
    name: str = "two_color",
    source: str = "",
) -> Gait:
    """A circle in the alpha_1-alpha_2 plane on one colour (ch. 8, Sec. 4).

    Args:
        centre, radius: ``(alpha_1, alpha_2)`` of the centre and the radius, rad
        color: ``red`` or ``blue``
        period: s
        vehicle: its drag ratio sets the offset of the blue lines
        name, source: name and origin of the gait

    Raises:
        ValueError: If the colour is unknown or the period not positive.
    """
    parameters = GaitParameters(
        TWO_COLOR_CIRCLE,
        period=_positive(period),
        centre_1=centre[0],
        centre_2=centre[1],
        radius=radius,
        color=color_code(color),
        drag_ratio=drag_ratio(vehicle),
    )
    return Gait(name, parameters, source=source)


def color_code(color: str) -> float:
    """The code of a colour's name; raises ValueError for any other name."""
    if color not in COLORS:
        raise ValueError(f"{color!r} is not a color; choose {', '.join(COLORS)}")
    return COLORS[color]


def _positive(period: float) -> float:
    if not (isfinite(period) and period > 0.0):
        raise ValueError(f"period = {period}: must be positive and finite")
    return float(period)
