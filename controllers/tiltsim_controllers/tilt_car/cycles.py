"""Motions of the tilt-car in closed form: the drift of its states, and the penguin's limit cycle.

**Drift (ch. 10, Secs. 4.2 and 6.2).** The car's acceleration is a function of three numbers, both
rotor speeds and the tilt, where two would suffice: each acceleration is produced along a curve of
inputs, parametrized by the *lean* ``beta``, the angle from the thrusts' bisector to the
acceleration. The minimum-norm controller moves the inputs perpendicular to these curves. The planes
perpendicular to them are not tangent to any surfaces (Frobenius: ``n . curl n != 0``), so inputs
that follow a closed path of accelerations do not return to their start: the lean advances by a
holonomy, unobserved by the controller.

On a circle the acceleration keeps its magnitude ``A`` and turns at ``Omega``, and the minimum of
``W beta'^2 + alpha'^2`` under ``beta' + kappa alpha' = Omega`` gives the drift in closed form::

    beta' = Omega / (1 + kappa^2 W(beta))

with ``kappa = 1 - I_T / I_B`` and ``W`` the squared speed of the rotor speeds per lean
(`lean_stiffness`). It has the sign of ``Omega``, continues until a rotor stops at ``beta = theta``,
and slows down on the way there, as ``W`` grows without bound.

**Limit cycle of the large penguin swing (ch. 11), half a period at a time.** With ``e_x = 0`` the
error along y obeys ``e'' = -K_Y1 e' - K_Y2 e`` while both rotors push, and ``e'' = -+ tan(Lambda -
theta)`` while one is stopped (ch. 11, Eqs. 30-32). The latter, and with it Lemma 3, requires
``Lambda + theta = pi / 2``: the rotor that would have to pull then has no component along x, so
that ``e_x`` stays zero without it. Over half a period a map takes the state ``(e_y, e_y')`` to the
next; the swing to the other side is its mirror image. A fixed point of the map followed by the
mirror, ``-P(s) = s``, is a limit cycle, stable if the eigenvalues of the map's Jacobian there lie
within the unit circle.

`half_period` takes the state at the start of a half period with the thrusts' bisector at
``+Lambda``. Everything is in the frame of that half; for the other one both signs change.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from math import cos, exp, isclose, pi, sin, sqrt, tan
from typing import Any, NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats, Pair
from tiltsim_controllers.tilt_car.laws import lyapunov_candidate
from tiltsim_controllers.tilt_car.vehicle import TiltCar, turn_per_tilt


class Orbit(NamedTuple):
    """Uniform motion around a circle."""

    acceleration: float  # [A] m/s^2, toward the center
    angular_frequency: float  # [Omega] rad/s, positive counter-clockwise


def orbit(radius: float, angular_frequency: float) -> Orbit:
    """The orbit of a radius (m, of either sign) at an angular frequency (rad/s)."""
    return Orbit(abs(radius) * angular_frequency**2, angular_frequency)


def lean_stiffness(lean: float, acceleration: float, car: TiltCar) -> float:
    """``W(beta)`` ((rad/s)^2/rad^2): squared change of the rotor speeds per lean.

    ``lean`` in rad, ``acceleration`` in m/s^2.
    """
    theta = car.half_angle
    scale = _scale(acceleration, car)
    return scale * sum(cos(angle) ** 2 / sin(angle) for angle in (theta + lean, theta - lean))


def _scale(acceleration: float, car: TiltCar) -> float:
    return car.mass * acceleration / (4.0 * car.thrust_coefficient * sin(2.0 * car.half_angle))


def drift_rate(lean: float, path: Orbit, car: TiltCar) -> float:
    """The rate (rad/s) at which the lean (rad) advances under the minimum-norm controller."""
    stiffness = lean_stiffness(lean, path.acceleration, car)
    return path.angular_frequency / (1.0 + turn_per_tilt(car) ** 2 * stiffness)


def _slopes(function: Callable[[Floats], Floats], at: Floats, steps: Floats) -> Floats:
    """Derivatives by the entries of a vector, as columns, by central differences."""
    sides = [(function(at + step), function(at - step)) for step in np.diag(steps)]
    return np.stack([(up - down) / (2.0 * h) for (up, down), h in zip(sides, steps)], axis=1)


STEPS = 64
"""Intervals of a half period in which the switch is bracketed."""


@dataclass(frozen=True)
class Swing:
    """A penguin swing under the controller of ch. 11."""

    half_angle: float  # ``theta``, rad
    half_period: float  # ``T / 2``, s
    gains: Any  # of `tilt_car.laws`
    reference_acceleration: float = 1.0  # along x, m/s^2

    @property
    def direction(self) -> float:
        """``Lambda`` (rad), at which one thrust has no component along x."""
        return 0.5 * pi - self.half_angle

    @property
    def push(self) -> float:
        """``e_y''`` (m/s^2) with rotor 2 alone, whose thrust for x also pushes along y."""
        return -self._side

    @property
    def _side(self) -> float:
        """The minimum acceleration along y at the desired one along x."""
        return self.reference_acceleration * tan(self.direction - self.half_angle)

    def both_push(self, state: Pair) -> bool:
        """Whether both rotors push: the desired acceleration lies between the thrusts (Prop. 4)."""
        error, rate = state
        return self.gains.y[0] * rate + self.gains.y[1] * error > self._side

    def after_both_push(self, time: float, state: Pair) -> Pair:
        """The state after a time (s) of both rotors pushing (ch. 11, Eq. 42)."""
        error, rate = state
        k1, k2 = self.gains.y
        discriminant = 0.25 * k1 * k1 - k2
        decay = exp(-0.5 * k1 * time)
        if isclose(discriminant, 0.0, abs_tol=1e-12):
            even, odd = 1.0, time
        elif discriminant > 0.0:
            root = sqrt(discriminant)
            even, odd = float(np.cosh(root * time)), float(np.sinh(root * time)) / root
        else:
            root = sqrt(-discriminant)
            even, odd = cos(root * time), sin(root * time) / root
        mixed = rate + 0.5 * k1 * error
        return (
            decay * (even * error + odd * mixed),
            decay * (even * rate - odd * (0.5 * k1 * rate + k2 * error)),
        )

    def after_one_push(self, time: float, state: Pair) -> Pair:
        """The state after a time (s) of one rotor pushing (ch. 11, Eq. 53)."""
        error, rate = state
        return error + rate * time + 0.5 * self.push * time * time, rate + self.push * time


@dataclass(frozen=True)
class Half:
    """The result of half a period: the state at its end, and how long both rotors pushed (s)."""

    end: Pair
    free_time: float


def half_period(swing: Swing, start: Pair) -> Half:
    """Follow a state (e_y in m, e_y' in m/s) through half a period, in closed form.

    While both rotors push the state approaches the line of Eq. (40); from there one rotor pushes
    until the end (Remark 4).
    """
    if not swing.both_push(start):
        return Half(swing.after_one_push(swing.half_period, start), 0.0)
    times = np.linspace(0.0, swing.half_period, STEPS + 1).tolist()
    for low, high in itertools.pairwise(times):
        if not swing.both_push(swing.after_both_push(high, start)):
            _, switch = _bisected(
                lambda time: swing.both_push(swing.after_both_push(time, start)), low, high
            )
            between = swing.after_both_push(switch, start)
            return Half(swing.after_one_push(swing.half_period - switch, between), switch)
    return Half(swing.after_both_push(swing.half_period, start), swing.half_period)


def _bisected(holds: Callable[[float], bool], low: float, high: float) -> Pair:
    """The neighboring numbers between which a condition that holds at the first ends."""
    while (middle := 0.5 * (low + high)) not in (low, high):
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def mirrored_map(swing: Swing, state: Pair) -> Pair:
    """The half-period Poincaré map followed by the mirror, ``s -> -P(s)``."""
    error, rate = half_period(swing, state).end
    return -error, -rate


def jacobian(swing: Swing, state: Pair) -> Floats:
    """The mirrored map's Jacobian at a state, shape (2, 2), by central differences."""

    def mapped(state: Floats) -> Floats:
        return np.array(mirrored_map(swing, (float(state[0]), float(state[1]))))

    return _slopes(mapped, np.array(state), np.full(2, 1e-6))


def limit_cycle(swing: Swing, guess: Pair = (0.2, 0.7)) -> Pair:
    """The fixed point of the mirrored map, by Newton's method.

    Raises:
        ValueError: If there is none near the guess.
    """
    state = np.array(guess)
    for _ in range(50):
        at = (float(state[0]), float(state[1]))
        residual = np.array(mirrored_map(swing, at)) - state
        if float(np.abs(residual).max()) < 1e-13:
            return at
        state = state - np.linalg.solve(jacobian(swing, at) - np.eye(2), residual)
    raise ValueError(f"no limit cycle near (e_y, e_y') = {guess}")


def multipliers(swing: Swing, state: Pair) -> Floats:
    """Eigenvalues of the mirrored map at its fixed point, largest first, shape (2,).

    The errors of a disturbed cycle decay by these factors every half period.
    """
    values = np.linalg.eigvals(jacobian(swing, state))
    return np.asarray(values[np.argsort(-np.abs(values))])


def lyapunov(swing: Swing, state: Pair) -> float:
    """The Lyapunov candidate of ch. 11 at a state, m^2/s^2 (Eq. 49)."""
    return lyapunov_candidate(*state, swing.gains)


def lyapunov_growth(swing: Swing, state: Pair) -> float:
    """The growth of the candidate over the half period from a state (Eq. 70)."""
    return lyapunov(swing, half_period(swing, state).end) - lyapunov(swing, state)


@dataclass(frozen=True)
class LyapunovBound:
    """Proposition 7 in numbers."""

    critical: float
    """``L_critical``: the largest candidate from which the next half period may still raise it."""
    largest_gain: float
    """The largest growth over a half period; the chapter rounds it up to 3/4 (Eq. 71)."""
    at: Pair  # the state of ``L_critical``

    @property
    def published(self) -> float:
        """The bound as published, ``L_critical + 3/4`` (Eq. 77)."""
        return self.critical + 0.75


def lyapunov_bound(swing: Swing, points: int = 161) -> LyapunovBound:
    """``L_critical`` and the largest growth over the zone of Eq. (39), on ``points`` rays.

    On every ray from the origin into the zone's quadrant the growth decreases with the distance.
    Its zero is found by bisection; ``L_critical`` is the largest candidate there of all rays.
    """
    angles = np.linspace(0.0, 0.5 * np.pi, points)
    critical, at, largest = 0.0, (0.0, 0.0), 0.0
    for angle in angles.tolist():
        # In the ellipse's coordinates rays are lines through states of proportional errors.
        unit = (cos(angle) * sqrt(2.0 / swing.gains.y[1]), sin(angle) * sqrt(2.0))
        edge = _edge(swing, unit)
        gain = lyapunov_growth(swing, (edge * unit[0], edge * unit[1]))
        largest = max(largest, gain)
        if gain < 0.0:
            continue

        def grows(share: float, unit: Pair = unit) -> bool:
            return lyapunov_growth(swing, (share * unit[0], share * unit[1])) > 0.0

        low, high = edge, max(2.0 * edge, 1.0)
        while grows(high):
            low, high = high, 2.0 * high
        low, _ = _bisected(grows, low, high)
        if low * low > critical:
            critical, at = low * low, (low * unit[0], low * unit[1])
    return LyapunovBound(critical, largest, at)


def _edge(swing: Swing, unit: Pair) -> float:
    """The distance along a ray at which the zone of Eq. (39) begins."""
    k1, k2 = swing.gains.y
    slope = k1 * unit[1] + k2 * unit[0]
    return -swing.push / slope * (1.0 + 1e-12)
