"""Replaying a flight on a MuJoCo model: the pose of every body at every sample.

Independent of the vehicle. Free joints take the recorded position and attitude, every other joint
the column of its name, where ``tilt`` is ``alpha``; a joint without a column keeps the model's
default.
"""

import re
from collections.abc import Mapping
from math import cos, floor, log10, radians, sin
from typing import NamedTuple

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.plants.flight_model import build_model
from tiltsim.scenario.scenario import Scenario
from tiltsim.views.dressing import dress
from tiltsim_controllers.mathematics.attitude import quaternion_of_euler
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.references.trajectories import position_reference

Columns = Mapping[str, Floats]


class CameraPose(NamedTuple):
    """The pose of a camera relative to the vehicle, at which it looks."""

    distance: float  # vehicle radii
    azimuth: float  # of its direction, degrees
    elevation: float  # degrees, negative from above

    @property
    def away(self) -> Floats:
        """The unit vector from the vehicle to the camera, shape (3,)."""
        azimuth, elevation = radians(self.azimuth), radians(self.elevation)
        level = cos(elevation)
        return -np.array([level * cos(azimuth), level * sin(azimuth), sin(elevation)])


def camera_of(scenario: Scenario) -> CameraPose:
    """The camera that suits a vehicle: above one that moves in a plane."""
    planar = scenario.vehicle.is_planar
    return CameraPose(9.0, 90.0, -62.0) if planar else CameraPose(7.5, 130.0, -24.0)


class Poses(NamedTuple):
    """Poses of all bodies of a model over N samples."""

    position: Floats  # (N, nbody, 3), m
    quaternion: Floats  # (N, nbody, 4), scalar first


def visible_model(assembly: Assembly) -> mujoco.MjModel:
    """The compiled model of a flight's vehicles; users' files are dressed for the picture."""
    flown = (assembly.scenario, *assembly.scenario.companions)
    planar = assembly.scenario.vehicle.is_planar
    own = not planar and any(each.any_rotorcraft.user_vehicle is not None for each in flown)
    return build_model(assembly, visuals=dress if own else True)


def joint_positions(model: mujoco.MjModel, columns: Columns) -> Floats:
    """MuJoCo's ``qpos`` at every one of N samples, shape (N, nq)."""
    qpos = np.tile(model.qpos0, (len(columns["time"]), 1))
    for joint in range(model.njnt):
        address = model.jnt_qposadr[joint]
        kind, name = mujoco.mjtJoint(model.jnt_type[joint]), model.joint(joint).name
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            of = "" if joint == 0 else f"{name.removesuffix('_vehicle')}_"
            qpos[:, address : address + 3] = _stack(columns, (f"{of}x", f"{of}y", f"{of}z"))
            if f"{of}roll" not in columns:  # a load, of which the attitude does not count
                continue
            angles = _stack(columns, (f"{of}roll", f"{of}pitch", f"{of}yaw"))
            qpos[:, address + 3 : address + 7] = quaternion_of_euler(angles.T).T
        elif kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            column = re.sub(r"tilt(?=_\d+$|$)", "alpha", name)
            if column in columns:
                qpos[:, address] = columns[column]
    return qpos


def world_poses(model: mujoco.MjModel, qpos: Floats) -> Poses:
    """World poses of the bodies for joint positions ``qpos``, shape (N, nq)."""
    data = mujoco.MjData(model)
    poses = Poses(np.empty((len(qpos), model.nbody, 3)), np.empty((len(qpos), model.nbody, 4)))
    for sample, row in enumerate(qpos):
        data.qpos = row
        mujoco.mj_kinematics(model, data)
        poses.position[sample], poses.quaternion[sample] = data.xpos, data.xquat
    return poses


def poses_in_parents(model: mujoco.MjModel, poses: Poses) -> Poses:
    """Poses of the bodies relative to their parent bodies, from world poses."""
    parents = model.body_parentid
    inverse = poses.quaternion[:, parents] * (1.0, -1.0, -1.0, -1.0)
    offset = poses.position - poses.position[:, parents]
    return Poses(rotate(inverse, offset), _product(inverse, poses.quaternion))


def cables(
    scenario: Scenario, model: mujoco.MjModel, world: Poses, time: Floats
) -> dict[str, Floats]:
    """Both ends of each cable in the world (m), shape (N, 2, 3), by its name.

    Args:
        scenario: Its cables have times between which they hold, else both ends are equal.
        model, world: The model and the poses of its bodies.
        time: Times of the poses, s.
    """
    found = {}
    for tendon in range(model.ntendon):
        first = model.tendon_adr[tendon]
        sites = model.wrap_objid[first : first + 2]
        body = model.site_bodyid[sites]
        places = rotate(world.quaternion[:, body], model.site_pos[sites])
        found[model.tendon(tendon).name] = world.position[:, body] + places
    for table in scenario.cable:
        loose = [not table.cable.holds(at) for at in time.tolist()]
        found[table.name][loose, 1] = found[table.name][loose, 0]
    return found


def thrust_sites(model: mujoco.MjModel) -> dict[int, str]:
    """Sites with a rotor's thrust along their z axis, and the column of that thrust (N)."""
    names = {site: model.site(site).name for site in range(model.nsite)}
    return {
        site: re.sub(r"rotor_(?=\d+$)", "thrust_", name)
        for site, name in names.items()
        if re.search(r"(^|_)rotor_\d+$", name)
    }


def seen_radius(scenario: Scenario, model: mujoco.MjModel) -> float:
    """The vehicle's radius (m), or a larger one so that a camera sees companions and a load."""
    begin = np.array(scenario.initial.position)
    companions = (each.initial.position for each in scenario.companions)
    apart = [float(np.linalg.norm(place - begin)) for place in companions]
    apart += [scenario.payload.length] if scenario.payload else []
    return vehicle_radius(model) + 0.25 * max(apart, default=0.0)


def _first_rotors(model: mujoco.MjModel) -> list[int]:
    """The sites of the first vehicle's rotors."""
    sites, free = thrust_sites(model), first_free_body(model)
    return [site for site in sites if model.body_rootid[model.site_bodyid[site]] == free]


def vehicle_radius(model: mujoco.MjModel) -> float:
    """Largest distance of a rotor, or else of a body, from the vehicle's center (m), min 1 cm."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    free = first_free_body(model)
    points = [data.site_xpos[site] for site in _first_rotors(model)] or data.xpos[free:]
    return max(0.01, float(np.max(np.linalg.norm(points - data.xpos[free], axis=1))))


def thrust_scale(model: mujoco.MjModel) -> float:
    """Length of a thrust arrow per newton (m/N): about one vehicle radius in hover.

    Rounded to 1, 2 or 5 times a power of ten.
    """
    free = first_free_body(model)
    weight = float(model.body_subtreemass[free] * np.linalg.norm(model.opt.gravity))
    rotors = max(1, len(_first_rotors(model)))
    exact = vehicle_radius(model) * rotors / max(weight, 1e-9)
    decade = 10.0 ** floor(log10(exact))
    return min((digit * decade for digit in (1.0, 2.0, 5.0, 10.0)), key=lambda x: abs(x - exact))


def first_free_body(model: mujoco.MjModel) -> int:
    """The body that represents the vehicle: the first with a joint; 0 (world) without joints."""
    moving = np.flatnonzero(model.body_dofnum)
    return int(moving[0]) if len(moving) else 0


def rotate(quaternion: Floats, vector: Floats) -> Floats:
    """Vectors, shape (..., 3), rotated by unit quaternions (scalar first), shape (..., 4)."""
    axis = quaternion[..., 1:]
    cross = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + quaternion[..., :1] * cross + np.cross(axis, cross))


def _product(left: Floats, right: Floats) -> Floats:
    """Hamilton product of quaternions, shape (..., 4)."""
    scalar = left[..., :1] * right[..., :1]
    scalar = scalar - np.sum(left[..., 1:] * right[..., 1:], axis=-1, keepdims=True)
    vector = left[..., :1] * right[..., 1:] + right[..., :1] * left[..., 1:]
    return np.concatenate([scalar, vector + np.cross(left[..., 1:], right[..., 1:])], axis=-1)


def positions(columns: Columns, prefix: str = "") -> Floats:
    """A vehicle's position at every sample (m), shape (N, 3); 0 for axes without a column.

    Args:
        columns: Columns of the flight.
        prefix: Beginning of the names of a companion's columns.
    """
    zero = np.zeros_like(columns["time"])
    return np.stack([columns.get(f"{prefix}{axis}", zero) for axis in "xyz"], axis=1)


def prefixes(scenario: Scenario) -> list[str]:
    """The beginnings of the names of the columns of each vehicle, the first one's empty."""
    return ["", *(f"{each.name}_" for each in scenario.companion)]


def reference_positions(columns: Columns) -> Floats:
    """The reference position at every sample (m), shape (N, 3); 0 for axes without a column."""
    zero = np.zeros_like(columns["time"])
    return np.stack([columns.get(f"{axis}_ref", zero) for axis in "xyz"], axis=1)


def reference_path(assembly: Assembly, end: float, points: int) -> Floats:
    """The reference position (m) at ``points`` times from zero to ``end`` (s), shape (N, 3)."""
    reference, knots = assembly.reference, assembly.knots
    times = np.linspace(0.0, end, points).tolist()
    return np.array([position_reference(time, reference, knots)[:3] for time in times])


def _stack(columns: Columns, names: tuple[str, ...]) -> Floats:
    return np.stack([columns[name] for name in names], axis=1)
