"""Rotors at their speed limits."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from tiltsim_controllers.mathematics.scalar import Floats

TOLERANCE: Final = 1e-9  # relative: the integrator stops at a limit up to rounding


def at_upper_limit(speeds: Floats, limit: float | None) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their upper limit; nowhere without one."""
    return speeds >= (np.inf if limit is None else limit * (1.0 - TOLERANCE))


def at_lower_limit(speeds: Floats, limit: float | None) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their lower limit; nowhere without one."""
    return speeds <= (-np.inf if limit is None else limit * (1.0 + TOLERANCE))


def saturation_metrics(time: Floats, saturated: npt.NDArray[np.bool_]) -> dict[str, float | bool]:
    """Share of the samples with a rotor at its limit, and the first and last of them if any.

    ``time`` in s, shape (N,); ``saturated`` of shape (rotors, N).
    """
    limited = saturated.any(axis=0)
    metrics: dict[str, float | bool] = {"saturated_fraction": float(limited.mean())}
    if limited.any():
        first, last = np.flatnonzero(limited)[[0, -1]]
        metrics["first_saturation_time"] = float(time[first])
        metrics["last_saturation_time"] = float(time[last])
    return metrics
