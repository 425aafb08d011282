"""Objects and a load beside a rotorcraft: their motion at time zero, and their columns."""

from __future__ import annotations

from math import cos, sin
from typing import Final, NamedTuple

import numpy as np

from tiltsim.models.cables import CABLE_READING
from tiltsim.models.objects import CONTACT_READING, COORDINATES, FORCE
from tiltsim.scenario.interaction import objects_of
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.scalar import Values, Vector

CONTACT_FORCE: Final = ("contact_force_x", "contact_force_y", "contact_force_z")

CONTACT_COLUMNS: Final = dict.fromkeys((*CONTACT_FORCE, "peak_contact_force"), "N") | {
    "contact_time": "s"
}
"""Columns of a vehicle among objects; the force is its on all of them, world axes."""

LOAD_COLUMNS: Final = {**{f"payload_{axis}": "m" for axis in "xyz"}, "cable_tension": "N"}

SWING: Final = ("swing_x", "swing_y")
"""Angles of a cable from straight down toward +x and +y, rad; columns that follow from others."""


class Felt(NamedTuple):
    """Where numbers of objects and load are behind ``act``, for the functions of a controller."""

    contact_force: slice = slice(-14, -11)  # (3,), N, world: of the vehicle on all objects
    push_force: slice = slice(-11, -8)  # (3,), N, world: on the object that it pushes
    swing: slice = slice(-8, -6)  # (2,), rad, see `SWING`
    shift: slice = slice(-6, None)  # of the reference along x and y, m, with its two derivatives


FELT: Final = Felt()
FELT_SIZE: Final = 14


class Others(NamedTuple):
    """Which objects and loads a flight has; flights with equal ones share their programs."""

    names: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    hangs: bool = False  # a load on a cable
    cables: tuple[str, ...] = ()
    pushed: int = -1  # the object that the reference pushes, -1 for none
    vehicles: tuple[str, ...] = ("",)  # that touch them: beginnings of their columns' names

    @property
    def coordinates(self) -> int:
        """Numbers in ``qpos`` behind the vehicle's."""
        return sum(COORDINATES[joint] for joint in self.joints) + 7 * self.hangs

    @property
    def readings(self) -> int:
        """Numbers in the memories of the sensors."""
        return self.contact_readings + CABLE_READING * (self.hangs + len(self.cables))

    @property
    def contact_readings(self) -> int:
        """The first of these: of each vehicle, of each object."""
        return CONTACT_READING * len(self.names) * len(self.vehicles)

    @property
    def columns(self) -> dict[str, str]:
        """The columns of their motion and forces, with their units."""
        touching = self.vehicles if self.names else ()
        columns = {vehicle + k: unit for vehicle in touching for k, unit in CONTACT_COLUMNS.items()}
        for name, joint in zip(self.names, self.joints, strict=True):
            if joint == "hinged":
                columns[f"{name}_angle"] = "rad"
            elif joint == "free":
                columns |= {f"{name}_{axis}": "m" for axis in "xyz"}
                columns |= {f"{name}_{angle}": "rad" for angle in ("roll", "pitch", "yaw")}
        columns |= LOAD_COLUMNS if self.hangs else {}
        return columns | {f"{name}_tension": "N" for name in self.cables}

    def force_places(self, index: int, vehicle: int = 0) -> slice:
        """Where the force of a vehicle on an object is among the sensors' readings."""
        first = CONTACT_READING * (len(self.names) * vehicle + index) + FORCE
        return slice(first, first + 3)


def others_of(scenario: Scenario) -> Others:
    """The objects and the load of a scenario."""
    objects = objects_of(scenario)
    if objects is None:
        return Others()
    names = tuple(body.name for body in objects.bodies)
    reference = scenario.reference
    pushed = names.index(reference.object) if reference.type == "push" else -1
    joints = tuple(body.joint for body in objects.bodies)
    cables = tuple(cable.name for cable in objects.cables)
    vehicles = ("", *(f"{companion.name}_" for companion in scenario.companion))
    return Others(names, joints, objects.hangs, cables, pushed, vehicles)


def motion_at_start(plan: FlightPlan) -> tuple[Vector, Vector]:
    """``qpos`` and ``qvel`` of objects and load at time zero, behind the vehicle's."""
    scenario = plan.scenario
    positions: list[float] = []
    velocities: list[float] = []
    for table in scenario.object:
        if table.joint == "hinged":
            positions, velocities = [*positions, 0.0], [*velocities, 0.0]
        elif table.joint == "free":
            positions += [*table.position, *table.quaternion]
            velocities += [*table.velocity, 0.0, 0.0, 0.0]
    payload, initial = scenario.payload, scenario.initial
    if payload is not None and not payload.rigid:
        turn = rotation_matrix(initial.attitude)
        down = np.array([sin(payload.swing), 0.0, -cos(payload.swing)])
        arm = turn @ np.array(payload.attachment)
        place: Values = tuple((arm + payload.length * down + initial.position).tolist())
        moving = np.cross(turn @ np.array(initial.angular_velocity), arm) + initial.velocity
        positions += [*place, 1.0, 0.0, 0.0, 0.0]
        velocities += [*moving.tolist(), 0.0, 0.0, 0.0]
    return positions, velocities
