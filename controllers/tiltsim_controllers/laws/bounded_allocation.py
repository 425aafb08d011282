"""Least squares within bounds, for demands that rotors and tilts meet as their limits allow.

The minimum of ``sum (G x - y)^2 / softness + sum q (x - start)^2`` has a dual system with a row for
each of the six demands, whatever the number of inputs. A small softness makes a demand nearly
exact, and sets its priority where limits forbid to meet all; inputs without any effect on them stay
at the start. Inputs beyond their limits leave the system in turn, the farthest first (redistributed
pseudoinverse, Bodson 2002, "Evaluation of optimization methods for control allocation").
"""

from __future__ import annotations

from typing import Any, Final

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.blocks import repeat
from tiltsim_controllers.mathematics.linear import solved_symmetric

TOLERANCE: Final = 1e-12
"""How far beyond a limit, in units of the weighted input, counts as beyond."""


def bounded_least_squares(
    matrix: Any, demand: Any, softness: Any, weights: Any, start: Any, low: Any, high: Any
) -> Any:
    """Inputs within limits that meet a demand, shape (n,).

    Args:
        matrix: Effect of the inputs, ``G``, shape (6, n).
        demand: ``y``, shape (6,).
        softness: Shape (6,), positive.
        weights: ``q``, shape (n,), positive.
        start: Shape (n,).
        low, high: Limits, shape (n,).
    """
    root = xp.sqrt(weights)
    lead = xp.diag(softness)

    def turn(_: Any, x: Any, free: Any, worst: Any) -> tuple[Any, Any, Any]:
        rest = demand - matrix @ (free * start + (1.0 - free) * x)
        dual = solved_symmetric((matrix * (free / weights)) @ matrix.T + lead, rest)
        x = xp.where(free > 0.5, start + (dual @ matrix) / weights, x)
        beyond = free * root * xp.maximum(low - x, x - high)
        worst = largest(beyond)
        leaves = (beyond > 0.5 * worst) & (beyond > TOLERANCE)
        return xp.where(leaves, xp.clip(x, low, high), x), xp.where(leaves, 0.0, free), worst

    size = len(start)
    state = (start, xp.ones(size), 1.0)
    x, _, _ = repeat(float(size), turn, *state, until=lambda _x, _free, worst: worst <= TOLERANCE)
    return xp.clip(x, low, high)


def largest(values: Any) -> Any:
    """The largest of some numbers."""
    most = values[0]
    for value in values[1:]:
        most = xp.maximum(most, value)
    return most
