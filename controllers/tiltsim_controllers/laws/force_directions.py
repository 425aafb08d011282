"""Directions in which any number of rotors push without torque, and how they move with the pods.

Scalar code for a layout and the number of force components that a controller uses; see
`tiltsim_controllers.laws.multirotor`. The ``direction`` of one component is the torque-free force
that goes with lift; that of two the normal of the plane of torque-free forces.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import nan, sqrt
from typing import Any

from tiltsim_controllers.gaits.any_tilts import Jets
from tiltsim_controllers.laws.failures import health_of, masked_of
from tiltsim_controllers.laws.least_norm import nearest_of, orthogonal_of
from tiltsim_controllers.mathematics.jets import (
    Jet,
    Jets3,
    jet_cosine,
    jet_product,
    jet_quotient,
    jet_sine,
    jet_sum,
)
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, vectors_of
from tiltsim_controllers.vehicle.effectiveness import Rows, TiltOfRotor, effectiveness_of, tilts_of
from tiltsim_controllers.vehicle.rigid_body import cross

Force = tuple[Values, Values, Values]
"""Rows of the force, x, y and z."""

Factors = tuple[tuple[Triple, ...], tuple[Values, ...], tuple[Values, ...], Triple]
"""Directions of the force, its rows along them, unit rows (torque, then force), ``direction``."""


@scalar
def unit_vector(x: float, y: float, z: float) -> Triple:
    """A vector divided by its length; NaN for zero."""
    square = x * x + y * y + z * z
    scale = 1.0 / sqrt(square) if square > 0.0 else nan
    return scale * x, scale * y, scale * z


@scalar
def normal_of_rows(a: Triple, b: Triple, c: Triple) -> Triple:
    """The unit vector across three vectors of a plane."""
    x, y, z = cross(a, b)
    best = x * x + y * y + z * z
    for first, second in ((b, c), (c, a)):
        other_x, other_y, other_z = cross(first, second)
        square = other_x * other_x + other_y * other_y + other_z * other_z
        if square > best:
            best, x, y, z = square, other_x, other_y, other_z
    return unit_vector(x, y, z)


@scalar
def jet_cross(a: Jets3, b: Jets3) -> Jets3:
    """The vector product of moving vectors."""
    ax, ay, az = a
    bx, by, bz = b
    return (
        jet_sum(1.0, jet_product(ay, bz), -1.0, jet_product(az, by)),
        jet_sum(1.0, jet_product(az, bx), -1.0, jet_product(ax, bz)),
        jet_sum(1.0, jet_product(ax, by), -1.0, jet_product(ay, bx)),
    )


@scalar
def _jet_dot(a: Jets3, b: Jets3) -> Jet:
    first = jet_sum(1.0, jet_product(a[0], b[0]), 1.0, jet_product(a[1], b[1]))
    return jet_sum(1.0, first, 1.0, jet_product(a[2], b[2]))


@scalar
def nearest_in_plane(desired: Jets3, normal: Jets3) -> Jets3:
    """The part of a moving vector in the plane across a normal of any length."""
    share = jet_quotient(_jet_dot(desired, normal), _jet_dot(normal, normal))
    x, y, z = desired
    along_x, along_y, along_z = normal
    return (
        jet_sum(1.0, x, -1.0, jet_product(share, along_x)),
        jet_sum(1.0, y, -1.0, jet_product(share, along_y)),
        jet_sum(1.0, z, -1.0, jet_product(share, along_z)),
    )


@cache
def _normal_of(length: int) -> Callable[..., Triple]:
    """The normal of the plane that the columns of three rows span: ``(x, y, z)``."""
    dot = vectors_of(length).dot

    @scalar
    def normal(x: Values, y: Values, z: Values) -> Triple:
        xy, xz, yz = dot(x, y), dot(x, z), dot(y, z)
        return normal_of_rows((dot(x, x), xy, xz), (xy, dot(y, y), yz), (xz, yz, dot(z, z)))

    return normal


@cache
def combination_of(length: int) -> Callable[..., Values]:
    """Scalar code of a linear combination of three rows: ``(factors, x, y, z)``."""
    return componentwise("combination", "f, x, y, z", "f[0] * x# + f[1] * y# + f[2] * z#", length)


@cache
def share_of(length: int) -> Callable[..., float]:
    """Scalar code of the share of a row that lies along a unit row: ``(row, unit)``; 0 of none."""
    dot = vectors_of(length).dot

    @scalar
    def share(row: Values, unit: Values) -> float:
        square = dot(row, row)
        return dot(row, unit) / sqrt(square) if square > 0.0 else 0.0

    return share


@cache
def factors_of(length: int, dimension: int, forward: bool = False) -> Callable[..., Factors]:
    """Orthogonal factors of the decoupling matrix: scalar code ``(rows, pushes, up) -> Factors``.

    ``rows`` are those of force and torque, ``pushes`` those of the force in the unknowns of the
    torque's, which differ in the published matrix; ``up`` is world up in body axes. NaN where the
    rank is too low. The plane of two components is that of the torque-free forces; ``forward``
    takes the body's x-z plane, for rotors that push in all directions without torque.
    """
    rejected, unit, orthonormal, remainder = orthogonal_of(length)
    combination, normal_of, dot = combination_of(length), _normal_of(length), vectors_of(length).dot

    @scalar
    def along_up(rows: Rows, pushes: Force, up: Triple) -> Factors:
        fx, fy, fz, tx, ty, tz = rows
        units = orthonormal(tx, ty, tz)
        lift = combination(up, fx, fy, fz)
        last = unit(remainder(lift, units), lift)
        px, py, pz = pushes
        return (up,), (lift,), (*units, last), (dot(px, last), dot(py, last), dot(pz, last))

    @scalar
    def in_plane(rows: Rows, pushes: Force, up: Triple) -> Factors:
        fx, fy, fz, tx, ty, tz = rows
        units = orthonormal(tx, ty, tz)
        gx, gy, gz = remainder(fx, units), remainder(fy, units), remainder(fz, units)
        normal = (0.0, 1.0, 0.0) if forward else normal_of(gx, gy, gz)
        x, y, z = cross(normal, up)
        across = unit_vector(x, y, z)
        lift, side = combination(up, fx, fy, fz), combination(across, fx, fy, fz)
        fourth = unit(combination(up, gx, gy, gz), lift)
        fifth = unit(rejected(combination(across, gx, gy, gz), fourth), side)
        return (up, across), (lift, side), (*units, fourth, fifth), normal

    @scalar
    def whole(rows: Rows, pushes: Force, up: Triple) -> Factors:
        fx, fy, fz, tx, ty, tz = rows
        units = orthonormal(tx, ty, tz)
        fourth = unit(remainder(fx, units), fx)
        fifth = unit(rejected(remainder(fy, units), fourth), fy)
        sixth = unit(rejected(rejected(remainder(fz, units), fourth), fifth), fz)
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        return axes, (fx, fy, fz), (*units, fourth, fifth, sixth), up

    return (along_up, in_plane, whole)[dimension - 1]


@cache
def _torque_free_jet_of(length: int) -> Callable[..., Jets3]:
    """Scalar code of a torque-free force that moves: ``(axis, rows, first, second, units)``.

    ``first`` and ``second`` are derivatives of the rows, ``units`` the unit rows of the torque. The
    inputs are those of the axis at first; what they then lack to stay without torque is added.
    """
    dot, remainder = vectors_of(length).dot, orthogonal_of(length).remainder
    combination, nearest = combination_of(length), nearest_of(length, 3)
    nothing = (0.0,) * length

    @scalar
    def torque_free_jet(
        axis: Triple, rows: Rows, first: Rows, second: Rows, units: tuple[Values, Values, Values]
    ) -> Jets3:
        fx, fy, fz, tx, ty, tz = rows
        fx1, fy1, fz1, tx1, ty1, tz1 = first
        fx2, fy2, fz2, tx2, ty2, tz2 = second
        w = remainder(combination(axis, fx, fy, fz), units)
        lacking = (-dot(tx1, w), -dot(ty1, w), -dot(tz1, w))
        w1 = nearest(nothing, (tx, ty, tz), units, lacking)
        lacking = (
            -dot(tx2, w) - 2.0 * dot(tx1, w1),
            -dot(ty2, w) - 2.0 * dot(ty1, w1),
            -dot(tz2, w) - 2.0 * dot(tz1, w1),
        )
        w2 = nearest(nothing, (tx, ty, tz), units, lacking)
        return (
            (dot(fx, w), dot(fx1, w) + dot(fx, w1), dot(fx2, w) + 2.0 * dot(fx1, w1) + dot(fx, w2)),
            (dot(fy, w), dot(fy1, w) + dot(fy, w1), dot(fy2, w) + 2.0 * dot(fy1, w1) + dot(fy, w2)),
            (dot(fz, w), dot(fz1, w) + dot(fz, w1), dot(fz2, w) + 2.0 * dot(fz1, w1) + dot(fz, w2)),
        )

    return torque_free_jet


@cache
def direction_jet_of(layout: TiltOfRotor, dimension: int, losses: bool) -> Callable[..., Jets3]:
    """The ``direction`` of one or two components over a planned gait, with derivatives.

    A scalar function ``(time, up, tilts, knots, at, failure)`` of the gait's tilts with
    derivatives, as `tiltsim_controllers.gaits.any_tilts.TiltMotion.anticipated` returns them;
    ``at`` is where in the knots the table of the rotors begins. ``losses``: whether the failure
    counts.
    """
    length, tilts = len(layout), tilts_of(layout)
    effect = effectiveness_of(layout).rows
    orthonormal, remainder = orthogonal_of(length)[2:]
    normal_of, moving = _normal_of(length), _torque_free_jet_of(length)
    cosines = componentwise("jet_cosines", "tilts", "cosine(tilts#)", tilts, cosine=jet_cosine)
    sines = componentwise("jet_sines", "tilts", "sine(tilts#)", tilts, sine=jet_sine)
    value, rate, acceleration = (
        componentwise(f"derivative_{order}", "jets", f"jets#[{order}]", tilts) for order in range(3)
    )

    health, masked = health_of(length), masked_of(length)

    @scalar
    def rows_with_derivatives(
        time: float, tilts: Jets, knots: Vector, at: int, failure: Any
    ) -> tuple[Rows, Rows, Rows]:
        c, s = cosines(tilts), sines(tilts)
        rows = effect(1.0, value(c), value(s), knots, at)
        first = effect(0.0, rate(c), rate(s), knots, at)
        second = effect(0.0, acceleration(c), acceleration(s), knots, at)
        if losses:
            works = health(time, failure)
            rows, first, second = masked(works, rows), masked(works, first), masked(works, second)
        return rows, first, second

    @scalar
    def force(time: float, up: Triple, tilts: Jets, knots: Vector, at: int, failure: Any) -> Jets3:
        rows, first, second = rows_with_derivatives(time, tilts, knots, at, failure)
        units = orthonormal(rows[3], rows[4], rows[5])
        return moving(up, rows, first, second, units)

    @scalar
    def normal(time: float, up: Triple, tilts: Jets, knots: Vector, at: int, failure: Any) -> Jets3:
        rows, first, second = rows_with_derivatives(time, tilts, knots, at, failure)
        units = orthonormal(rows[3], rows[4], rows[5])
        across = normal_of(
            remainder(rows[0], units), remainder(rows[1], units), remainder(rows[2], units)
        )
        x, y, z = cross(across, up)
        one = unit_vector(x, y, z)
        return jet_cross(
            moving(cross(one, across), rows, first, second, units),
            moving(one, rows, first, second, units),
        )

    return force if dimension == 1 else normal
