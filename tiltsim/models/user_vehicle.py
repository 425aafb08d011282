"""A user's vehicle: an MJCF file with the names of the shipped ones.

`read_user_vehicle` compiles the file unchanged, checks the names, and measures the parameters that
control laws and the scenario need. `tiltsim.models.rotorcraft` then sets a scenario's parameters in
it, as in the shipped files. docs/own_vehicle.md explains the same to users.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.models.mjcf_editing import mjcf_version
from tiltsim.models.rotor_table import Multirotor, read_rotors, speed_range
from tiltsim.models.vehicle_parts import (
    CROSSES,
    Moments,
    Parts,
    VehiclePose,
    check_parts,
    parallel_axis,
)
from tiltsim.system.files import one_thread_at_a_time
from tiltsim.system.hooks import mujoco_hooks
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.body import ROTORS
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    import mujoco

SMALLEST: Final = 1e-12
LARGEST: Final = 1e9
"""Magnitudes (SI units) of a vehicle's numbers that are not zero, as in a scenario."""

ALIGNMENT_TOLERANCE: Final = 1e-4
"""Largest misalignment, as a fraction of the arm or of a unit vector."""

BALANCE_TOLERANCE: Final = 1e-9
"""Largest change of the inertia by a balanced pod, as a fraction of the smallest moment."""

PRODUCT_TOLERANCE: Final = 0.01
"""Largest product of inertia that is not reported, as a fraction of the smallest moment."""


@dataclass(frozen=True, eq=False)
class UserVehicle:
    """A user's MJCF file and its measured properties, untilted, along the body's axes."""

    path: str
    vehicle: Vehicle | Multirotor  # inertia about the center of mass
    parts: Parts  # numbers of rotors and hinges
    layout_mismatch: str  # difference from the layout that the built-in laws assume; empty if none
    hinge_inertias: tuple[float, ...]  # about each tilt hinge, armature included, kg m^2
    pod_inertias: tuple[float, ...]  # about each tilt hinge, without armature, kg m^2
    pods_are_balanced: bool  # whether mass and inertia stay where they are as the pods turn
    carried: Moments  # of all bodies that the body ``vehicle`` carries, about its origin
    center: Floats  # the whole vehicle's center of mass, m, shape (3,)
    radius: float  # distance of the rotor that is farthest from the body's origin, m
    products: tuple[float, float, float]  # xy, xz, yz of the inertia about the center, kg m^2
    has_contact_geoms: bool  # geoms that contacts with a scenario's ground need
    obstacles: tuple[str, ...]  # names of the world's geoms that could collide, but for ``ground``

    @property
    def unmodeled_properties(self) -> str:
        """The properties that the built-in control laws neglect; empty if there are none.

        The laws fly it all the same, with a model error. docs/own_vehicle.md gives the cost.
        """
        found = []
        if np.linalg.norm(self.center) > ALIGNMENT_TOLERANCE * self.radius:
            found.append(f"its center of mass at {_triple(self.center)} m")
        if isinstance(self.vehicle, Multirotor):
            return " and ".join(found)
        if np.abs(self.products).max() > PRODUCT_TOLERANCE * min(self.vehicle.moments):
            products = _triple(np.array(self.products))
            found.append(f"its products of inertia (xy, xz, yz) = {products} kg m^2")
        return " and ".join(found)

    def set_inertia(self, spec: mujoco.MjSpec, vehicle: Vehicle | Multirotor) -> None:
        """Set mass and moments of inertia of the whole vehicle by changing its body.

        Center of mass and products of inertia stay the file's. Raises ValueError if no body could
        have the mass and moments that remain for it.
        """
        import mujoco

        about_center = self._inertia_about_center(vehicle)
        unchanged = np.array_equal(about_center, self._inertia_about_center(self.vehicle))
        if unchanged and vehicle.mass == self.vehicle.mass:
            return
        carried = self.carried
        mass = vehicle.mass - carried.mass
        if mass <= 0.0:
            raise ValueError(
                f"vehicle.mass = {vehicle.mass!r}: the bodies that the body 'vehicle' carries "
                f"already have {carried.mass:.6g} kg"
            )
        center = (vehicle.mass * self.center - carried.first_moment) / mass
        whole = about_center + vehicle.mass * parallel_axis(self.center)
        inertia = whole - carried.inertia - mass * parallel_axis(center)
        moments = np.linalg.eigvalsh(inertia)
        if moments[0] <= 0.0 or 2.0 * moments[-1] > moments.sum():
            raise ValueError(
                f"vehicle.inertia = {list(vehicle.moments)}: the body without what it carries "
                f"would have the principal moments {', '.join(f'{m:.4g}' for m in moments)} "
                "kg m^2; all must be above 0, and none larger than the sum of the other two"
            )
        body, (xx, yy, zz) = spec.body("vehicle"), np.diag(inertia)
        body.explicitinertial, body.mass, body.ipos = True, mass, center
        # In place of principal moments and their axes, if the file has any.
        body.inertia, body.iquat = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
        body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        body.fullinertia = (xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2])

    def _inertia_about_center(self, vehicle: Vehicle | Multirotor) -> Floats:
        """The inertia matrix of parameters, with the file's products where they have none."""
        if isinstance(vehicle, Multirotor):
            return np.reshape(vehicle.inertia, (3, 3))
        xy, xz, yz = self.products
        xx, yy, zz = vehicle.moments
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@one_thread_at_a_time
def read_user_vehicle(path: str, model: str) -> UserVehicle:
    """Check and measure an MJCF file that must have the names of a ``vehicle.model``.

    Raises ValueError in one line if it cannot be read or compiled, or lacks a name.
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
    _check_magnitudes(compiled)
    parts = check_parts(compiled, model)
    gravity = float(-compiled.opt.gravity[2])
    if gravity <= 0.0 or np.any(compiled.opt.gravity[:2]):
        raise ValueError(f"option gravity = {compiled.opt.gravity.tolist()}: must point down z")
    data = mujoco.MjData(compiled)
    data.qpos[7:] = 0.0  # tilts, which are the only other joints
    mujoco.mj_kinematics(compiled, data)
    pose = VehiclePose(compiled, data)
    carried = [
        b for b in range(pose.body + 1, compiled.nbody) if compiled.body_rootid[b] == pose.body
    ]
    whole = pose.moments([pose.body, *carried])
    center = whole.first_moment / whole.mass
    inertia = whole.inertia - whole.mass * parallel_axis(center)
    vehicle, mismatch = (
        _cross(pose, parts, whole.mass, inertia, gravity)
        if model in CROSSES
        else (_multirotor(pose, parts, whole.mass, inertia, gravity, center), "")
    )
    geoms = [compiled.geom(g).name for g in range(compiled.ngeom)]
    touches = "ground" in geoms and any(name.endswith("collision") for name in geoms)
    tilts = [compiled.joint(f"tilt_{i}").dofadr[0] for i in range(1, parts.tilts + 1)]
    return UserVehicle(
        path=path,
        vehicle=vehicle,
        parts=parts,
        layout_mismatch=mismatch,
        hinge_inertias=tuple(float(compiled.dof_M0[dof]) for dof in tilts),
        pod_inertias=tuple(
            float(compiled.dof_M0[dof] - compiled.dof_armature[dof]) for dof in tilts
        ),
        pods_are_balanced=_pods_are_balanced(pose, parts.tilts, [pose.body, *carried], whole),
        carried=pose.moments(carried),
        center=center,
        radius=max(float(np.linalg.norm(pose.point(data.site(s).xpos))) for s in parts.sites),
        products=(float(inertia[0, 1]), float(inertia[0, 2]), float(inertia[1, 2])),
        has_contact_geoms=touches,
        obstacles=_obstacles(compiled),
    )


def _check_magnitudes(compiled: mujoco.MjModel) -> None:
    """Raise ValueError for numbers with which sums of squares would overflow or vanish."""
    of_bodies = compiled.body_mass, compiled.body_inertia, compiled.body_pos, compiled.body_ipos
    for name, values, least in (
        ("mass, inertia or position of a body", np.hstack([*map(np.ravel, of_bodies)]), 0.0),
        ("position of a site", compiled.site_pos, 0.0),
        ("actrange of an actuator", compiled.actuator_actrange, 0.0),
        ("gear of an actuator", compiled.actuator_gear, SMALLEST),
        ("option gravity", compiled.opt.gravity, SMALLEST),
    ):
        sizes = np.abs(values[values != 0.0])
        if wrong := [*sizes[(sizes < least) | (sizes > LARGEST)]]:
            allowed = f"at most {LARGEST:g}" + (f", at least {least:g}" if least else "")
            raise ValueError(f"{name}: {wrong[0]:g}: must be {allowed}")


def _pods_are_balanced(pose: VehiclePose, tilts: int, bodies: list[int], untilted: Moments) -> bool:
    """Whether each pod, turned alone by a right angle, leaves the vehicle's moments as they are."""
    import mujoco

    compiled, data = pose.compiled, mujoco.MjData(pose.compiled)
    tolerance = BALANCE_TOLERANCE * np.linalg.eigvalsh(untilted.inertia)[0]
    for tilt in range(1, tilts + 1):
        data.qpos[7:] = 0.0
        data.qpos[compiled.joint(f"tilt_{tilt}").qposadr[0]] = 0.5 * np.pi
        mujoco.mj_kinematics(compiled, data)
        turned = VehiclePose(compiled, data).moments(bodies)
        radius = np.sqrt(np.trace(untilted.inertia) / untilted.mass)
        moved = radius * np.abs(turned.first_moment - untilted.first_moment).max()
        if max(moved, np.abs(turned.inertia - untilted.inertia).max()) > tolerance:
            return False
    return True


def _obstacles(compiled: mujoco.MjModel) -> tuple[str, ...]:
    fixed = compiled.body_weldid[compiled.geom_bodyid] == 0
    collides = (compiled.geom_contype != 0) | (compiled.geom_conaffinity != 0)
    names = [compiled.geom(geom).name for geom in np.flatnonzero(fixed & collides)]
    return tuple(name for name in names if name != "ground")


def _cross(
    pose: VehiclePose, parts: Parts, mass: float, inertia: Floats, gravity: float
) -> tuple[Vehicle, str]:
    """The parameters of four rotors on a cross, and how the layout differs from one."""
    thrust = pose.compiled.actuator("thrust_1")
    arm = float(np.linalg.norm(pose.point(pose.data.site("rotor_1").xpos)))
    if arm < SMALLEST:
        raise ValueError("site 'rotor_1' lies in the middle of the vehicle, without an arm")
    coefficients = float(thrust.gear[2]), abs(float(thrust.gear[5]))
    xx, yy, zz = np.diag(inertia).tolist()
    vehicle = Vehicle(mass, xx, yy, zz, arm, *coefficients, gravity)
    return vehicle, _layout_mismatch(pose, arm, tilting=parts.tilts > 0)


def _multirotor(
    pose: VehiclePose, parts: Parts, mass: float, inertia: Floats, gravity: float, center: Floats
) -> Multirotor:
    rotors = range(1, parts.rotors + 1)
    return Multirotor(
        mass,
        gravity,
        tuple(inertia.ravel().tolist()),
        read_rotors(pose, parts, center),
        tuple(speed_range(pose.compiled, i) for i in rotors),
        parts.tilts,
    )


def _layout_mismatch(pose: VehiclePose, arm: float, *, tilting: bool) -> str:
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


def _triple(vector: Floats) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in vector + 0.0) + ")"
