"""Gaits of the tilt-car: its one tilt angle, planned (ch. 10, Eq. 18; ch. 11, Sec. 3).

What the chapters plan is the direction of the thrusts. The tilt angle that turns them there is
larger, for the bottom disc turns back: by ``1 / (1 - I_T / I_B)``.
"""

from __future__ import annotations

from math import floor

from tiltsim_controllers.gaits.trot import TiltsAndRates
from tiltsim_controllers.mathematics.scalar import scalar


@scalar
def penguin_swing(time: float, amplitude: float, period: float) -> TiltsAndRates:
    """A swing to minus the amplitude (rad) for half a period, then to plus, at once (ch. 11)."""
    phase = time - floor(time / period) * period
    angle = -amplitude if phase < 0.5 * period else amplitude
    return angle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@scalar
def rotating(time: float, start: float, rate: float) -> TiltsAndRates:
    """An angle (rad) that grows at a constant rate (rad/s) for ever (ch. 10, Eq. 18)."""
    return start + rate * time, 0.0, 0.0, 0.0, rate, 0.0, 0.0, 0.0
