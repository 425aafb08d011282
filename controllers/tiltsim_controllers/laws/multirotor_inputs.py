"""What the rotors do, and the accelerations that change it as desired; see `multirotor`.

Scalar code for a layout of rotors, or for their number.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import nan, sqrt
from typing import Any, Final

from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.force_directions import (
    Factors,
    Force,
    combination_of,
    factors_of,
    share_of,
)
from tiltsim_controllers.laws.least_norm import nearest_of, shares_of
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, vectors_of
from tiltsim_controllers.vehicle.effectiveness import Rows, TiltOfRotor, effectiveness_of, tilts_of

NORMS: Final = ("speed", "thrust")
"""Norms in which the inputs are the least: of rotor accelerations, or of the rates of ``w``."""


@cache
def pushing_of(layout: TiltOfRotor) -> Callable[..., tuple[Rows, Values, Values]]:
    """Scalar code ``(tilts, tilt_rates, w, table, at)``: rows of F and tau, wrench and its rate.

    The rate is that of the pods' motion at constant rotor speeds.
    """
    cosines, sines, effect, _, _ = effectiveness_of(layout)
    dot, tilts = vectors_of(len(layout)).dot, tilts_of(layout)
    cosine_rates = componentwise("cosine_rates", "sines, rates", "-sines# * rates#", tilts)
    sine_rates = componentwise("sine_rates", "cosines, rates", "cosines# * rates#", tilts)

    @scalar
    def summed(rows: Rows, w: Values) -> Values:
        fx, fy, fz, tx, ty, tz = rows
        return (dot(fx, w), dot(fy, w), dot(fz, w), dot(tx, w), dot(ty, w), dot(tz, w))

    @scalar
    def still(
        tilts: Values, tilt_rates: Values, w: Values, table: Vector, at: int
    ) -> tuple[Rows, Values, Values]:
        rows = effect(1.0, (), (), table, at)
        return rows, summed(rows, w), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    @scalar
    def moving(
        tilts: Values, tilt_rates: Values, w: Values, table: Vector, at: int
    ) -> tuple[Rows, Values, Values]:
        c, s = cosines(tilts), sines(tilts)
        rows = effect(1.0, c, s, table, at)
        turning = cosine_rates(s, tilt_rates), sine_rates(c, tilt_rates)
        rates = effect(0.0, turning[0], turning[1], table, at)
        return rows, summed(rows, w), summed(rates, w)

    return moving if tilts else still


@scalar
def rotor_acceleration(rate: float, speed: float, slowest: float) -> float:
    """The acceleration (rad/s^2) that changes ``w = varpi |varpi|`` at a rate (rad^2/s^3).

    A rotor slower than ``slowest`` (rad/s) is taken to be so fast; NaN for one at rest.
    """
    size = max(abs(speed), slowest)
    return 0.5 * rate / size if size > 0.0 else nan


@scalar
def restoring_factor(total: float, length: int, parameters: Any) -> float:
    """Factor of ``w`` that starts rotor accelerations (rad/s^2) towards the least power.

    The power is proportional to the sum of ``|varpi|^3``; ``total`` is the sum of ``|varpi|``.
    """
    if parameters.restoring == 0.0 or total == 0.0:
        return 0.0
    factor: float = -parameters.restoring * length / total
    return factor


@cache
def scaled_rows_of(length: int, norm: str) -> Callable[..., tuple[Rows, Force]]:
    """Scalar code of the rows for the unknowns of a norm: ``(rows, speeds, decoupling)``.

    A rotor acceleration changes ``w`` by ``2 |varpi|``. Ch. 3 prints that factor in rows of the
    force only. The second result are those of the force with the factor of the torque.
    """
    _, scaled, _, product, sizes = vectors_of(length)
    ones = (1.0,) * length

    @scalar
    def per_acceleration(rows: Rows, speeds: Values, decoupling: float) -> tuple[Rows, Force]:
        fx, fy, fz, tx, ty, tz = rows
        gain = scaled(2.0, sizes(speeds))
        turns = ones if decoupling == PUBLISHED_DECOUPLING else gain
        scaled_rows = (
            *(product(gain, fx), product(gain, fy), product(gain, fz)),
            *(product(turns, tx), product(turns, ty), product(turns, tz)),
        )
        return scaled_rows, (product(turns, fx), product(turns, fy), product(turns, fz))

    @scalar
    def per_rate(rows: Rows, speeds: Values, decoupling: float) -> tuple[Rows, Force]:
        return rows, (rows[0], rows[1], rows[2])

    return per_acceleration if norm == "speed" else per_rate


@cache
def solution_of(length: int, dimension: int, norm: str) -> Callable[..., Values]:
    """Scalar code of the rotor accelerations (rad/s^2).

    ``(rows, factors, torque_rate, force_rate, w, speeds, parameters)``: ``rows`` for the unknowns
    of the norm and their ``factors``; the rates of torque and force (body axes) are those that
    remain for the rotors.
    """
    vectors, nearest = vectors_of(length), nearest_of(length, 3 + dimension)
    scaled, sizes, dot = vectors.scaled, vectors.sizes, vectors.dot
    along = componentwise(
        "components",
        "axes, vector",
        "axes#[0] * vector[0] + axes#[1] * vector[1] + axes#[2] * vector[2]",
        dimension,
    )
    reached: Callable[..., Values] = componentwise(
        "rotor_accelerations",
        "rates, speeds, slowest",
        "acceleration(rates#, speeds#, slowest)",
        length,
        acceleration=rotor_acceleration,
    )
    ones = (1.0,) * length

    @scalar
    def solution(
        rows: Rows, factors: Factors, torque_rate: Triple, force_rate: Triple, start: Values
    ) -> Values:
        axes, force_rows, units, _ = factors
        desired = (*torque_rate, *along(axes, force_rate))
        return nearest(start, (rows[3], rows[4], rows[5], *force_rows), units, desired)

    @scalar
    def of_speed(
        rows: Rows,
        factors: Factors,
        torque_rate: Triple,
        force_rate: Triple,
        w: Values,
        speeds: Values,
        parameters: Any,
    ) -> Values:
        factor = restoring_factor(dot(sizes(speeds), ones), length, parameters)
        return solution(rows, factors, torque_rate, force_rate, scaled(factor, w))

    @scalar
    def of_thrust(
        rows: Rows,
        factors: Factors,
        torque_rate: Triple,
        force_rate: Triple,
        w: Values,
        speeds: Values,
        parameters: Any,
    ) -> Values:
        start = scaled(-parameters.restoring, w)
        rates = solution(rows, factors, torque_rate, force_rate, start)
        return reached(rates, speeds, parameters.slowest)

    return of_speed if norm == "speed" else of_thrust


@cache
def independence_of(length: int, dimension: int, forward: bool = False) -> Callable[..., float]:
    """Scalar code of how independent the outputs are: ``(rows, up, side)``.

    1 at best and 0 where the decoupling matrix is singular: the share of the force's rows that
    remains without those of the torque, and without each other. ``rows`` are those of F and tau;
    ``up`` is world up, ``side`` a direction of the force, in body axes; where one component is
    controlled and lift pushes against ``side``, the number is negative.
    """
    factors_of_rows, share_of_row = factors_of(length, dimension, forward), share_of(length)
    dot, combination = vectors_of(length).dot, combination_of(length)

    @scalar
    def independence(rows: Rows, up: Triple, side: Triple) -> float:
        forces = rows[0], rows[1], rows[2]
        _, lifts, units, _ = factors_of_rows(rows, forces, up)
        share = 1.0
        for k in range(dimension):
            share *= share_of_row(lifts[k], units[3 + k])
        if not share > 0.0:
            return 0.0
        against = dimension == 1 and dot(units[3], combination(side, *forces)) < 0.0
        return -share if against else share

    return independence


@cache
def null_part_of(length: int, dimension: int, forward: bool = False) -> Callable[..., float]:
    """Scalar code of the share of ``w`` that the outputs do not see, whatever the norm.

    ``(rows, up, w)``: ``rows`` of F and tau per unit of ``w``, ``up`` is world up in body axes. In
    the norm of rotor accelerations a rotor that comes to rest would take the share with it.
    """
    equations = 3 + dimension
    factors_of_rows, dot = factors_of(length, dimension, forward), vectors_of(length).dot
    shares, squared = shares_of(length, equations), vectors_of(equations).dot

    @scalar
    def none(rows: Rows, up: Triple, w: Values) -> float:
        return 0.0

    @scalar
    def null_part(rows: Rows, up: Triple, w: Values) -> float:
        _, _, units, _ = factors_of_rows(rows, (rows[0], rows[1], rows[2]), up)
        seen, whole = shares(units, w), dot(w, w)
        return sqrt(max(0.0, 1.0 - squared(seen, seen) / whole)) if whole > 0.0 else 0.0

    return null_part if length > equations else none
