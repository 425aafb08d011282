"""Force and torque onto rotors, and onto rotors and tilts, for laws that demand a wrench.

With planned tilts the rotors make any torque and a force along one axis of the body (least norm).
With tilts of its own, every rotor's thrust ``T`` enters through ``T cos(alpha)`` and ``T
sin(alpha)``, in which force and torque are linear with constant coefficients: static allocation
(Kamel et al. 2018, "The Voliro omniorientational hexacopter", Eqs. 10 to 13).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import atan2, sqrt
from typing import NamedTuple

from tiltsim_controllers.laws.least_norm import nearest_of, orthogonal_of
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.mathematics.scalar import Triple, Values, scalar
from tiltsim_controllers.mathematics.vectors import (
    componentwise,
    tuple_text,
    vectors_of,
    written_out,
)
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor, effectiveness_of, tilts_of


class PlannedAllocation(NamedTuple):
    """Scalar functions for a number of rotors whose tilts are planned."""

    lift: Callable[..., Values]
    """``(observed)``: the shortest thrusts without torque whose force has 1 N along body z."""
    axis: Callable[..., Triple]
    """``(observed, lift)``: their force, the axis along which the vehicle pushes."""
    thrusts: Callable[..., Values]
    """``(observed, lift, axis, push, torque)``: thrusts (N) with a torque (N m) and a force whose
    component along the axis is ``push`` (N); NaN where the rotors cannot make every torque."""


@cache
def planned_allocation_of(rotors: int) -> PlannedAllocation:
    """The functions for a number of rotors, 4 or more."""
    vectors, orthogonal = vectors_of(rotors), orthogonal_of(rotors)
    dot, scaled, add_scaled = vectors.dot, vectors.scaled, vectors.add_scaled
    orthonormal, remainder = orthogonal.orthonormal, orthogonal.remainder
    nearest = nearest_of(rotors, 3)

    @scalar
    def lift(observed: Observed) -> Values:
        up, torque = observed.force[2], observed.torque
        free = remainder(up, orthonormal(torque[0], torque[1], torque[2]))
        return scaled(1.0 / dot(up, free), free)

    @scalar
    def axis(observed: Observed, lift: Values) -> Triple:
        force = observed.force
        return dot(force[0], lift), dot(force[1], lift), dot(force[2], lift)

    @scalar
    def thrusts(
        observed: Observed, lift: Values, axis: Triple, push: float, torque: Triple
    ) -> Values:
        force, rows = observed.force, observed.torque
        turning = nearest(scaled(0.0, lift), rows, orthonormal(rows[0], rows[1], rows[2]), torque)
        x, y, z = axis
        length = sqrt(x * x + y * y + z * z)
        side = x * dot(force[0], turning) + y * dot(force[1], turning) + z * dot(force[2], turning)
        return add_scaled(turning, (push - side / length) / length, lift)

    return PlannedAllocation(lift, axis, thrusts)


@cache
def tilting_allocation_of(layout: TiltOfRotor) -> Callable[..., tuple[Values, Values]]:
    """Scalar code ``(observed, force, torque) -> thrusts, tilts`` for rotors with a tilt each.

    The shortest ``T cos(alpha), T sin(alpha)`` of all rotors that make force (N) and torque (N m),
    body axes; NaN where some cannot be made.
    """
    rotors, tilts = len(layout), tilts_of(layout)
    functions, length = effectiveness_of(layout), 2 * len(layout)
    rows_of = functions.rows
    ones = componentwise("ones", "tilts", "1.0", tilts)
    zeros = componentwise("zeros", "tilts", "0.0", tilts)
    orthogonal, nearest = orthogonal_of(length), nearest_of(length, 6)
    rejected, unit = orthogonal.rejected, orthogonal.unit
    scaled = vectors_of(length).scaled
    pair = tuple_text(f"(*rows[{k}], *across[{k}])" for k in range(6))
    joined = written_out(f"joined_{rotors}", "rows, across", pair)
    sizes = tuple_text(
        f"sqrt(x[{i}] * x[{i}] + x[{i + rotors}] * x[{i + rotors}])" for i in range(rotors)
    )
    thrust_of = written_out(f"tilted_thrusts_{rotors}", "x", sizes, sqrt=sqrt)
    # In the order of the tilts, which need not be that of the rotors.
    by_tilt = [layout.index(tilt) for tilt in range(tilts)]
    angles = tuple_text(f"atan2(x[{i + rotors}], x[{i}])" for i in by_tilt)
    name = "_".join(map(str, by_tilt))
    tilts_for = written_out(f"tilted_angles_{name}", "x", angles, atan2=atan2)

    @scalar
    def allocated(observed: Observed, force: Triple, torque: Triple) -> tuple[Values, Values]:
        table, at, level = observed.table, observed.at, observed.tilt_angles
        along = rows_of(0.0, ones(level), zeros(level), table, at)
        across = rows_of(0.0, zeros(level), ones(level), table, at)
        rows = joined(along, across)
        a = unit(rows[0], rows[0])
        b = unit(rejected(rows[1], a), rows[1])
        c = unit(rejected(rejected(rows[2], a), b), rows[2])
        rest = rejected(rejected(rejected(rows[3], a), b), c)
        d = unit(rest, rows[3])
        rest = rejected(rejected(rejected(rejected(rows[4], a), b), c), d)
        e = unit(rest, rows[4])
        rest = rejected(rejected(rejected(rejected(rejected(rows[5], a), b), c), d), e)
        f = unit(rest, rows[5])
        x = nearest(scaled(0.0, a), rows, (a, b, c, d, e, f), (*force, *torque))
        return thrust_of(x), tilts_for(x)

    return allocated
