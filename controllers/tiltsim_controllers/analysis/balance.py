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

from collections.abc import Callable
from math import asin, atan, cos, hypot, inf, isfinite, pi, radians, sin
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize

from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

MAX_TILT: Final = radians(60.0)
MIN_LEVER: Final = 0.5
_GRID: Final = 61
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
    tilts = _best_on_grid(x, y, ratio, max_sum, max_tilt)
    if tilts is None:
        raise ValueError(
            f"acceleration {_shown(acceleration)}: out of reach, needs a side force of"
            f" {hypot(x, y):.3g} times the lift; no gait makes it with tilt angles up to"
            f" {max_tilt:.3g} rad and yaw levers of {min_lever:g} or more"
        )
    a1, a2, a3, a4 = _minimum_tilt(tilts, x, y, ratio, max_sum, max_tilt).tolist()
    return a1, a2, a3, a4


def _best_on_grid(
    x: float, y: float, ratio: float, max_sum: float, max_tilt: float
) -> Floats | None:
    """The balanced gait of minimum tilt on a grid of E13 and E24; None where there is none.

    For each grid point one monotonic equation in ``n_z`` gives D13 and D24 up to 90 degrees. The
    grid finds the basin of the global minimum, `_minimum_tilt` the minimum.
    """
    delta = atan(ratio)
    sums = np.linspace(max_sum - 1.5, max_sum, _GRID)
    e13, e24 = np.meshgrid(np.append(sums, 0.0), np.append(-sums, 0.0))
    a = np.sin(2.0 * delta - e13) / sin(2.0 * delta)
    b = np.sin(2.0 * delta + e24) / sin(2.0 * delta)
    upright = a * np.cos(e24 + delta) / cos(delta) + b * np.cos(e13 - delta) / cos(delta)
    low = np.zeros_like(a)
    reach = 1.0 / np.maximum(np.maximum(abs(x) / a, abs(y) / b), 1e-3)
    high = reach
    for _ in range(60):
        middle = 0.5 * (low + high)
        across = a * _cosine(x * middle / a) + b * _cosine(y * middle / b)
        above = upright + across > middle
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    d24, d13 = (
        np.arcsin(np.clip(x * low / a, -1.0, 1.0)),
        np.arcsin(np.clip(-y * low / b, -1.0, 1.0)),
    )
    tilts = 0.5 * np.stack([e13 + d13, e24 + d24, e13 - d13, e24 - d24])
    size = np.sum(tilts**2, axis=0)
    size[(high >= reach) | (np.abs(tilts).max(axis=0) > max_tilt)] = inf
    best = np.unravel_index(np.argmin(size), size.shape)
    return None if size[best] == inf else np.asarray(tilts[:, best[0], best[1]])


def _minimum_tilt(
    start: Floats, x: float, y: float, ratio: float, max_sum: float, max_tilt: float
) -> Floats:
    """Minimize the squared tilt angles subject to balance and limits, from a nearby start."""

    def balance(tilts: Any) -> Any:
        return _imbalance(tilts, x, y, ratio)

    sums = np.array([[-1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    found = minimize(
        lambda tilts: float(tilts @ tilts),
        start,
        jac=lambda tilts: 2.0 * tilts,
        method="SLSQP",
        bounds=[(-max_tilt, max_tilt)] * 4,
        constraints=[
            {"type": "eq", "fun": balance, "jac": lambda tilts: _jacobian(balance, tilts)},
            {"type": "ineq", "fun": lambda tilts: sums @ tilts + max_sum, "jac": lambda _: sums},
        ],
        options={"ftol": 1e-15, "maxiter": 200},
    )
    # With so fine a tolerance the optimizer often reports failure for lack of further progress, so
    # its solution is checked here instead; the start is balanced and within the limits.
    tilts = _onto_balance(np.asarray(found.x, dtype=float), x, y, ratio)
    valid = (
        np.abs(balance(tilts)).max() < _TOLERANCE
        and (sums @ tilts + max_sum).min() > -_TOLERANCE
        and np.abs(tilts).max() < max_tilt + _TOLERANCE
    )
    return tilts if valid and tilts @ tilts <= start @ start else start


def _onto_balance(tilts: Floats, x: float, y: float, ratio: float) -> Floats:
    """Remove the optimizer's residual by two minimum-norm Newton steps."""
    for _ in range(2):
        residual = _imbalance(tilts, x, y, ratio)
        slopes = _jacobian(lambda point: _imbalance(point, x, y, ratio), tilts)
        tilts = tilts - np.linalg.pinv(slopes) @ residual
    return tilts


def _imbalance(tilts: Any, x: float, y: float, ratio: float) -> Any:
    """Zero where ``n`` is parallel to ``(x, y, 1)``; on arrays real or complex."""
    nx, ny, nz = torque_free_force(tilts, ratio)
    return np.array([nx - x * nz, ny - y * nz])


def _jacobian(function: Callable[[Any], Any], point: Floats) -> Floats:
    """Derivatives by complex steps, exact to rounding."""
    columns = [function(point + 1e-30j * axis).imag / 1e-30 for axis in np.eye(4)]
    return np.asarray(np.stack(columns, axis=1), dtype=float)


def _cosine(sine: Any) -> Any:
    return np.sqrt(np.maximum(0.0, 1.0 - sine * sine))


def _shown(acceleration: Triple) -> str:
    return "(" + ", ".join(f"{value:g}" for value in acceleration) + ")"
