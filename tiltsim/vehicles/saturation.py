"""Rotors at their speed limits."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tiltsim.vehicles.spans import first_and_last, time_of
from tiltsim_controllers.mathematics.scalar import Floats

TOLERANCE: Final = 1e-9  # relative: the integrator stops at a limit up to rounding


def at_upper_limit(speeds: Floats, limit: Any) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their upper limit; nowhere without one."""
    return speeds >= (np.inf if limit is None else limit * (1.0 - TOLERANCE))


def at_lower_limit(speeds: Floats, limit: Any) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their lower limit; nowhere without one."""
    return speeds <= (-np.inf if limit is None else limit * (1.0 + TOLERANCE))


def saturation_metrics(time: Floats, saturated: npt.NDArray[np.bool_]) -> dict[str, Any]:
    """Share of the samples with a rotor at its limit, and the first and last of them, or NaN.

    ``time`` in s, shape (N,); ``saturated`` of shape (rotors, ..., N).
    """
    limited: npt.NDArray[np.bool_] = np.any(saturated, axis=0)
    first, last = first_and_last(limited)
    return {
        "saturated_fraction": limited.mean(axis=-1),
        "first_saturation_time": time_of(time, first),
        "last_saturation_time": time_of(time, last),
    }
