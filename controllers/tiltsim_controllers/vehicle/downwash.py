"""The wake of a hovering rotorcraft, and its force on the vehicles below.

By momentum theory the wake of a vehicle in hover carries the momentum of its weight, at twice the
induced velocity of its rotors. Below it spreads as a turbulent round jet (Pope, Turbulent Flows,
2000, Sec. 5.1), as measured below quadrotors (Bauersfeld et al., Robotics meets Fluid Dynamics,
arXiv 2403.13321): its velocity is a Gaussian of the distance from the axis, its width grows in
proportion to the depth, and its momentum stays.
"""

from __future__ import annotations

from math import log, pi, sqrt
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp

HALF_WIDTH_RATE: Final = 0.094
"""Growth with depth of the radius at which a round jet has half its velocity (Pope, Table 5.1)."""

SPREADING: Final = HALF_WIDTH_RATE / sqrt(log(2.0))
"""Growth with depth of the radius at which it has 1/e of its velocity on the axis."""


class Wake(NamedTuple):
    """The wake of a vehicle that hovers."""

    weight: float  # N
    disc_area: float  # m^2, of all rotors together


class Downwash(NamedTuple):
    """The wakes' effect on a vehicle."""

    density: float = 1.225  # kg/m^3
    drag_area: float = 0.0  # m^2, drag coefficient times area


def wake_velocity(depth: Any, distance: Any, wake: Wake, density: float) -> Any:
    """Velocity of the air (m/s, downwards), shape (), 0 above the vehicle.

    Args:
        depth: Below the vehicle's center, m.
        distance: From the vertical through it, m.
        wake: The vehicle.
        density: Density of the air, kg/m^3.
    """
    width = xp.sqrt(wake.disc_area / pi) + SPREADING * xp.maximum(depth, 0.0)
    on_axis = xp.sqrt(2.0 * wake.weight / (pi * density)) / width
    share = distance / width
    return xp.where(depth > 0.0, on_axis * xp.exp(-share * share), 0.0)


def downwash_force(places: Any, number: Any, wakes: Any, downwash: Downwash) -> Any:
    """Force (N, along z of the world, not above 0) of all wakes on a vehicle, shape ().

    Args:
        places: Positions of all vehicles, m, shape (vehicles, 3).
        number: The vehicle, from 0.
        wakes: The `Wake` of each vehicle.
        downwash: The effect on the vehicle.
    """
    velocity: Any = 0.0
    for other, wake in enumerate(wakes):
        if other != number:
            x, y, depth = places[other] - places[number]
            distance = xp.sqrt(x * x + y * y)
            velocity = velocity + wake_velocity(depth, distance, wake, downwash.density)
    return 0.0 - 0.5 * downwash.density * downwash.drag_area * velocity * velocity
