"""Parts of a rotorcraft in a user's MJCF: names, order, types, places and mass properties."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import SPIN

if TYPE_CHECKING:
    import mujoco

MIN_ROTORS: Final = 2
MAX_ROTORS: Final = 16


class Parts(NamedTuple):
    """Numbers of rotors and tilt hinges of a rotorcraft."""

    rotors: int
    tilts: int

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in their order."""
        return ("vehicle", *self._names("tilt", self.tilts))

    @property
    def sites(self) -> tuple[str, ...]:
        """Names of the rotors' sites."""
        return self._names("rotor", self.rotors)

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names of the actuators, in their order."""
        rotors = (*self._names("thrust", self.rotors), *self._names("rotor_speed", self.rotors))
        return (*self._names("tilt", self.tilts), *rotors)

    @staticmethod
    def _names(kind: str, count: int) -> tuple[str, ...]:
        return tuple(f"{kind}_{i}" for i in range(1, count + 1))


CROSSES: Final = {"tiltrotor": Parts(4, 4), "quadrotor": Parts(4, 0)}
"""Parts of the vehicles whose number of rotors is given; a multirotor's are counted."""


def check_parts(compiled: mujoco.MjModel, model: str) -> Parts:
    """Count the parts of a compiled file for a ``vehicle.model``.

    Raises:
        ValueError: In one line: a part that is missing, superfluous, out of order, or of another
            kind than its name says.
    """
    parts = CROSSES.get(model) or _count(compiled)
    _check_names(compiled, model, parts)
    _check_joints(compiled)
    _check_thrusts(compiled, parts, SPIN if model in CROSSES else None)
    _check_servos(compiled, parts)
    return parts


def _count(compiled: mujoco.MjModel) -> Parts:
    sites = {compiled.site(s).name for s in range(compiled.nsite)}
    joints = {compiled.joint(j).name for j in range(compiled.njnt)}
    rotors, tilts = 0, 0
    while f"rotor_{rotors + 1}" in sites:
        rotors += 1
    while f"tilt_{tilts + 1}" in joints:
        tilts += 1
    numbered = sum(re.fullmatch(r"rotor_\d+", name) is not None for name in sites)
    if numbered > rotors or not MIN_ROTORS <= rotors <= MAX_ROTORS:
        raise ValueError(
            f"{rotors} sites named rotor_1, rotor_2, ... without a gap; a multirotor has "
            f"{MIN_ROTORS} to {MAX_ROTORS}"
        )
    return Parts(rotors, tilts)


def _check_names(compiled: mujoco.MjModel, model: str, parts: Parts) -> None:
    sites = parts.sites if model not in CROSSES else ("imu", *parts.sites)
    kinds = {
        "body": ([compiled.body(b).name for b in range(compiled.nbody)], ("vehicle",)),
        "joint": ([compiled.joint(j).name for j in range(compiled.njnt)], parts.joints),
        "site": ([compiled.site(s).name for s in range(compiled.nsite)], sites),
        "actuator": ([compiled.actuator(a).name for a in range(compiled.nu)], parts.actuators),
    }
    for kind, (found, required) in kinds.items():
        missing = [name for name in required if name not in found]
        if missing:
            more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
            raise ValueError(
                f"no {kind} {missing[0]!r}{more}; a {model} has the {kind} names "
                f"{', '.join(required)}"
            )
    for kind in ("joint", "actuator"):
        found, required = kinds[kind]
        superfluous = [name for name in found if name not in required]
        if superfluous:
            name = repr(superfluous[0]) if superfluous[0] else "without a name"
            hint = "; tools, loads and further vehicles are tables of the scenario"
            more = hint if kind == "joint" else ""
            raise ValueError(
                f"{kind} {name} is not one of a {model}'s, which are {', '.join(required)}{more}"
            )
        if tuple(found) != required:
            raise ValueError(f"its {kind}s must be in the order {', '.join(required)}")


def _check_joints(compiled: mujoco.MjModel) -> None:
    """Raise ValueError where a joint has another type than its name says."""
    import mujoco

    for j in range(compiled.njnt):
        name, actual = compiled.joint(j).name, compiled.joint(j).type[0]
        free = name == "vehicle"
        if actual != (mujoco.mjtJoint.mjJNT_FREE if free else mujoco.mjtJoint.mjJNT_HINGE):
            raise ValueError(f"joint {name!r} must be a {'free joint' if free else 'hinge'}")
    if compiled.joint("vehicle").bodyid[0] != compiled.body("vehicle").id:
        raise ValueError("the free joint 'vehicle' must be that of the body 'vehicle'")


def _check_thrusts(compiled: mujoco.MjModel, parts: Parts, spins: tuple[float, ...] | None) -> None:
    """Refuse actuators unlike their names; ``spins`` prescribes senses, and equal coefficients."""
    import mujoco

    gears = []
    for i in range(1, parts.rotors + 1):
        rotor = compiled.site(f"rotor_{i}").id
        thrust = compiled.actuator(f"thrust_{i}")
        site = thrust.trntype[0] == mujoco.mjtTrn.mjTRN_SITE
        if not (site and thrust.trnid[0] == rotor):
            raise ValueError(f"actuator 'thrust_{i}' must act on the site 'rotor_{i}'")
        force, torque = float(thrust.gear[2]), float(thrust.gear[5])
        plain = not np.any(thrust.gear[[0, 1, 3, 4]]) and thrust.gainprm[0] == 1.0
        backwards = spins is not None and spins[i - 1] * torque >= 0.0
        if not plain or force <= 0.0 or backwards or thrust.actadr[0] >= 0:
            sign = "+-" if spins is None else "+" if spins[i - 1] < 0.0 else "-"
            raise ValueError(
                f"actuator 'thrust_{i}' must be a general one with gear 0 0 Kf 0 0 {sign}Km, a "
                "gain of 1 and no state"
            )
        gears.append((force, abs(torque)))
        speed = compiled.actuator(f"rotor_speed_{i}")
        integrates = speed.dyntype[0] == mujoco.mjtDyn.mjDYN_INTEGRATOR
        if not integrates or speed.gainprm[0] != 0.0:
            raise ValueError(
                f"actuator 'rotor_speed_{i}' must have dyntype integrator and a gain of 0"
            )
    if spins is not None and len({np.round(gear, 15).tobytes() for gear in gears}) > 1:
        raise ValueError("the four thrust actuators must have the same Kf and Km in their gear")


def _check_servos(compiled: mujoco.MjModel, parts: Parts) -> None:
    """Raise ValueError where the actuator of a hinge is not a position servo."""
    import mujoco

    for i in range(1, parts.tilts + 1):
        servo, hinge = compiled.actuator(f"tilt_{i}"), compiled.joint(f"tilt_{i}").id
        on_hinge = servo.trntype[0] == mujoco.mjtTrn.mjTRN_JOINT and servo.trnid[0] == hinge
        position = servo.biastype[0] == mujoco.mjtBias.mjBIAS_AFFINE and servo.biasprm[1] < 0.0
        plain = servo.gear[0] == 1.0 and servo.actadr[0] < 0
        if not (on_hinge and position and plain):
            raise ValueError(
                f"actuator 'tilt_{i}' must be a position servo of the joint 'tilt_{i}', "
                "without gear or state"
            )


class Moments(NamedTuple):
    """Mass, first moment and inertia of bodies about an origin."""

    mass: float  # kg
    first_moment: Floats  # kg m, shape (3,)
    inertia: Floats  # kg m^2, shape (3, 3)


class VehiclePose:
    """A compiled vehicle in its file's pose, in the frame of the body ``vehicle``."""

    def __init__(self, compiled: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.compiled, self.data = compiled, data
        self.body = int(compiled.body("vehicle").id)
        self.frame = data.xmat[self.body].reshape(3, 3)  # from body to world

    def point(self, point: Floats) -> Floats:
        """A point of the world in body axes, from the body's origin."""
        return np.asarray(self.frame.T @ (point - self.data.xpos[self.body]))

    def direction(self, vector: Floats) -> Floats:
        """A vector of the world in body axes."""
        return np.asarray(self.frame.T @ vector)

    def moments(self, bodies: list[int]) -> Moments:
        """Mass properties of bodies, given by their ids, about the vehicle's origin."""
        mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        for body in bodies:
            own = float(self.compiled.body_mass[body])
            center = self.point(self.data.xipos[body])
            turn = self.frame.T @ self.data.ximat[body].reshape(3, 3)
            mass += own
            moment += own * center
            inertia += turn @ np.diag(self.compiled.body_inertia[body]) @ turn.T
            inertia += own * parallel_axis(center)
        return Moments(mass, moment, inertia)


def parallel_axis(offset: Floats) -> Floats:
    """The inertia (m^2, shape (3, 3)) about the origin of a unit mass at an offset (m)."""
    return np.asarray(np.dot(offset, offset) * np.eye(3) - np.outer(offset, offset))
