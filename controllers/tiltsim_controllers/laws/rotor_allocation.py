"""Force and torque onto rotors, and onto rotors and tilts, for laws that demand a wrench.

With planned tilts the rotors make any torque and a force along one axis of the body (least norm).
With tilts that the law commands, every rotor's thrust ``T`` enters through ``T cos(alpha)`` and ``T
sin(alpha)``, in which force and torque are linear with constant coefficients: static allocation
(Kamel et al. 2018, "The Voliro omniorientational hexacopter", Eqs. 10 to 13). With fewer components
than outputs, as of two tilting rotors, they make any torque and a force along one axis again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.mathematics.linear import (
    nearest_solution,
    norm,
    orthonormal_rows,
    rejection,
)
from tiltsim_controllers.vehicle.rotors import Rotors


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


def in_components(observed: Observed) -> Observed:
    """The vehicle with the components ``T cos(alpha), T sin(alpha)`` as its 2 N thrusts."""
    rotors = observed.rotors
    along = rotors.cosine
    if -1 in rotors.tilt_of_rotor:  # a fixed rotor has the first component alone
        along = along + np.array([float(i < 0) for i in rotors.tilt_of_rotor]) * rotors.constant
    wrench = xp.hstack([along, rotors.sine])
    return observed._replace(force=wrench[:3], torque=wrench[3:])


def of_components(rotors: Rotors, components: Any) -> tuple[Any, Any]:
    """Thrusts (N), shape (N,), and tilts (rad), shape (M,), of components of thrust.

    Args:
        rotors: With at most one on each tilt.
        components: ``T cos(alpha)`` of all rotors, then ``T sin(alpha)``, N, shape (2 N,).
    """
    along, across = components.reshape(2, -1)
    # Returned in the order of the tilts, which may differ from the order of the rotors.
    angles = xp.arctan2(across, along)
    layout = rotors.tilt_of_rotor
    of_tilt = [layout.index(tilt) for tilt in range(max(layout) + 1)]
    return xp.hypot(along, across), xp.array([angles[rotor] for rotor in of_tilt])


def allocated_with_tilts(observed: Observed, force: Any, torque: Any) -> tuple[Any, Any]:
    """Thrusts (N), shape (N,), and tilts (rad), shape (M,), for rotors with a tilt each.

    The shortest ``T cos(alpha), T sin(alpha)`` of all rotors; NaN where there are none.

    Args:
        observed: By the law.
        force, torque: N and N m, body axes, shape (3,) each.
    """
    known, wrench = in_components(observed), xp.hstack([force, torque])
    rows = xp.vstack([known.force, known.torque])
    components = nearest_solution(rows, wrench, xp.zeros(rows.shape[1]))
    return of_components(observed.rotors, components)
