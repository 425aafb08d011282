"""The rotors of a compiled vehicle: what each does to the body, at any tilt."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.effectiveness import layout_of, rotor_entries

if TYPE_CHECKING:
    import mujoco

    from tiltsim.models.pose import VehiclePose
    from tiltsim.models.vehicle_parts import Parts


@dataclass(frozen=True)
class Multirotor:
    """Physical parameters of a vehicle with any number of rotors, along the body's axes.

    Attributes:
        mass: kg.
        gravity: m/s^2.
        inertia: About the centre of mass, untilted, everything on board included: nine entries,
            rows first, kg m^2.
        table: Of the rotors; see `tiltsim_controllers.vehicle.effectiveness`.
        thrust_coefficients: K_f of each rotor, N s^2/rad^2.
        spins: Signs of the rotor speeds at positive thrust.
        speed_ranges: Lowest and highest speed of each rotor, signed, rad/s; infinite where the file
            gives none.
        tilts: Number of tilt hinges.
    """

    mass: float
    gravity: float
    inertia: Values
    table: Values
    thrust_coefficients: Values
    spins: Values
    speed_ranges: tuple[tuple[float, float], ...]
    tilts: int

    @property
    def hover_rotor_speed(self) -> float:
        """The speed (rad/s) at which all thrusts, were they upward, carry the weight."""
        return float((self.mass * self.gravity / sum(self.thrust_coefficients)) ** 0.5)


def rotor_table(pose: VehiclePose, parts: Parts, center: Floats) -> Values:
    """The rotors' table, with torques about the point ``center`` (m, body axes).

    Raises:
        ValueError: If more than one hinge is between a rotor and the body, or a hinge has no rotor.
    """
    table = tuple(entry for i in range(1, parts.rotors + 1) for entry in _row(pose, i, center))
    used = layout_of(table)
    for tilt in range(parts.tilts):
        if tilt not in used:
            raise ValueError(f"joint 'tilt_{tilt + 1}' tilts no rotor")
    return table


def spin_of(compiled: mujoco.MjModel, rotor: int) -> float:
    """The sign of a rotor's speed: its drag torque turns against it."""
    return -1.0 if compiled.actuator(f"thrust_{rotor}").gear[5] > 0.0 else 1.0


def speed_range(compiled: mujoco.MjModel, rotor: int) -> tuple[float, float]:
    """A rotor's lowest and highest speed (rad/s): its ``actrange``, else all along its spin."""
    low, high = compiled.actuator(f"rotor_speed_{rotor}").actrange
    if low < high:
        return float(low), float(high)
    return (0.0, inf) if spin_of(compiled, rotor) > 0.0 else (-inf, 0.0)


def _row(pose: VehiclePose, rotor: int, center: Floats) -> Values:
    compiled, data = pose.compiled, pose.data
    site, gear = data.site(f"rotor_{rotor}"), compiled.actuator(f"thrust_{rotor}").gear
    rotating = (
        pose.point(site.xpos) - center,
        pose.direction(site.xmat.reshape(3, 3)[:, 2]),
        float(gear[2]),
        abs(float(gear[5])),
        spin_of(compiled, rotor),
    )
    joint = _hinge(pose, rotor)
    if joint is None:
        return rotor_entries(*rotating)
    return rotor_entries(
        *rotating,
        tilt=int(compiled.joint(joint).name.removeprefix("tilt_")) - 1,
        hinge=pose.point(data.xanchor[joint]) - center,
        hinge_axis=pose.direction(data.xaxis[joint]),
    )


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
