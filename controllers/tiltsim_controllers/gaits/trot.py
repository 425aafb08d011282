"""The cat-trot gaits of ch. 4: diagonal symmetry, -alpha_1 = -alpha_2 = alpha_3 = alpha_4 = rho."""

from __future__ import annotations

from math import floor

from tiltsim_controllers.gaits.parameters import TiltsAndRates
from tiltsim_controllers.mathematics.scalar import scalar


@scalar
def _trot(rho: float, rate: float) -> TiltsAndRates:
    """Tilt angles and rates of the trot angle ``rho`` (ch. 4, Eqs. 21-24)."""
    return -rho, -rho, rho, rho, -rate, -rate, rate, rate


@scalar
def instant_trot(time: float, amplitude: float, period: float) -> TiltsAndRates:
    """``rho`` switches between plus and minus the amplitude at half periods (ch. 4, Eq. 33).

    Time and period in s, amplitude in rad.
    """
    phase = time - floor(time / period) * period
    if phase <= 0.5 * period:
        return _trot(amplitude, 0.0)
    return _trot(-amplitude, 0.0)


@scalar
def continuous_trot(time: float, amplitude: float, period: float) -> TiltsAndRates:
    """``rho`` moves from plus to minus the amplitude and back at constant rate (ch. 4, Eq. 34).

    Time and period in s, amplitude in rad.
    """
    phase = time - floor(time / period) * period
    rate = 4.0 * amplitude / period
    if phase <= 0.5 * period:
        return _trot(amplitude - rate * phase, -rate)
    return _trot(-amplitude + rate * (phase - 0.5 * period), rate)
