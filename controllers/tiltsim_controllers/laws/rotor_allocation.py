"""Force and torque onto rotors, and onto rotors and tilts, for laws that demand a wrench.

With planned tilts the rotors make any torque and a force along one axis of the body (least norm).
With tilts that the law commands, every rotor's thrust ``T`` enters through ``T cos(alpha)`` and ``T
sin(alpha)``, in which force and torque are linear with constant coefficients: static allocation
(Kamel et al. 2018, "The Voliro omniorientational hexacopter", Eqs. 10 to 13).
"""

from __future__ import annotations

from typing import Any

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.mathematics.linear import (
    nearest_solution,
    norm,
    orthonormal_rows,
    rejection,
)


def lift_without_torque(observed: Observed) -> Any:
    """The shortest thrusts without torque whose force has 1 N along body z, shape (N,).

    Their force ``observed.force @ lift`` is the axis along which the vehicle pushes.
    """
    up = free = observed.force[2]
    for unit in orthonormal_rows(observed.torque):
        free = rejection(free, unit)
    return free / (up @ free)


def allocated_thrusts(observed: Observed, lift: Any, push: Any, torque: Any) -> Any:
    """Thrusts (N) with a torque and a push, shape (N,); NaN where not every torque is possible.

    Args:
        observed: By the law.
        lift: `lift_without_torque`, shape (N,).
        push: Component of the force along its axis, N.
        torque: N m, body axes, shape (3,).
    """
    axis = observed.force @ lift
    turning = nearest_solution(observed.torque, torque, xp.zeros(len(lift)))
    side = axis @ (observed.force @ turning)
    return turning + (push * norm(axis) - side) / (axis @ axis) * lift


def allocated_with_tilts(observed: Observed, force: Any, torque: Any) -> tuple[Any, Any]:
    """Thrusts (N), shape (N,), and tilts (rad), shape (M,), for rotors with a tilt each.

    The shortest ``T cos(alpha), T sin(alpha)`` of all rotors; NaN where there are none.

    Args:
        observed: By the law.
        force, torque: N and N m, body axes, shape (3,) each.
    """
    rotors = observed.rotors
    rows, wrench = xp.hstack([rotors.cosine, rotors.sine]), xp.hstack([force, torque])
    along, across = nearest_solution(rows, wrench, xp.zeros(rows.shape[1])).reshape(2, -1)
    # In the order of the tilts, which need not be that of the rotors.
    angles = xp.arctan2(across, along)
    of_tilt = [rotors.tilt_of_rotor.index(tilt) for tilt in range(len(angles))]
    return xp.hypot(along, across), xp.array([angles[rotor] for rotor in of_tilt])
