"""A user's own vehicle: an MJCF file with the names of the shipped ones.

`read_user_vehicle` compiles the file unchanged, checks the names, and measures the parameters that
control laws and the scenario need. `tiltsim.models.rotorcraft` then sets a scenario's parameters in
it, as in the shipped files. docs/own_vehicle.md explains the same to users.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.models.mjcf_files import mjcf_version
from tiltsim.system.hooks import mujoco_hooks
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle
from tiltsim_controllers.vehicle.states import ROTORS

if TYPE_CHECKING:
    import mujoco

JOINTS: Final = {
    "tiltrotor": ("vehicle", *(f"tilt_{i}" for i in ROTORS)),
    "quadrotor": ("vehicle",),
}
ACTUATORS: Final = {
    "tiltrotor": tuple(f"{kind}_{i}" for kind in ("tilt", "thrust", "rotor_speed") for i in ROTORS),
    "quadrotor": tuple(f"{kind}_{i}" for kind in ("thrust", "rotor_speed") for i in ROTORS),
}
SITES: Final = ("imu", *(f"rotor_{i}" for i in ROTORS))

ALIGNMENT_TOLERANCE: Final = 1e-4
"""Largest misalignment, as a fraction of the arm or of a unit vector."""

PRODUCT_TOLERANCE: Final = 0.01
"""Largest product of inertia that is not reported, as a fraction of the smallest moment."""


@dataclass(frozen=True, eq=False)
class UserVehicle:
    """A user's MJCF file and what was measured of it, untilted, along the body's axes.

    Attributes:
        path: The file.
        vehicle: Its parameters; inertia about the centre of mass.
        layout_mismatch: How it differs from the layout that the built-in control laws assume; empty
            if it does not.
        hinge_inertias: About each tilt hinge, armature included, kg m^2.
        carried: Mass properties of all bodies that the body ``vehicle`` carries, about its origin.
        center: The whole vehicle's centre of mass, m, shape (3,).
        products: The entries xy, xz and yz of its inertia about the centre of mass, kg m^2.
        has_contact_geoms: Whether it has the geoms that contacts with a scenario's ground need.
    """

    path: str
    vehicle: Vehicle
    layout_mismatch: str
    hinge_inertias: tuple[float, ...]
    carried: _Moments
    center: Floats
    products: tuple[float, float, float]
    has_contact_geoms: bool

    @property
    def unmodeled_properties(self) -> str:
        """The properties that the built-in control laws neglect; empty if there are none.

        The laws fly it all the same, with a model error. docs/own_vehicle.md says what it costs.
        """
        found = []
        if np.linalg.norm(self.center) > ALIGNMENT_TOLERANCE * self.vehicle.arm_length:
            found.append(f"its centre of mass at {_triple(self.center)} m")
        if np.abs(self.products).max() > PRODUCT_TOLERANCE * min(self.vehicle[1:4]):
            products = _triple(np.array(self.products))
            found.append(f"its products of inertia (xy, xz, yz) = {products} kg m^2")
        return " and ".join(found)

    def set_inertia(self, root: Any, vehicle: Vehicle) -> None:
        """Set mass and moments of inertia of the whole vehicle by changing the body ``vehicle``.

        Centre of mass and products of inertia stay the file's.

        Args:
            root: The file as a tree.
            vehicle: The parameters to set.

        Raises:
            ValueError: If no body could have the mass and moments that remain for it.
        """
        if vehicle[:4] == self.vehicle[:4]:
            return
        carried = self.carried
        mass = vehicle.mass - carried.mass
        if mass <= 0.0:
            raise ValueError(
                f"vehicle.mass = {vehicle.mass!r}: the bodies that the body 'vehicle' carries "
                f"already have {carried.mass:.6g} kg"
            )
        center = (vehicle.mass * self.center - carried.first_moment) / mass
        xy, xz, yz = self.products
        xx, yy, zz = vehicle[1:4]
        about_center = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        whole = about_center + vehicle.mass * _parallel_axis(self.center)
        inertia = whole - carried.inertia - mass * _parallel_axis(center)
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


@one_thread_at_a_time
def read_user_vehicle(path: str, model: str) -> UserVehicle:
    """Check and measure an MJCF file.

    Args:
        path: The file.
        model: ``tiltrotor`` or ``quadrotor``: the names that it must have.

    Raises:
        ValueError: In one line: the file cannot be read or compiled, or lacks a name.
    """
    try:
        Path(path).stat()
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    if not Path(path).is_file():
        raise ValueError("is not a file")
    return _read(path, model, mjcf_version(Path(path)))


@lru_cache(maxsize=64)
def _read(path: str, model: str, _version: object) -> UserVehicle:
    import mujoco

    try:
        with mujoco_hooks():
            compiled = mujoco.MjModel.from_xml_path(path)
    except (ValueError, RuntimeError) as error:  # the latter where it lacks memory
        raise ValueError(f"MuJoCo says: {' '.join(str(error).split())}") from None
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    _check_names(compiled, model)
    _check_joints(compiled)
    _check_thrusts(compiled)
    tilting = model == "tiltrotor"
    if tilting:
        _check_servos(compiled)
    pose = _InBody(compiled, data)
    carried = [
        b for b in range(pose.body + 1, compiled.nbody) if compiled.body_rootid[b] == pose.body
    ]
    whole = pose.moments([pose.body, *carried])
    center = whole.first_moment / whole.mass
    inertia = whole.inertia - whole.mass * _parallel_axis(center)
    thrust = compiled.actuator("thrust_1")
    arm = float(np.linalg.norm(pose.point(data.site("rotor_1").xpos)))
    gravity = float(-compiled.opt.gravity[2])
    if gravity <= 0.0 or np.any(compiled.opt.gravity[:2]):
        raise ValueError(f"option gravity = {compiled.opt.gravity.tolist()}: must point down z")
    xx, yy, zz = np.diag(inertia).tolist()
    thrust_coefficient, drag_coefficient = float(thrust.gear[2]), abs(float(thrust.gear[5]))
    tilts = [compiled.joint(f"tilt_{i}").dofadr[0] for i in ROTORS] if tilting else []
    return UserVehicle(
        path=path,
        vehicle=Vehicle(whole.mass, xx, yy, zz, arm, thrust_coefficient, drag_coefficient, gravity),
        layout_mismatch=_layout_mismatch(pose, arm, tilting=tilting),
        hinge_inertias=tuple(float(compiled.dof_M0[dof]) for dof in tilts),
        carried=pose.moments(carried),
        center=center,
        products=(float(inertia[0, 1]), float(inertia[0, 2]), float(inertia[1, 2])),
        has_contact_geoms=_has_contact_geoms(compiled),
    )


def _check_names(compiled: mujoco.MjModel, model: str) -> None:
    """Raise ValueError with the name that is missing, superfluous or out of order."""
    kinds = {
        "body": ([compiled.body(b).name for b in range(compiled.nbody)], ("vehicle",)),
        "joint": ([compiled.joint(j).name for j in range(compiled.njnt)], JOINTS[model]),
        "site": ([compiled.site(s).name for s in range(compiled.nsite)], SITES),
        "actuator": ([compiled.actuator(a).name for a in range(compiled.nu)], ACTUATORS[model]),
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
            raise ValueError(
                f"{kind} {superfluous[0]!r} is not one of a {model}'s, which are "
                f"{', '.join(required)}"
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


def _has_contact_geoms(compiled: mujoco.MjModel) -> bool:
    names = [compiled.geom(g).name for g in range(compiled.ngeom)]
    return "ground" in names and any(name.endswith("collision") for name in names)


def _check_thrusts(compiled: mujoco.MjModel) -> None:
    """Raise ValueError where an actuator of a rotor does not do what its name says."""
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
    if len({np.round(gear, 15).tobytes() for gear in gears}) > 1:
        raise ValueError("the four thrust actuators must have the same Kf and Km in their gear")


def _check_servos(compiled: mujoco.MjModel) -> None:
    """Raise ValueError where the actuator of a hinge is not a position servo."""
    import mujoco

    for i in ROTORS:
        servo, hinge = compiled.actuator(f"tilt_{i}"), compiled.joint(f"tilt_{i}").id
        on_hinge = servo.trntype[0] == mujoco.mjtTrn.mjTRN_JOINT and servo.trnid[0] == hinge
        position = servo.biastype[0] == mujoco.mjtBias.mjBIAS_AFFINE and servo.biasprm[1] < 0.0
        plain = servo.gear[0] == 1.0 and servo.actadr[0] < 0
        if not (on_hinge and position and plain):
            raise ValueError(
                f"actuator 'tilt_{i}' must be a position servo of the joint 'tilt_{i}', "
                "without gear or state"
            )


class _Moments(NamedTuple):
    """Mass, first moment and inertia of bodies about an origin."""

    mass: float  # kg
    first_moment: Floats  # kg m, shape (3,)
    inertia: Floats  # kg m^2, shape (3, 3)


class _InBody:
    """A compiled vehicle in its file's pose, in the frame of the body ``vehicle``."""

    def __init__(self, compiled: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.compiled, self.data = compiled, data
        self.body = int(compiled.body("vehicle").id)
        self.frame = data.xmat[self.body].reshape(3, 3)  # from body to world

    def point(self, point: Floats) -> Floats:
        """A point of the world in body axes, from the body's origin."""
        return np.asarray(self.frame.T @ (point - self.data.xpos[self.body]))

    def moments(self, bodies: list[int]) -> _Moments:
        """Mass properties of bodies, given by their ids, about the vehicle's origin."""
        mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        for body in bodies:
            own = float(self.compiled.body_mass[body])
            center = self.point(self.data.xipos[body])
            turn = self.frame.T @ self.data.ximat[body].reshape(3, 3)
            mass += own
            moment += own * center
            inertia += turn @ np.diag(self.compiled.body_inertia[body]) @ turn.T
            inertia += own * _parallel_axis(center)
        return _Moments(mass, moment, inertia)


def _layout_mismatch(pose: _InBody, arm: float, *, tilting: bool) -> str:
    """How a layout differs from four equal arms at right angles, in a few words."""
    data, frame = pose.data, pose.frame
    directions = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
    for i, direction in zip(ROTORS, directions, strict=True):
        site = data.site(f"rotor_{i}")
        expected = arm * np.array(direction)
        place = pose.point(site.xpos)
        if np.abs(place - expected).max() > ALIGNMENT_TOLERANCE * arm:
            return f"site 'rotor_{i}' lies at {_triple(place)} m instead of {_triple(expected)}"
        up = frame.T @ site.xmat.reshape(3, 3)[:, 2]
        if np.abs(up - (0.0, 0.0, 1.0)).max() > ALIGNMENT_TOLERANCE:
            return f"the z axis of site 'rotor_{i}' points to {_triple(up)}, not straight up"
        if tilting:
            joint = pose.compiled.joint(f"tilt_{i}").id
            axis = frame.T @ data.xaxis[joint]
            if np.abs(axis - direction).max() > ALIGNMENT_TOLERANCE:
                return f"joint 'tilt_{i}' turns about {_triple(axis)}, not outwards about its arm"
            anchor = pose.point(data.xanchor[joint])
            off_arm = anchor - anchor @ expected / arm**2 * expected
            if np.linalg.norm(off_arm) > ALIGNMENT_TOLERANCE * arm:
                return f"joint 'tilt_{i}' does not lie on its arm"
    return ""


def _parallel_axis(offset: Floats) -> Floats:
    """The inertia (m^2, shape (3, 3)) about the origin of a unit mass at an offset (m)."""
    return np.asarray(np.dot(offset, offset) * np.eye(3) - np.outer(offset, offset))


def _triple(vector: Floats) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in vector + 0.0) + ")"
