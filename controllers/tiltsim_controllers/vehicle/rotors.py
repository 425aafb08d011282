"""Any rotors as arrays: the map from ``w = varpi |varpi|`` to force and torque, and its rates.

A pod turns about a fixed axis, so the wrench of a rotor per unit of ``w`` is ``constant + cosine
cos(alpha) + sine sin(alpha)`` exactly; see `tiltsim_controllers.vehicle.effectiveness`, which makes
the numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.blocks import take_span
from tiltsim_controllers.mathematics.moving import Moving, cosine, sine
from tiltsim_controllers.vehicle.body import Body, principal_body
from tiltsim_controllers.vehicle.effectiveness import (
    CONSTANT,
    COSINE,
    ROTOR_FLOATS,
    SINE,
    SPIN_SIGN,
    TiltOfRotor,
    cross_table,
    tilts_of,
)


class Rotors(NamedTuple):
    """The rotors of a vehicle, N of them on M tilting pods or fixed.

    Attributes:
        tilt_of_rotor: The number of each rotor's tilt, from 0; -1 for a fixed rotor.
        spins: Signs of the speeds with which they push along their axes, shape (N,).
        constant, cosine, sine: Force (N) and torque (N m) in body axes per unit of ``w``
            ((rad/s)^2), shape (6, N) each.
    """

    tilt_of_rotor: TiltOfRotor
    spins: Any
    constant: Any
    cosine: Any
    sine: Any

    def masked(self, works: Any) -> Rotors:
        """Rotors with their force and torque multiplied by 1 or 0, shape (N,)."""
        parts = (works * part for part in (self.constant, self.cosine, self.sine))
        return Rotors(self.tilt_of_rotor, self.spins, *parts)


def rotors_in(knots: Any, at: float, tilt_of_rotor: TiltOfRotor) -> Rotors:
    """The rotors of a flight's knots.

    Args:
        knots: Table data of a flight, which the table of the rotors is part of.
        at: Where it begins.
        tilt_of_rotor: The layout.
    """
    count = len(tilt_of_rotor)
    table = take_span(knots, at, ROTOR_FLOATS * count).reshape(count, -1)
    moves = np.array([float(tilt >= 0) for tilt in tilt_of_rotor])  # a trace knows these zeros
    still, along, across = (table[:, part : part + 6].T for part in (CONSTANT, COSINE, SINE))
    return Rotors(tilt_of_rotor, table[:, SPIN_SIGN], still, moves * along, moves * across)


def airframe(parameters: Any, knots: Any, tilt_of_rotor: TiltOfRotor) -> tuple[Body, Rotors]:
    """The body and the rotors that a law knows of its vehicle.

    The table of a `Vehicle`, whose four rotors lie on a cross, is made of its parameters, so that
    a trace knows which entries are zero. Its forces, torques and masses are in units of the thrust
    coefficient, as in ch. 3 and 4: products of small coefficients would underflow in single
    precision.

    Args:
        parameters: Their ``vehicle`` is a `Vehicle`, or a `Body` and ``rotors`` is the index of the
            table in the knots.
        knots: Table data of the flight.
        tilt_of_rotor: The layout.
    """
    vehicle = parameters.vehicle
    if isinstance(vehicle, Body):
        return vehicle, rotors_in(knots, parameters.rotors, tilt_of_rotor)
    unit = 1.0 / vehicle.thrust_coefficient
    scaled = vehicle._replace(
        mass=unit * vehicle.mass,
        inertia_xx=unit * vehicle.inertia_xx,
        inertia_yy=unit * vehicle.inertia_yy,
        inertia_zz=unit * vehicle.inertia_zz,
        thrust_coefficient=1.0,
        drag_coefficient=unit * vehicle.drag_coefficient,
    )
    table = cross_table(scaled, tilting=tilts_of(tilt_of_rotor) > 0)
    return principal_body(scaled), rotors_in(table, 0, tilt_of_rotor)


def of_rotors(rotors: Rotors, values: Any) -> Any:
    """The values of the tilts by rotor, shape (N,): 0 for a fixed rotor.

    Args:
        rotors: The layout is used.
        values: Values by tilt, shape (M,).
    """
    return xp.hstack([values, 0.0])[np.array(rotors.tilt_of_rotor)]  # -1 is the last entry, 0


def of_tilts(rotors: Rotors, values: Any) -> Any:
    """Sums of the values of the rotors on each pod, shape (M,).

    Args:
        rotors: The layout is used.
        values: Values of the rotors, shape (N,).
    """
    layout = rotors.tilt_of_rotor
    pods = [[i for i, own in enumerate(layout) if own == tilt] for tilt in range(max(layout) + 1)]
    return xp.array([sum(values[i] for i in pod) for pod in pods])


def turned(rotors: Rotors, parts: Any, tilts: Any) -> Any:
    """Vectors that turn with the pods of the rotors, shape (K, N).

    Args:
        rotors: The layout is used.
        parts: Constant, cosine and sine of the vectors, shape (K, N) each; for a fixed rotor the
            constant counts.
        tilts: Tilt angles, rad, shape (M,).
    """
    constant, cosine, sine = parts
    cosines, sines = of_rotors(rotors, xp.cos(tilts)), of_rotors(rotors, xp.sin(tilts))
    return constant + cosine * cosines + sine * sines


def wrench_map(rotors: Rotors, tilts: Any) -> Any:
    """Force and torque per unit of ``w``, body axes, shape (6, N).

    Args:
        rotors: Rotors of the vehicle.
        tilts: Tilt angles, rad, shape (M,).
    """
    return turned(rotors, (rotors.constant, rotors.cosine, rotors.sine), tilts)


def moving_wrench_map(rotors: Rotors, tilts: Moving) -> Any:
    """`wrench_map` of moving tilt angles, shape (M,), with its derivatives."""
    parts = (tilts.value, tilts.rate, tilts.acceleration)
    angles = Moving(*(p if isinstance(p, float) else of_rotors(rotors, p) for p in parts))
    return rotors.constant + rotors.cosine * cosine(angles) + rotors.sine * sine(angles)


def wrench_slope(rotors: Rotors, tilts: Any) -> Any:
    """The derivative of `wrench_map` by the tilt angle of each rotor, 1/rad, shape (6, N)."""
    return turned(rotors, (0.0, rotors.sine, -rotors.cosine), tilts)


def by_tilt(rotors: Rotors, columns: Any) -> Any:
    """Sums of columns of rotors over each tilt, shape (6, N) to (6, M)."""
    layout = rotors.tilt_of_rotor
    groups = [
        [i for i, own in enumerate(layout) if own == tilt] for tilt in range(tilts_of(layout))
    ]
    sums = [sum((columns[:, i] for i in group), xp.zeros(6)) for group in groups]
    return xp.array(sums).T.reshape(6, -1)


def rotor_accelerations(rates: Any, speeds: Any, slowest: Any = 0.0) -> Any:
    """Accelerations (rad/s^2), shape (N,), that change ``w = varpi |varpi|`` at given rates.

    Args:
        rates: Rates of ``w``, (rad/s)^2/s, shape (N,).
        speeds: rad/s, signed, shape (N,).
        slowest: A slower rotor counts as this fast, rad/s; NaN for a rotor at rest without it.
    """
    size = xp.maximum(abs(speeds), slowest)
    return 0.5 * rates / xp.where(size > 0.0, size, xp.nan)
