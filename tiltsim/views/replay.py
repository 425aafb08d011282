"""Replaying a flight on a MuJoCo model: visuals, and the pose of every body at every sample.

Independent of the vehicle. Free joints take the recorded position and attitude, every other joint
the column of its name, where ``tilt`` is ``alpha``; a joint without a column keeps the model's
default. Sky, floor, light, arms and rotor discs that a user's MJCF file lacks are added for
pictures only.
"""

import re
from collections.abc import Iterator, Mapping
from math import cos, floor, log10, radians, sin
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.flight import vehicle_assemblies
from tiltsim.plants.mujoco_plant import build_model
from tiltsim.resources import shipped_folder
from tiltsim.scenario.scenario import Scenario
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
            qpos[:, address : address + 3] = positions(columns, of)
            if f"{of}roll" not in columns:  # a load, of which the attitude does not count
                continue
            angles = np.stack([columns[f"{of}{angle}"] for angle in ("roll", "pitch", "yaw")])
            qpos[:, address + 3 : address + 7] = quaternion_of_euler(angles).T
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
        loose = [not table.holds(at) for at in time.tolist()]
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


def positions(columns: Columns, prefix: str = "", suffix: str = "") -> Floats:
    """A position at every sample (m), shape (N, 3); 0 for axes without a column.

    Args:
        columns: Columns of the flight.
        prefix: Beginning of the names of a companion's columns.
        suffix: End of the names, such as ``_ref`` for the reference.
    """
    zero = np.zeros_like(columns["time"])
    return np.stack([columns.get(f"{prefix}{axis}{suffix}", zero) for axis in "xyz"], axis=1)


def by_prefix(assembly: Assembly) -> dict[str, Assembly]:
    """The assembly of each vehicle by the beginning of the names of its columns."""
    (_, first), *others = vehicle_assemblies(assembly).items()
    return {"": first, **{f"{name}_": own for name, own in others}}


def reference_path(assembly: Assembly, end: float, points: int) -> Floats:
    """The reference position (m) at ``points`` times from zero to ``end`` (s), shape (N, 3)."""
    reference, knots = assembly.reference, assembly.knots
    times = np.linspace(0.0, end, points).tolist()
    return np.array([position_reference(time, reference, knots)[:3] for time in times])


DISC_SHARE: Final = 0.45  # of the least distance between rotors: their discs do not touch
MAX_DISC: Final = 0.6  # of a rotor's distance from the body, so that the arms can be seen
ARM_SHARE: Final = 0.03  # of the distance of the farthest rotor
DEPTH: Final = 3.0  # m below the origin, of a floor that the file lacks
CLOCKWISE: Final = (0.05, 0.55, 0.50, 0.45)
COUNTERCLOCKWISE: Final = (0.85, 0.38, 0.10, 0.45)
CARBON: Final = (0.18, 0.19, 0.21, 1.0)
PLANE: Final = mujoco.mjtGeom.mjGEOM_PLANE
CYLINDER: Final = mujoco.mjtGeom.mjGEOM_CYLINDER
CAPSULE: Final = mujoco.mjtGeom.mjGEOM_CAPSULE
SKYBOX: Final = mujoco.mjtTexture.mjTEXTURE_SKYBOX


def dress(spec: mujoco.MjSpec) -> None:
    """Add the visuals that the files of the vehicles in a model lack."""
    model = spec.copy().compile()
    scene = mujoco.MjSpec.from_file(str(shipped_folder("mjcf") / "scene.xml"))
    if SKYBOX not in [texture.type for texture in spec.textures]:
        _copy_texture(spec, scene.texture("sky"))
        spec.visual.headlight.ambient = scene.visual.headlight.ambient
    if not model.nlight:
        light = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        look = {"diffuse": (0.45, 0.45, 0.45), "dir": (0.1, 0.2, -1.0)}
        spec.worldbody.add_light(type=light, pos=(0.0, 0.0, 10.0), **look)
    planes = [geom for geom in spec.worldbody.geoms if geom.type == PLANE]
    if not planes:
        place = (0.0, 0.0, -DEPTH)
        planes = [spec.worldbody.add_geom(type=PLANE, size=(0.0, 0.0, 1.0), pos=place)]
        planes[0].contype = planes[0].conaffinity = 0
    bare = [plane for plane in planes if not plane.material and not plane.size[:2].all()]
    if bare:
        _copy_texture(spec, scene.texture("grid"))
        grid = spec.add_material(name="tiltsim_grid", texuniform=True, texrepeat=(1.0, 1.0))
        grid.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiltsim_grid"
        for plane in bare:
            plane.material = grid.name
    for body, shape in _missing_parts(model):
        mass = {"mass": 0.0, "contype": 0, "conaffinity": 0, "group": 2}
        spec.body(model.body(body).name).add_geom(**shape, **mass)


def _copy_texture(spec: mujoco.MjSpec, texture: Any) -> None:
    names = ("type", "builtin", "mark", "rgb1", "rgb2", "markrgb", "width", "height")
    look = {name: getattr(texture, name) for name in names}
    spec.add_texture(name=f"tiltsim_{texture.name}", **look)


def _missing_parts(model: mujoco.MjModel) -> Iterator[tuple[int, dict[str, Any]]]:
    """Bodies with the shapes of the arms and rotor discs that nothing in the model stands for."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for body in range(model.nbody):
        name = model.body(body).name
        if name == "vehicle" or name.endswith("_vehicle"):
            yield from _missing_on(model, data, body, name.removesuffix("vehicle"))


def _missing_on(
    model: mujoco.MjModel, data: mujoco.MjData, vehicle: int, prefix: str
) -> Iterator[tuple[int, dict[str, Any]]]:
    """See `_missing_parts`: on one vehicle, the names of whose parts begin with a prefix."""
    name = f"{prefix}rotor_"
    sites = [s for s in range(model.nsite) if model.site(s).name.startswith(name)]
    places = data.site_xpos[sites]
    turned = data.xmat[vehicle].reshape(3, 3)
    hubs = (places - data.xpos[vehicle]) @ turned  # along the body's axes
    lengths = np.linalg.norm(hubs, axis=1)
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    least = float(apart[apart > 1e-6].min(initial=2.0 * lengths.max()))
    visible = np.flatnonzero((model.geom_group <= 2) & (model.geom_bodyid > 0))
    centers, radii = data.geom_xpos[visible], model.geom_rbound[visible]
    for site, place, hub, length in zip(sites, places, hubs, lengths, strict=True):
        away = np.linalg.norm(centers - place, axis=1)
        radius = min(DISC_SHARE * least, MAX_DISC * float(length) or np.inf)
        if not ((radii >= 0.5 * radius) & (away < 0.5 * radius)).any():
            number = model.site(site).name.removeprefix(name)
            drag = float(model.actuator(f"{prefix}thrust_{number}").gear[5])
            look = {"rgba": COUNTERCLOCKWISE if drag < 0.0 else CLOCKWISE}
            look |= {"pos": model.site_pos[site], "quat": model.site_quat[site]}
            disc = {"type": CYLINDER, "size": (radius, 0.02 * radius, 0.0), **look}
            yield int(model.site_bodyid[site]), disc
        middle = data.xpos[vehicle] + turned @ (0.6 * hub)
        axes = data.geom_xmat[visible].reshape(-1, 3, 3)
        local = np.einsum("gi,gij->gj", middle - centers, axes) - model.geom_aabb[visible, :3]
        covered = (np.abs(local) <= model.geom_aabb[visible, 3:]).all(axis=1).any()
        if length > 2.0 * ARM_SHARE * lengths.max() and not covered:
            size, ends = (ARM_SHARE * float(lengths.max()), 0.0, 0.0), (0.0, 0.0, 0.0, *hub)
            yield vehicle, {"type": CAPSULE, "size": size, "fromto": ends, "rgba": CARBON}
