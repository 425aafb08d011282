"""The rotors of a compiled vehicle: their effect on the body at any tilt, and speeds of hover."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from tiltsim.errors import InputError
from tiltsim.models.vehicle_parts import Parts, VehiclePose
from tiltsim_controllers.analysis.torque_free import (
    LEVEL,
    controlled_axes,
    hover_direction,
    torque_free_forces,
)
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values
from tiltsim_controllers.vehicle.body import Body, body_of
from tiltsim_controllers.vehicle.rotors import Rotor, force_and_torque

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class Multirotor:
    """Physical parameters of a vehicle with any number of rotors, along the body's axes."""

    mass: float  # kg
    gravity: float  # m/s^2
    inertia: Values  # (9,), rows first, untilted, with all on board, about the center, kg m^2
    rotors: tuple[Rotor, ...]  # places, axes and coefficients
    speed_ranges: tuple[tuple[float, float], ...]  # signed, rad/s; infinite where no file gives any
    tilts: int  # number of tilt hinges

    @cached_property
    def table(self) -> Values:
        """Table of the rotors; see `tiltsim_controllers.vehicle.rotors`."""
        return tuple(entry for rotor in self.rotors for entry in rotor.entries)

    @property
    def body(self) -> Body:
        """Mass, inertia and gravity of the whole vehicle."""
        return body_of(self.mass, np.reshape(self.inertia, (3, 3)), self.gravity)

    @property
    def tilt_of_rotor(self) -> tuple[int, ...]:
        """The number, from 0, of each rotor's tilt; -1: fixed."""
        return tuple(rotor.tilt for rotor in self.rotors)

    @property
    def thrust_coefficients(self) -> Values:
        """K_f of each rotor, N s^2/rad^2."""
        return tuple(rotor.thrust for rotor in self.rotors)

    @property
    def spins(self) -> Values:
        """Signs of the rotor speeds at positive thrust."""
        return tuple(rotor.spin for rotor in self.rotors)

    @property
    def moments(self) -> tuple[float, ...]:
        """Principal moments of inertia, kg m^2."""
        return tuple(np.linalg.eigvalsh(np.reshape(self.inertia, (3, 3))).tolist())

    @property
    def max_rotor_inertia(self) -> float:
        """The largest spin inertia (kg m^2) of each rotor that the untilted vehicle can have."""
        axes = np.array([rotor.axis for rotor in self.rotors])
        share = np.linalg.solve(np.reshape(self.inertia, (3, 3)), axes.T @ axes)
        return float(1.0 / np.linalg.eigvals(share).real.max())

    @property
    def hover_rotor_speed(self) -> float:
        """The speed (rad/s) at which all thrusts, were they upward, carry the weight."""
        return float((self.mass * self.gravity / sum(self.thrust_coefficients)) ** 0.5)


def read_rotors(pose: VehiclePose, parts: Parts, center: Floats) -> tuple[Rotor, ...]:
    """The rotors, with places from the point ``center`` (m, body axes).

    Raises:
        ValueError: If more than one hinge is between a rotor and the body, or a hinge has no rotor.
    """
    rotors = tuple(_rotor(pose, i, center) for i in range(1, parts.rotors + 1))
    used = [rotor.tilt for rotor in rotors]
    for tilt in range(parts.tilts):
        if tilt not in used:
            raise ValueError(f"joint 'tilt_{tilt + 1}' tilts no rotor")
    return rotors


def spin_of(compiled: mujoco.MjModel, rotor: int) -> float:
    """The sign of a rotor's speed: its drag torque turns against it."""
    return -1.0 if compiled.actuator(f"thrust_{rotor}").gear[5] > 0.0 else 1.0


def speed_range(compiled: mujoco.MjModel, rotor: int) -> tuple[float, float]:
    """A rotor's lowest and highest speed (rad/s): its ``actrange``, else all along its spin."""
    low, high = compiled.actuator(f"rotor_speed_{rotor}").actrange
    if low < high:
        return float(low), float(high)
    return (0.0, inf) if spin_of(compiled, rotor) > 0.0 else (-inf, 0.0)


def _rotor(pose: VehiclePose, number: int, center: Floats) -> Rotor:
    compiled, data = pose.compiled, pose.data
    site, gear = data.site(f"rotor_{number}"), compiled.actuator(f"thrust_{number}").gear
    rotor = Rotor(
        _triple(pose.point(site.xpos) - center),
        _triple(pose.direction(site.xmat.reshape(3, 3)[:, 2])),
        float(gear[2]),
        abs(float(gear[5])),
        spin_of(compiled, number),
    )
    joint = _hinge(pose, number)
    if joint is None:
        return rotor
    return rotor._replace(
        tilt=int(compiled.joint(joint).name.removeprefix("tilt_")) - 1,
        hinge=_triple(pose.point(data.xanchor[joint]) - center),
        hinge_axis=_triple(pose.direction(data.xaxis[joint])),
    )


def _triple(vector: Floats) -> Triple:
    """Three numbers of an array."""
    x, y, z = vector.tolist()
    return x, y, z


def _hinge(pose: VehiclePose, rotor: int) -> int | None:
    """The id of the hinge that tilts a rotor; None for a fixed one."""
    compiled = pose.compiled
    body = int(compiled.site(f"rotor_{rotor}").bodyid[0])
    hinges: list[int] = []
    while body not in (pose.body, 0):
        first = int(compiled.body_jntadr[body])
        hinges += range(first, first + int(compiled.body_jntnum[body]))
        body = int(compiled.body_parentid[body])
    if body != pose.body:
        raise ValueError(
            f"site 'rotor_{rotor}' must be on the body 'vehicle' or on what it carries"
        )
    if len(hinges) > 1:
        names = " and ".join(repr(compiled.joint(j).name) for j in hinges)
        raise ValueError(f"site 'rotor_{rotor}' turns about {names}; at most one hinge tilts it")
    return hinges[0] if hinges else None


TOLERANCE = 1e-9  # relative tolerance of the singular values of force and torque and of the limits
NEARLY = 1e-3  # share of the weight by which the force of fewer than four rotors may miss it
REST = 1e-12  # a rotor with this part of the largest input is at rest


def hover_speeds(
    vehicle: Multirotor, tilts: Values, limits: tuple[float, float], dimension: int = 3
) -> Values:
    """Signed rotor speeds (rad/s) without torque, whose force carries the weight.

    The force is as large as the weight, and as nearly along the body's z axis as the tilt angles
    allow; a controller of fewer components of force leans instead of forcing the rest. Among all
    inputs ``varpi |varpi|`` that make it, these have the least norm, or the least largest one where
    the limits exclude those.

    Args:
        vehicle: The vehicle.
        tilts: rad.
        limits: Lowest and highest speed (rad/s) along the spin, the first negative for rotors that
            reverse.
        dimension: Number of components of the force that are controlled.

    Raises:
        InputError: If there are none within the limits.
    """
    force, torque = force_and_torque(vehicle.table, tilts)
    weight = vehicle.mass * vehicle.gravity
    forces = torque_free_forces(force, torque)
    if dimension < forces.dimension:
        axes = controlled_axes(forces, LEVEL, dimension)
        desired = force @ _least_inputs(axes @ force, torque, weight * axes[:, 2])
        direction = desired / np.linalg.norm(desired)
    elif forces.dimension:
        direction = hover_direction(forces)
    else:  # too few rotors for all torques; some make none, nearly so at tilts in decimals
        direction = np.array(LEVEL)
    ends = np.outer(vehicle.spins, [speed * abs(speed) for speed in limits])
    lower, upper = ends.min(axis=1), ends.max(axis=1)
    inputs = _least_inputs(force, torque, weight * direction)
    nearly = np.linalg.norm(force @ inputs / weight - direction) <= NEARLY
    if not (_within(inputs, lower, upper) and (forces.dimension or nearly)):
        from tiltsim_controllers.analysis.attainable import TiltedRotors
        from tiltsim_controllers.analysis.hover import evenest_inputs

        rotors = TiltedRotors(force, torque, lower, upper, weight)
        found = evenest_inputs(rotors, weight * direction)
        if found is None:
            needed = f", which takes {max(map(abs, _speeds(inputs))):.4g} rad/s" if nearly else ""
            raise InputError(
                "initial.rotor_speed: no rotor speeds within the limits hold the vehicle at its "
                f"initial tilts{needed}; give the speeds, or change vehicle.min_rotor_speed, "
                "vehicle.max_rotor_speed or the gait"
            )
        inputs = found
    return _speeds(inputs)


def _speeds(inputs: Floats) -> Values:
    """Signed speeds (rad/s) of inputs ``varpi |varpi|``, shape (N,)."""
    # Otherwise rounding, which depends on the processor, decides whether a rotor is at rest.
    inputs = np.where(np.abs(inputs) > REST * np.abs(inputs).max(), inputs, 0.0)
    return tuple((np.sign(inputs) * np.sqrt(np.abs(inputs))).tolist())


def _least_inputs(force: Floats, torque: Floats, desired: Floats) -> Floats:
    """The shortest ``varpi |varpi|`` that make a force, or components of it, without torque."""
    # Rows of one size: a force in N and a torque in N m do not compare.
    sizes = np.abs(force).max(), np.abs(torque).max()
    rows = np.vstack([force / sizes[0], torque / sizes[1]])
    values = np.concatenate([desired / sizes[0], np.zeros(3)])
    return np.linalg.pinv(rows, rcond=TOLERANCE) @ values


def _within(inputs: Floats, lower: Floats, upper: Floats) -> bool:
    slack = TOLERANCE * np.abs(inputs).max()
    return bool(((inputs >= lower - slack) & (inputs <= upper + slack)).all())
