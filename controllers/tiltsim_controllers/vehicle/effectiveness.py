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
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle

ROTOR_FLOATS: Final = 20
"""Floats of one rotor."""

TILT, SPIN_SIGN, CONSTANT, COSINE, SINE = 0, 1, 2, 8, 14
"""Where in them its tilt, its spin, A, B and C begin."""

ARMS: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
"""Directions of the arms of rotors 1 to 4 on a cross; pods of the tiltrotor turn about them."""

TiltOfRotor = tuple[int, ...]
"""The number of every rotor's tilt, from 0; -1: fixed. Programs are made for a layout."""

Rows = tuple[Values, Values, Values, Values, Values, Values]
"""Force x, y, z and torque x, y, z by rotor."""


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
    """Constant, cosine and sine of a vector that turns with a pod, shape (3, 3).

    Args:
        vector: At zero tilt.
        along: Unit vector of the hinge.
        tilt: The number of the pod's tilt; -1 for a fixed vector.
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


def cross_table(vehicle: Vehicle, *, tilting: bool) -> Values:
    """The table of four rotors at the ends of a cross (ch. 3), each tilted about its arm or fixed.

    In closed form, so that parameters of the vehicle may be numbers of any kind.
    """
    drag, table = vehicle.drag_coefficient, []
    for rotor, (x, y, _) in enumerate(ARMS):
        spin = SPIN[rotor]
        push = spin * vehicle.thrust_coefficient
        lever = vehicle.arm_length * push
        upright = (0.0, 0.0, push, lever * y, -lever * x, -drag)
        aside = (push * y, -push * x, 0.0, -drag * y, drag * x, -lever)  # tilted by 90 degrees
        nothing = (0.0,) * 6
        parts = (nothing, upright, aside) if tilting else (upright, nothing, nothing)
        table += [float(rotor) if tilting else -1.0, spin, *parts[0], *parts[1], *parts[2]]
    return tuple(table)


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
    """F and tau at tilt angles (rad), shape (..., 3, N) each, per unit of ``w``, body axes.

    Args:
        table: of the rotors
        tilts: shape (..., tilts)
    """
    rows = np.reshape(np.array(table, float), (-1, ROTOR_FLOATS)).T
    angles = np.asarray(tilts, float)
    layout, fixed = list(tilt_of_rotor(table)), np.zeros((*angles.shape[:-1], 1))
    cosines, sines = (
        np.concatenate([of(angles), fixed], axis=-1)[..., np.newaxis, layout]  # -1 is the last, 0
        for of in (np.cos, np.sin)
    )
    wrench = rows[CONSTANT:COSINE] + rows[COSINE:SINE] * cosines + rows[SINE:] * sines
    return wrench[..., :3, :], wrench[..., 3:, :]
