"""Gaits of the tilt-car, which has one tilt angle (ch. 10, Sec. 5; ch. 11, Sec. 3).

The chapters plan the direction of the thrusts. The tilt angle that turns them there is larger by
the factor ``1 / (1 - I_T / I_B)``, because the bottom disc counter-rotates.
"""

from __future__ import annotations

from math import floor

from tiltsim_controllers.gaits.parameters import TiltsAndRates
from tiltsim_controllers.mathematics.scalar import scalar


@scalar
def penguin_swing(time: float, amplitude: float, period: float) -> TiltsAndRates:
    """Minus the amplitude (rad) for half a period (s), then plus the amplitude (ch. 11, Sec. 3)."""
    phase = time - floor(time / period) * period
    angle = -amplitude if phase < 0.5 * period else amplitude
    return angle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@scalar
def rotating(time: float, start: float, rate: float) -> TiltsAndRates:
    """An angle that grows from ``start`` (rad) at a constant rate (rad/s) (ch. 10, Eq. 18)."""
    return start + rate * time, 0.0, 0.0, 0.0, rate, 0.0, 0.0, 0.0
