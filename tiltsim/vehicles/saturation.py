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
