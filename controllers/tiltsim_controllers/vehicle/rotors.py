"""Force F(alpha) and torque tau(alpha) of each rotor of any vehicle on the body.

A pod turns about a fixed axis, so every vector fixed in it is a constant, a cosine and a sine of
the tilt angle. So is the torque about a fixed point: with the rotor at ``h + Q p``, thrust axis
``Q a`` and ``h`` on the hinge, ``(h + Q p) x Q a = h x Q a + Q (p x a)`` is linear in ``Q``. A
rotor's wrench per unit of ``w = varpi |varpi|`` is therefore exactly ``A + B cos(alpha) + C
sin(alpha)``, wherever its hinge is.

The numbers of all rotors are one flat table, `ROTOR_FLOATS` each (`rotor_entries`): the number of
its tilt, from 0 (-1: fixed), its spin (the sign of the speed with which it pushes along its axis),
then A, B and C, force x, y, z and torque x, y, z each. It is part of a flight's knots, from an
index ``at`` on. Rotors on one pod have the same tilt.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.code.arrays import take_span, xp
from tiltsim_controllers.mathematics.moving import Moving, cosine, sine
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values
from tiltsim_controllers.vehicle.body import Body
from tiltsim_controllers.vehicle.cross import cross_table

ROTOR_FLOATS: Final = 20
"""Floats of one rotor."""

TILT, SPIN_SIGN, CONSTANT, COSINE, SINE = 0, 1, 2, 8, 14
"""Where in them its tilt, its spin, A, B and C begin."""

TiltOfRotor = tuple[int, ...]
"""The number of every rotor's tilt, from 0; -1: fixed. Programs are made for a layout."""


class Rotor(NamedTuple):
    """A rotor at zero tilt, in body axes; the arguments of `rotor_entries`."""

    place: Triple  # m, from the center of mass
    axis: Triple  # of its thrust, a unit vector
    thrust: float  # K_f, N s^2/rad^2
    drag: float  # K_m, N m s^2/rad^2
    spin: float
    tilt: int = -1
    hinge: Triple = (0.0, 0.0, 0.0)
    hinge_axis: Triple = (0.0, 0.0, 0.0)

    @property
    def entries(self) -> Values:
        """Its part of the table."""
        return rotor_entries(
            *self[:5], tilt=self.tilt, hinge=self.hinge, hinge_axis=self.hinge_axis
        )

    @property
    def along_hinge(self) -> float:
        """The component of its thrust axis along its hinge, equal at all tilts; 0 if fixed."""
        return float(np.dot(self.axis, self.hinge_axis))

    @property
    def hinge_load(self) -> float:
        """Torque about its hinge (N m s^2/rad^2) of thrust and drag per unit of ``spin w``.

        It is equal at all tilts; 0 where the thrust passes through the hinge at a right angle.
        """
        lever = np.cross(np.subtract(self.place, self.hinge), self.axis)
        pushed = float(np.dot(lever, self.hinge_axis))
        return self.thrust * pushed - self.spin * self.drag * self.along_hinge


def turning_parts(vector: ArrayLike, along: ArrayLike, tilt: int) -> Floats:
    """Constant, cosine and sine of a vector at zero tilt that turns about a unit vector, (3, 3).

    The number of the pod's tilt is -1 for a fixed vector.
    """
    here, axis = np.asarray(vector, float), np.asarray(along, float)
    constant = axis * (axis @ here) if tilt >= 0 else here
    return np.array([constant, here - constant, np.cross(axis, here)])


def rotor_entries(
    place: ArrayLike,
    axis: ArrayLike,
    thrust: float,
    drag: float,
    spin: float,
    *,
    tilt: int = -1,
    hinge: ArrayLike = (0.0, 0.0, 0.0),
    hinge_axis: ArrayLike = (0.0, 0.0, 0.0),
) -> Values:
    """A rotor's part of the table.

    Args:
        place: of the rotor at zero tilt, from the center of mass, m, body axes
        axis: unit vector of its thrust at zero tilt
        thrust: coefficient, N s^2/rad^2
        drag: coefficient of the torque against its rotation, N m s^2/rad^2
        spin: 1 or -1, the sign of the speed with which it pushes along its axis
        tilt: number of its tilt, from 0; -1 for a fixed rotor
        hinge, hinge_axis: a point of its hinge as ``place``, and its unit vector
    """
    n, arm = np.asarray(axis, float), np.asarray(hinge, float)
    push = spin * thrust * n
    # About the point of the hinge; turns with the pod as the force does.
    about_hinge = np.cross(np.asarray(place, float) - arm, push) - drag * n
    force = turning_parts(push, hinge_axis, tilt)
    torque = turning_parts(about_hinge, hinge_axis, tilt) + np.cross(arm, force)
    return (float(tilt), float(spin), *np.hstack([force, torque]).ravel().tolist())


def table_per_newton(table: Sequence[float], coefficients: Sequence[float]) -> Values:
    """A table of forces and torques for a thrust of 1 N, given K_f of each rotor."""
    rows = np.reshape(np.array(table, float), (-1, ROTOR_FLOATS))
    rows[:, CONSTANT:] /= (rows[:, SPIN_SIGN] * coefficients)[:, np.newaxis]
    return tuple(rows.ravel().tolist())


def without_rotor(table: Sequence[float], rotor: int) -> Values:
    """A table of which one rotor, from 1, makes neither force nor torque."""
    first, end = (rotor - 1) * ROTOR_FLOATS + CONSTANT, rotor * ROTOR_FLOATS
    return (*table[:first], *(0.0,) * (end - first), *table[end:])


def tilt_of_rotor(table: Sequence[float]) -> TiltOfRotor:
    """The layout in a table."""
    return tuple(int(tilt) for tilt in table[TILT::ROTOR_FLOATS])


def tilts_of(layout: TiltOfRotor) -> int:
    """The number of tilts of a layout."""
    return max(layout) + 1


def force_and_torque(table: Sequence[float], tilts: ArrayLike = ()) -> tuple[Floats, Floats]:
    """F and tau of a table at tilts (rad, (..., M)), (..., 3, N) each, per unit of ``w``."""
    rows = np.reshape(np.array(table, float), (-1, ROTOR_FLOATS)).T
    angles = np.asarray(tilts, float)
    layout, fixed = list(tilt_of_rotor(table)), np.zeros((*angles.shape[:-1], 1))
    cosines, sines = (
        np.concatenate([of(angles), fixed], axis=-1)[..., np.newaxis, layout]  # -1 is the last, 0
        for of in (np.cos, np.sin)
    )
    wrench = rows[CONSTANT:COSINE] + rows[COSINE:SINE] * cosines + rows[SINE:] * sines
    return wrench[..., :3, :], wrench[..., 3:, :]


class Rotors(NamedTuple):
    """The rotors of a vehicle, N of them on M tilting pods or fixed."""

    tilt_of_rotor: TiltOfRotor  # the number of each rotor's tilt, from 0; -1 for a fixed rotor
    spins: Any  # signs of the speeds with which they push along their axes, shape (N,)
    constant: Any  # force (N) and torque (N m), body axes, per unit of ``w`` ((rad/s)^2), (6, N)
    cosine: Any  # likewise, times the cosine of the tilt, shape (6, N)
    sine: Any  # likewise, times its sine, shape (6, N)

    def masked(self, works: Any) -> Rotors:
        """Rotors with their force and torque multiplied by 1 or 0, shape (N,)."""
        parts = (works * part for part in (self.constant, self.cosine, self.sine))
        return Rotors(self.tilt_of_rotor, self.spins, *parts)


def rotors_in(knots: Any, at: float, tilt_of_rotor: TiltOfRotor) -> Rotors:
    """The rotors of a layout in a flight's knots, in which their table begins at an index."""
    count = len(tilt_of_rotor)
    table = take_span(knots, at, ROTOR_FLOATS * count).reshape(count, -1)
    moves = np.array([float(tilt >= 0) for tilt in tilt_of_rotor])  # a trace knows these zeros
    still, along, across = (table[:, part : part + 6].T for part in (CONSTANT, COSINE, SINE))
    return Rotors(tilt_of_rotor, table[:, SPIN_SIGN], still, moves * along, moves * across)


def airframe(parameters: Any, knots: Any, tilt_of_rotor: TiltOfRotor) -> tuple[Body, Rotors]:
    """The body and the rotors that a law knows of its vehicle, given the knots of the flight.

    Parameters have a ``vehicle``: a `Body`, and ``rotors``, where the table begins in the knots; or
    a `Vehicle`, whose four rotors lie on a cross. Its table is made of its parameters, so that a
    trace knows which entries are zero. Its forces, torques and masses are in units of the thrust
    coefficient, as in ch. 3 and 4: products of small coefficients would underflow in single
    precision.
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
    return scaled.body, rotors_in(table, 0, tilt_of_rotor)


def of_rotors(rotors: Rotors, values: Any) -> Any:
    """The values of the tilts, shape (M,), by rotor, shape (N,): 0 for a fixed rotor."""
    return xp.hstack([values, 0.0])[np.array(rotors.tilt_of_rotor)]  # -1 is the last entry, 0


def of_tilts(rotors: Rotors, values: Any) -> Any:
    """Sums of the values of the rotors, shape (N,), on each pod, shape (M,)."""
    return xp.array([sum(values[i] for i in pod) for pod in _pods(rotors)])


def _pods(rotors: Rotors) -> list[list[int]]:
    """The rotors on each pod."""
    layout = rotors.tilt_of_rotor
    return [[i for i, own in enumerate(layout) if own == tilt] for tilt in range(tilts_of(layout))]


def turned(rotors: Rotors, parts: Any, tilts: Any) -> Any:
    """Vectors that turn with the pods of the rotors at tilt angles (rad, shape (M,)), shape (K, N).

    The parts are constant, cosine and sine, shape (K, N) each; for a fixed rotor the constant
    counts.
    """
    constant, cosine, sine = parts
    cosines, sines = of_rotors(rotors, xp.cos(tilts)), of_rotors(rotors, xp.sin(tilts))
    return constant + cosine * cosines + sine * sines


def wrench_map(rotors: Rotors, tilts: Any) -> Any:
    """Force and torque per unit of ``w``, body axes, (6, N), at tilt angles (rad, shape (M,))."""
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
    sums = [sum((columns[:, i] for i in pod), xp.zeros(6)) for pod in _pods(rotors)]
    return xp.array(sums).T.reshape(6, -1)


def rotor_accelerations(rates: Any, speeds: Any, slowest: Any = 0.0) -> Any:
    """Accelerations (rad/s^2), shape (N,), that change ``w = varpi |varpi|`` at given rates.

    Speeds are signed, rad/s. A rotor slower than ``slowest`` (rad/s) counts as this fast; without
    it a rotor at rest has NaN.
    """
    size = xp.maximum(abs(speeds), slowest)
    return 0.5 * rates / xp.where(size > 0.0, size, xp.nan)
