"""Gaits that hold the vehicle level against a constant acceleration (ch. 1, Sec. 2).

At level attitude the torque-free force ``n(alpha)`` must point along ``(-ax, -ay, g - az)``. With
``delta = atan(r)``, sums ``E13 = alpha_1 + alpha_3``, ``E24 = alpha_2 + alpha_4`` and differences
``D13 = alpha_1 - alpha_3``, ``D24 = alpha_2 - alpha_4`` it is, up to a factor,

    ``n_x = A sin D24``, ``n_y = -B sin D13``,
    ``n_z = A (cos(E24 + delta) / cos(delta) + cos D24) + B (cos(E13 - delta) / cos(delta) + cos
    D13)``,

with ``A = sin(2 delta - E13) / sin(2 delta)`` and ``B = sin(2 delta + E24) / sin(2 delta)``. Pods
with opposite tilts in pairs, E13 = E24 = 0, load the rotors evenly. A gait may tilt less by
shifting load to the pair that produces the side force, in the limit until the other pair stops (A
or B zero); where both are zero, at the point P of the Two Color Map, ``n`` vanishes. The decoupling
matrix is singular in both cases, so `balanced_gait` minimizes the tilt with A and B bounded away
from zero.
"""

from __future__ import annotations

from math import asin, atan, hypot, isfinite, pi, radians, sin
from typing import Any, Final

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

MAX_TILT: Final = radians(60.0)
MIN_LEVER: Final = 0.5
STARTS: Final = (0.1, 0.6)
"""Tilt angles (rad) of the starts of the search, opposite pods apart."""
_TOLERANCE: Final = 1e-9


def side_slopes(acceleration: Triple, gravity: float) -> tuple[float, float]:
    """Ratio of side force to lift, along x and y, that balances an acceleration (m/s^2).

    Raises:
        ValueError: If the acceleration is not finite or the vehicle would have to push downwards.
    """
    ax, ay, az = acceleration
    lift = gravity - az
    if not (isfinite(ax) and isfinite(ay) and isfinite(az)):
        raise ValueError(f"acceleration {_shown(acceleration)}: must be finite")
    if lift <= 0.0:
        raise ValueError(
            f"acceleration {_shown(acceleration)}: az = {az:g} m/s^2 lifts the vehicle against"
            f" gravity, {gravity:g}; must be smaller"
        )
    return -ax / lift, -ay / lift


def balanced_gait(
    acceleration: Triple,
    vehicle: Vehicle,
    *,
    max_tilt: float = MAX_TILT,
    min_lever: float = MIN_LEVER,
) -> Quad:
    """The gait with the smallest sum of squared tilts that hovers level under an acceleration.

    Args:
        acceleration: Constant acceleration that acts on the vehicle, m/s^2, world axes at yaw 0; a
            gust along +x is ``(1, 0, 0)``.
        vehicle: the tiltrotor
        max_tilt: largest tilt angle of a pod, rad
        min_lever: Lower bound of A and B, the yaw levers of the two pairs of rotors relative to no
            tilt.

    Returns:
        The four tilt angles in rad.

    Raises:
        ValueError: If no gait within the limits balances the acceleration, naming it and the
            limits.
    """
    if not 0.0 < max_tilt < 0.5 * pi:
        raise ValueError(f"max_tilt = {max_tilt:g}: must lie between 0 and pi/2 rad")
    if not 0.0 < min_lever <= 1.0:
        raise ValueError(f"min_lever = {min_lever:g}: must lie between 0 and 1")
    x, y = side_slopes(acceleration, vehicle.gravity)
    if x == 0.0 and y == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    ratio = drag_ratio(vehicle)
    # A >= min_lever where E13 is at most this, B >= min_lever where E24 is at least its negative.
    twist = 2.0 * atan(ratio)
    max_sum = twist - asin(min_lever * sin(twist))
    even = np.sign([-y, x, y, -x])
    found = [_minimum_tilt(size * even, x, y, ratio, max_sum, max_tilt) for size in STARTS]
    balanced = [tilts for tilts in found if tilts is not None]
    if not balanced:
        raise ValueError(
            f"acceleration {_shown(acceleration)}: out of reach, needs a side force of"
            f" {hypot(x, y):.3g} times the lift; no gait makes it with tilt angles up to"
            f" {max_tilt:.3g} rad and yaw levers of {min_lever:g} or more"
        )
    a1, a2, a3, a4 = min(balanced, key=lambda tilts: float(tilts @ tilts)).tolist()
    return a1, a2, a3, a4


def _minimum_tilt(
    start: Floats, x: float, y: float, ratio: float, max_sum: float, max_tilt: float
) -> Floats | None:
    """Minimize the squared tilt angles subject to balance and limits; None where none are met."""
    from scipy.optimize import minimize  # a third of a second to import

    def imbalance(tilts: Any) -> Any:
        """Zero where ``n`` is parallel to ``(x, y, 1)``; on arrays real or complex."""
        nx, ny, nz = torque_free_force(tilts, ratio)
        return np.array([nx - x * nz, ny - y * nz])

    def slopes(tilts: Floats) -> Floats:
        """Derivatives by complex steps, exact to rounding."""
        steps = 1e-30j * np.eye(4)
        return np.stack([imbalance(tilts + step).imag / 1e-30 for step in steps], axis=1)

    sums = np.array([[-1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    tilts: Floats = minimize(
        lambda tilts: float(tilts @ tilts),
        start,
        jac=lambda tilts: 2.0 * tilts,
        method="SLSQP",
        bounds=[(-max_tilt, max_tilt)] * 4,
        constraints=[
            {"type": "eq", "fun": imbalance, "jac": slopes},
            {"type": "ineq", "fun": lambda tilts: sums @ tilts + max_sum, "jac": lambda _: sums},
        ],
        options={"ftol": 1e-15, "maxiter": 200},
    ).x
    # With so fine a tolerance the optimizer often reports failure for lack of further progress, so
    # its solution is checked here instead, after two Newton steps against its residual.
    for _ in range(2):
        tilts = tilts - np.linalg.pinv(slopes(tilts)) @ imbalance(tilts)
    valid = (
        np.abs(imbalance(tilts)).max() < _TOLERANCE
        and torque_free_force(tilts, ratio)[2] > 0.0
        and (sums @ tilts + max_sum).min() > -_TOLERANCE
        and np.abs(tilts).max() < max_tilt + _TOLERANCE
    )
    return tilts if valid else None


def _shown(acceleration: Triple) -> str:
    return "(" + ", ".join(f"{value:g}" for value in acceleration) + ")"
