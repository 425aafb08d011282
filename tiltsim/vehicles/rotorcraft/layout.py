"""Places of a rotorcraft's numbers in a sample and in MuJoCo's vectors, and its true rotors."""

from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, Sizes
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.body import (
    BODY_FIELDS,
    ROTATION_NAMES,
    Body,
    body_of,
    principal_body,
)
from tiltsim_controllers.vehicle.craft import craft_parameters, craft_record
from tiltsim_controllers.vehicle.parameters import Vehicle

# Places in ``qpos`` and ``qvel``: the quaternion, and the first tilt and tilt rate.
QW, QX, QY, QZ, TILT_1 = range(3, 8)
TILT_RATE_1: Final = 6


class Layout(NamedTuple):
    """The layout of a rotorcraft's numbers, by its numbers of rotors and tilt hinges."""

    rotors: int
    tilts: int

    def sizes(self, controller_states: int = 0) -> Sizes:
        """Lengths of MuJoCo's vectors, the controller's states included."""
        act, ctrl = self.rotors + controller_states, self.further_rates + controller_states
        return Sizes(TILT_1 + self.tilts, TILT_RATE_1 + self.tilts, act, ctrl)

    @property
    def thrusts(self) -> slice:
        """In ``ctrl``: the thrusts follow the tilt servos."""
        return slice(self.tilts, self.acceleration_1)

    @property
    def accelerations(self) -> slice:
        """In ``ctrl``: the rotor accelerations follow the thrusts."""
        return slice(self.acceleration_1, self.further_rates)

    @property
    def acceleration_1(self) -> int:
        """In ``ctrl``: the rotor accelerations follow the thrusts."""
        return self.tilts + self.rotors

    @property
    def further_rates(self) -> int:
        """In ``ctrl``: the rates of further states follow the rotor accelerations."""
        return self.tilts + 2 * self.rotors

    @property
    def speed_1(self) -> int:
        """In the values of a sample: the rotor speeds follow the rigid body and the tilts."""
        return len(BODY_FIELDS) + self.tilts

    def names(self, kind: str) -> tuple[str, ...]:
        """Names of fields or columns: one a tilt where the kind begins with alpha, else a rotor."""
        count = self.tilts if kind.startswith(("alpha", "tilt")) else self.rotors
        return tuple(f"{kind}_{i}" for i in range(1, count + 1))

    @property
    def motion(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the coordinates of ``qpos`` and ``qvel``, see `ClosedLoop`."""
        places = (*BODY_FIELDS[:3], *ROTATION_NAMES, *self.names("alpha"))
        return places, (*BODY_FIELDS[3:6], *BODY_FIELDS[9:], *self.names("alpha_rate"))

    @property
    def observed_fields(self) -> tuple[str, ...]:
        """A sample after its time: rigid body, tilts, rotor speeds, tilt rates."""
        kinds = ("alpha", "rotor_speed", "alpha_rate")
        return (*BODY_FIELDS, *(name for kind in kinds for name in self.names(kind)))


def layout_of(loop: ClosedLoop) -> Layout:
    """The layout of a model's vectors; the quadrotor's have no tilts."""
    return Layout(len(loop.spins), loop.sizes.qpos - TILT_1)


def is_fixed_cross(loop: ClosedLoop) -> bool:
    """Whether its rotors are on a cross without hinges and make any thrust at once, as in ch. 2."""
    return not loop.tilt_of_rotor and not layout_of(loop).tilts


def tilt_of_rotor(loop: ClosedLoop) -> tuple[int, ...]:
    """The number, from 0, of each rotor's tilt; -1: fixed."""
    rotors, tilts = layout_of(loop)
    on_cross = tuple(range(rotors)) if tilts else (-1,) * rotors
    return loop.tilt_of_rotor or on_cross


CROSS: Final = Layout(4, 4)
"""Tiltrotor and quadrotor, whose samples are alike; see `tiltsim_controllers.vehicle.body`."""


def rotors_record(loop: ClosedLoop) -> Any:
    """The type of the parameters of a model's vehicle; see `true_rotors`."""
    return craft_record(*layout_of(loop)) if loop.tilt_of_rotor else Vehicle


def true_rotors(scenario: Scenario) -> Any:
    """The parameters of the simulated vehicle, not the controller's.

    `tiltsim_controllers.vehicle.craft.craft_of` makes its arrays.
    """
    vehicle = scenario.true_vehicle
    if not isinstance(vehicle, Multirotor):
        return vehicle
    return craft_parameters(vehicle.body, vehicle.rotors)


def body_less(scenario: Scenario, inertias: Values) -> Body:
    """The simulated vehicle's body without inertias (kg m^2) about its hinges."""
    vehicle = scenario.true_vehicle
    if isinstance(vehicle, Multirotor):
        inertia = np.reshape(vehicle.inertia, (3, 3)).copy()
        for tilt, own in enumerate(inertias):
            axis = next(rotor.hinge_axis for rotor in vehicle.rotors if rotor.tilt == tilt)
            inertia -= own * np.outer(axis, axis)
        return body_of(vehicle.mass, inertia, vehicle.gravity)
    # two hinges lie along each axis; a quadrotor has none
    about_x, about_y = (2.0 * own for own in inertias[:2] or (0.0, 0.0))
    return principal_body(
        vehicle._replace(
            inertia_xx=vehicle.inertia_xx - about_x, inertia_yy=vehicle.inertia_yy - about_y
        )
    )
