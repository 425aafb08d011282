"""A user's own vehicle: an MJCF file with the names that the shipped ones have.

`read_user_vehicle` compiles the file as it is, checks the names, and measures what control laws and
the scenario need to know. `tiltsim.models.rotorcraft` then puts a scenario's own numbers in their
place, as it does with the shipped files. docs/own_vehicle.md tells users the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle

if TYPE_CHECKING:
    import mujoco

    from tiltsim.models.parts import TiltServo

ROTORS: Final = (1, 2, 3, 4)
JOINTS: Final = {
    "tiltrotor": ("vehicle", *(f"tilt_{i}" for i in ROTORS)),
    "quadrotor": ("vehicle",),
}
ACTUATORS: Final = {
    "tiltrotor": tuple(f"{kind}_{i}" for kind in ("tilt", "thrust", "rotor_speed") for i in ROTORS),
    "quadrotor": tuple(f"{kind}_{i}" for kind in ("thrust", "rotor_speed") for i in ROTORS),
}
SITES: Final = ("imu", *(f"rotor_{i}" for i in ROTORS))

ALIGNED: Final = 1e-4
"""How far, as a share of the arm or of a unit vector, what must be aligned may be off."""

SMALL_PRODUCT: Final = 0.01
"""Products of inertia worth telling, as a share of the least moment."""


@dataclass(frozen=True, eq=False)
class UserVehicle:
    """An MJCF file of a user's, as measured.

    Attributes
    ----------
    path
        The file.
    modified
        When it was last changed, ns, to tell one version of it from another.
    vehicle
        Its parameters, untilted: inertia about the centre of mass along the body's axes.
    layout_mismatch
        In what it differs from the layout that the shipped laws assume; empty where it does not.
    hinge_inertias
        About each tilt hinge, armature included, kg m^2.
    rest_mass
        Of all that moves but is not the body ``vehicle`` itself, kg.
    rest_moment
        First moment of that about the body's origin, kg m.
    rest_inertia
        Its inertia about the body's origin, (3, 3), kg m^2.
    center
        The whole vehicle's centre of mass, m, body axes.
    products
        The entries xy, xz and yz of its inertia about the centre of mass, kg m^2, body axes.
    has_contact_geoms
        Whether it has the geoms by which a scenario's ground is touched.
    """

    path: str
    modified: int
    vehicle: Vehicle
    layout_mismatch: str
    hinge_inertias: tuple[float, ...]
    rest_mass: float
    rest_moment: Floats
    rest_inertia: Floats
    center: Floats
    products: tuple[float, float, float]
    has_contact_geoms: bool

    @property
    def unmodeled_properties(self) -> str:
        """In what the shipped laws take it for another vehicle, in words; empty where in nothing.

        They fly all the same, with a model error. docs/own_vehicle.md says what it costs.
        """
        found = []
        if np.linalg.norm(self.center) > ALIGNED * self.vehicle.arm_length:
            found.append(f"its centre of mass at {_triple(self.center)} m")
        if np.abs(self.products).max() > SMALL_PRODUCT * min(self.vehicle[1:4]):
            products = _triple(np.array(self.products))
            found.append(f"its products of inertia (xy, xz, yz) = {products} kg m^2")
        return " and ".join(found)

    def set_inertia(self, root: Any, vehicle: Vehicle) -> None:
        """Let mass and moments of the whole be a vehicle's; what differs goes into the body.

        Centre of mass and products of inertia stay the file's. Raises ValueError where no body
        makes up for it.
        """
        if vehicle[:4] == self.vehicle[:4]:
            return
        mass = vehicle.mass - self.rest_mass
        if mass <= 0.0:
            raise ValueError(
                f"vehicle.mass = {vehicle.mass!r}: the bodies that the body 'vehicle' carries "
                f"have {self.rest_mass:.6g} kg already"
            )
        center = (vehicle.mass * self.center - self.rest_moment) / mass
        xy, xz, yz = self.products
        xx, yy, zz = vehicle[1:4]
        about_center = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        whole = about_center + vehicle.mass * _parallel_axis(self.center)
        inertia = whole - self.rest_inertia - mass * _parallel_axis(center)
        moments = np.linalg.eigvalsh(inertia)
        if moments[0] <= 0.0 or 2.0 * moments[-1] > moments.sum():
            raise ValueError(
                f"vehicle.inertia = {list(vehicle[1:4])}: the body without what it carries would "
                f"have the principal moments {', '.join(f'{m:.4g}' for m in moments)} kg m^2; all "
                "must be above 0, and none larger than the sum of the other two"
            )
        body = root.find("body", "vehicle")
        if body.inertial is not None:
            body.inertial.remove()
        xx, yy, zz = np.diag(inertia)
        body.add(
            "inertial",
            pos=center,
            mass=mass,
            fullinertia=(xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2]),
        )

    def set_servos(self, root: Any, servo: TiltServo) -> None:
        """Give each tilt servo its natural frequency, damping and stops."""
        for i, inertia in zip(ROTORS, self.hinge_inertias, strict=True):
            actuator, joint = root.find("actuator", f"tilt_{i}"), root.find("joint", f"tilt_{i}")
            actuator.kp = inertia * servo.natural_frequency**2
            actuator.kv = 2.0 * inertia * servo.damping_ratio * servo.natural_frequency
            actuator.dampratio = None
            joint.range = actuator.ctrlrange = None
            joint.limited = actuator.ctrllimited = "false"
            if servo.max_angle is not None:
                joint.range = actuator.ctrlrange = (-servo.max_angle, servo.max_angle)
                joint.limited = actuator.ctrllimited = "true"
                # As for the shipped vehicles: as stiff as MuJoCo allows.
                joint.solreflimit = (2.0 * root.option.timestep, 1.0)
                joint.solimplimit = (0.99, 0.99, 0.001, 0.5, 2.0)


def read_user_vehicle(path: str, model: str) -> UserVehicle:
    """Check and measure an MJCF file.

    Parameters
    ----------
    path
        The file.
    model
        ``tiltrotor`` or ``quadrotor``: the names that it must have.

    Raises
    ------
    ValueError
        In one line: the file cannot be read or compiled, or lacks a name.
    """
    try:
        modified = Path(path).stat().st_mtime_ns
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    if not Path(path).is_file():
        raise ValueError("is no file")
    return _read(path, model, modified)


@lru_cache(maxsize=64)
def _read(path: str, model: str, modified: int) -> UserVehicle:
    import mujoco

    try:
        compiled = mujoco.MjModel.from_xml_path(path)
    except ValueError as error:
        raise ValueError(f"MuJoCo says: {' '.join(str(error).split())}") from None
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    _check_names(compiled, model)
    _check_actuators(compiled, model)
    body = int(compiled.body("vehicle").id)
    frame = data.xmat[body].reshape(3, 3)  # from body to world, as the file leaves it

    def in_body(point: Floats) -> Floats:
        return np.asarray(frame.T @ (point - data.xpos[body]))

    carried = [b for b in range(body + 1, compiled.nbody) if compiled.body_rootid[b] == body]
    rest = _moments(compiled, data, carried, in_body, frame)
    whole = _moments(compiled, data, [body, *carried], in_body, frame)
    mass = whole[0]
    center = whole[1] / mass
    inertia = whole[2] - mass * _parallel_axis(center)
    thrust = compiled.actuator("thrust_1")
    arm = float(np.linalg.norm(in_body(data.site("rotor_1").xpos)))
    gravity = float(-compiled.opt.gravity[2])
    if gravity <= 0.0 or np.any(compiled.opt.gravity[:2]):
        raise ValueError(f"option gravity = {compiled.opt.gravity.tolist()}: must point down z")
    xx, yy, zz = np.diag(inertia).tolist()
    vehicle = Vehicle(
        *(mass, xx, yy, zz, arm, float(thrust.gear[2]), abs(float(thrust.gear[5])), gravity)
    )
    tilts = [compiled.joint(f"tilt_{i}").dofadr[0] for i in ROTORS] if model == "tiltrotor" else []
    return UserVehicle(
        path,
        modified,
        vehicle,
        _misfit(compiled, data, in_body, frame, arm, tilting=model == "tiltrotor"),
        tuple(float(compiled.dof_M0[dof]) for dof in tilts),
        *rest,
        center,
        (float(inertia[0, 1]), float(inertia[0, 2]), float(inertia[1, 2])),
        _can_touch(compiled),
    )


def _check_names(compiled: mujoco.MjModel, model: str) -> None:
    """Raise ValueError, naming what is missing, or too much, or out of order."""
    joints = [compiled.joint(j).name for j in range(compiled.njnt)]
    actuators = [compiled.actuator(a).name for a in range(compiled.nu)]
    sites = [compiled.site(s).name for s in range(compiled.nsite)]
    bodies = [compiled.body(b).name for b in range(compiled.nbody)]
    _check_complete("body", bodies, ("vehicle",), model)
    _check_complete("joint", joints, JOINTS[model], model)
    _check_complete("site", sites, SITES, model)
    _check_complete("actuator", actuators, ACTUATORS[model], model)
    for kind, found, wanted in (
        ("joint", joints, JOINTS[model]),
        ("actuator", actuators, ACTUATORS[model]),
    ):
        besides = [name for name in found if name not in wanted]
        if besides:
            raise ValueError(
                f"{kind} {besides[0]!r} is not one of a {model}: {', '.join(wanted)}, and no other"
            )
        if tuple(found) != wanted:
            raise ValueError(f"its {kind}s stand in another order than {', '.join(wanted)}")
    import mujoco

    for name in joints:
        free = compiled.joint(name).type[0] == mujoco.mjtJoint.mjJNT_FREE
        hinge = compiled.joint(name).type[0] == mujoco.mjtJoint.mjJNT_HINGE
        if not (free if name == "vehicle" else hinge):
            kind = "free joint" if name == "vehicle" else "hinge"
            raise ValueError(f"joint {name!r} must be a {kind}")
    if compiled.joint("vehicle").bodyid[0] != compiled.body("vehicle").id:
        raise ValueError("the free joint 'vehicle' must be that of the body 'vehicle'")


def _can_touch(compiled: mujoco.MjModel) -> bool:
    names = [compiled.geom(g).name for g in range(compiled.ngeom)]
    return "ground" in names and any(name.endswith("collision") for name in names)


def _check_complete(kind: str, found: Iterable[str], wanted: Iterable[str], model: str) -> None:
    there = set(found)
    missing = [name for name in wanted if name not in there]
    if missing:
        more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        raise ValueError(
            f"no {kind} {missing[0]!r}{more}; a {model} has the {kind} names {', '.join(wanted)}"
        )


def _check_actuators(compiled: mujoco.MjModel, model: str) -> None:
    """Raise ValueError where an actuator does not do what its name says."""
    import mujoco

    gears = []
    for i, spin in zip(ROTORS, SPIN, strict=True):
        rotor = compiled.site(f"rotor_{i}").id
        thrust = compiled.actuator(f"thrust_{i}")
        site = thrust.trntype[0] == mujoco.mjtTrn.mjTRN_SITE
        if not (site and thrust.trnid[0] == rotor):
            raise ValueError(f"actuator 'thrust_{i}' must act on the site 'rotor_{i}'")
        force, torque = float(thrust.gear[2]), float(thrust.gear[5])
        plain = not np.any(thrust.gear[[0, 1, 3, 4]]) and thrust.gainprm[0] == 1.0
        if not plain or force <= 0.0 or spin * torque >= 0.0 or thrust.actadr[0] >= 0:
            sign = "+" if spin < 0.0 else "-"
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
        if model == "tiltrotor":
            servo, hinge = compiled.actuator(f"tilt_{i}"), compiled.joint(f"tilt_{i}").id
            on_hinge = servo.trntype[0] == mujoco.mjtTrn.mjTRN_JOINT and servo.trnid[0] == hinge
            position = servo.biastype[0] == mujoco.mjtBias.mjBIAS_AFFINE
            plain = servo.gear[0] == 1.0 and servo.actadr[0] < 0
            if not (on_hinge and position and plain):
                raise ValueError(
                    f"actuator 'tilt_{i}' must be a position servo of the joint 'tilt_{i}', "
                    "without gear or state"
                )
    if len({np.round(gear, 15).tobytes() for gear in gears}) > 1:
        raise ValueError("the four thrust actuators must have the same Kf and Km in their gear")


def _misfit(
    compiled: mujoco.MjModel,
    data: mujoco.MjData,
    in_body: Any,
    frame: Floats,
    arm: float,
    *,
    tilting: bool,
) -> str:
    """In what a layout differs from four equal arms at right angles, in a few words."""
    directions = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
    for i, direction in zip(ROTORS, directions, strict=True):
        site = data.site(f"rotor_{i}")
        wanted = arm * np.array(direction)
        place = in_body(site.xpos)
        if np.abs(place - wanted).max() > ALIGNED * arm:
            return f"site 'rotor_{i}' lies at {_triple(place)} m instead of {_triple(wanted)}"
        up = frame.T @ site.xmat.reshape(3, 3)[:, 2]
        if np.abs(up - (0.0, 0.0, 1.0)).max() > ALIGNED:
            return f"the z axis of site 'rotor_{i}' points to {_triple(up)}, not straight up"
        if tilting:
            joint = compiled.joint(f"tilt_{i}").id
            axis = frame.T @ data.xaxis[joint]
            if np.abs(axis - direction).max() > ALIGNED:
                return f"joint 'tilt_{i}' turns about {_triple(axis)}, not about its arm outwards"
            anchor = in_body(data.xanchor[joint])
            if np.linalg.norm(anchor - anchor @ wanted / arm**2 * wanted) > ALIGNED * arm:
                return f"joint 'tilt_{i}' does not lie on its arm"
    return ""


def _moments(
    compiled: mujoco.MjModel,
    data: mujoco.MjData,
    bodies: list[int],
    in_body: Any,
    frame: Floats,
) -> tuple[float, Floats, Floats]:
    """Mass, first moment and inertia of bodies about the vehicle's origin, in its axes."""
    mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    for body in bodies:
        own = float(compiled.body_mass[body])
        center = in_body(data.xipos[body])
        turn = frame.T @ data.ximat[body].reshape(3, 3)
        mass += own
        moment += own * center
        inertia += turn @ np.diag(compiled.body_inertia[body]) @ turn.T
        inertia += own * _parallel_axis(center)
    return mass, moment, inertia


def _parallel_axis(offset: Floats) -> Floats:
    """What a unit mass at an offset adds to an inertia about the origin, m^2."""
    return np.asarray(np.dot(offset, offset) * np.eye(3) - np.outer(offset, offset))


def _triple(vector: Floats) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in vector + 0.0) + ")"
