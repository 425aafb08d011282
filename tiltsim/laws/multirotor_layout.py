"""What the loops with multirotors of any layout are made for, and the state that a law knows.

Native code wants to know how many rotors there are, which tilt together and which way they turn, so
a loop is made for each such `Layout`, once. All other numbers of the vehicle are data: the table of
its rotors follows the knots of gait and reference.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

from tiltsim.laws.rotorcraft import body_state
from tiltsim.models.rotor_table import Multirotor
from tiltsim.vehicles.rotorcraft.layout import TILT_1
from tiltsim.vehicles.rotorcraft.layout import Layout as Places
from tiltsim_controllers.laws.gait_feedforward import INTEGRAL_FIELDS
from tiltsim_controllers.laws.multirotor_steps import Parameters
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import entries_of
from tiltsim_controllers.vehicle.effectiveness import layout_of

STATES: Final = len(INTEGRAL_FIELDS)
"""The controller's own, after the rotor speeds."""


class Layout(NamedTuple):
    """What a multirotor's compiled code is made for."""

    tilt_of_rotor: tuple[int, ...]  # from 0; -1 for a fixed rotor
    spins: Values

    @property
    def places(self) -> Places:
        """Where its numbers lie."""
        return Places(len(self.spins), max(self.tilt_of_rotor) + 1)

    @property
    def name(self) -> str:
        """For files and models."""
        tilts = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in self.tilt_of_rotor)
        return f"{tilts}_{''.join('p' if spin > 0.0 else 'm' for spin in self.spins)}"


class Direction(NamedTuple):
    """A vector in body axes."""

    x: float
    y: float
    z: float


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters
    upper_side: Direction  # see `tiltsim.scenario.multirotor_controllers.upper_side`
    upper_side_without: Direction  # the same once the failed rotor is known


def layout_of_vehicle(vehicle: Multirotor) -> Layout:
    """The layout of a vehicle."""
    return Layout(layout_of(vehicle.table), vehicle.spins)


@cache
def law_state_of(layout: Layout) -> Callable[..., Values]:
    """Scalar code of the state that the law knows: ``(qpos, qvel, act)``."""
    tilts_in = entries_of(TILT_1, layout.places.tilts)
    speeds_in = entries_of(0, layout.places.rotors)

    @scalar
    def state(qpos: Vector, qvel: Vector, act: Vector) -> Values:
        return (*body_state(qpos, qvel), *tilts_in(qpos), *speeds_in(act))

    return state
