"""Objects around a vehicle, a tool on it and a load below it, in MuJoCo's model.

They are added to the composed vehicle as `mujoco.MjSpec`, behind the vehicle's own coordinates.
Sensors with a memory of one reading, which is part of MuJoCo's state, measure the contact forces
and the cable's tension over each step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field

from tiltsim.models.cables import IMPEDANCE, Cable, add_cable, stretch
from tiltsim_controllers.laws.keys import (
    ZEROS,
    Angles3,
    Keys,
    Many,
    Name,
    NonNegative,
    Positive,
    Vector3,
    default,
    required,
)
from tiltsim_controllers.mathematics.attitude import quaternion_of_euler, rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values

if TYPE_CHECKING:
    from collections.abc import Sequence

    import mujoco

WALL_THICKNESS: Final = 0.1  # m
PLATE_THICKNESS: Final = 0.004  # m
COORDINATES: Final = {"fixed": 0, "hinged": 1, "free": 7}
"""Numbers in ``qpos`` of an object, by its joint."""

SLOWER: Final = 50.0  # time constant of friction over the contact's; see `_add_pairs`

FIRMER: Final = 500.0
"""MuJoCo's ``impratio``: it makes up for that, so that pressed things do not creep."""

CONTACT_READING: Final = 6
"""Numbers in the memory of a contact sensor: two of MuJoCo, the time and a force."""

FORCE: Final = 3  # where the reading begins in a memory

FIXED_COLOR: Final = (0.55, 0.60, 0.66, 1.0)
MOVING_COLOR: Final = (0.80, 0.52, 0.22, 1.0)
TOOL_COLOR: Final = (0.85, 0.20, 0.16, 1.0)
LOAD_COLOR: Final = (0.25, 0.42, 0.30, 1.0)


Mass = Annotated[float, Field(gt=1e-9, le=1e6)]
Softness = Annotated[float, Field(ge=1e-4, le=1.0)]
Direction = Annotated[Vector3, Field(examples=[[1.0, 0.0, 0.0]])]


class Body(Keys):
    """The keys of an object."""

    name: Name = required("its name, which begins the names of its columns", "wall")
    type: Literal["wall", "box", "sphere", "mesh"] = required(
        "a wall 0.1 m thick whose face looks along its -x, a box, a sphere, or the convex hull of "
        "a mesh",
        "wall",
    )
    position: Vector3 = required(
        "of the face's center or of the center, in the world [m]", [1.0, 0.0, 0.0]
    )
    attitude: Angles3 = default(
        ZEROS, "roll, pitch and yaw from the world's axes to its own [rad]", [0.0, 0.0, 0.5]
    )
    size: Annotated[Many[Positive], Field(min_length=1, max_length=3)] = required(
        "width along y and height along z of a wall, edges of a box, radius of a sphere, length "
        "of the unit of a mesh [m]",
        [2.0, 2.0],
    )
    file: str | None = default(
        None, "STL or OBJ file of a mesh, relative to the scenario's folder", "valve.stl"
    )
    joint: Literal["fixed", "hinged", "free"] = default("fixed", "whether it moves, and how")
    mass: Mass | None = default(None, "of one that moves; evenly spread [kg]", 1.0)
    friction: NonNegative = default(0.5, "coefficient of sliding friction [-]")
    softness: Softness = default(
        0.01,
        "time constant of its contacts, at least two time steps: twice as soft, half the force of "
        "an impact [s]",
    )
    hinge: Vector3 = default(ZEROS, "a point of the hinge, in its own axes [m]", [0.0, 0.5, 0.0])
    axis: Direction = default((0.0, 0.0, 1.0), "of the hinge, in its own axes [-]")
    damping: NonNegative = default(0.0, "of the hinge [N m s/rad]", 0.1)
    velocity: Vector3 = default(
        ZEROS, "of a free one at time zero, in the world [m/s]", [0.2, 0.0, 0.0]
    )
    floating: bool = default(False, "whether a free one has no weight, as on a cart or a boat")

    @property
    def quaternion(self) -> Values:
        """From its axes to the world, scalar first."""
        return tuple(quaternion_of_euler(self.attitude).tolist())

    @property
    def box(self) -> tuple[Triple, Triple]:
        """Center (m, its axes) and half edges (m) of a wall or box."""
        if self.type == "wall":
            width, height = self.size
            half = 0.5 * WALL_THICKNESS
            return (half, 0.0, 0.0), (half, 0.5 * width, 0.5 * height)
        x, y, z = self.size
        return (0.0, 0.0, 0.0), (0.5 * x, 0.5 * y, 0.5 * z)


class Tool(Keys):
    """The keys of a tool, which cannot move on the vehicle."""

    type: Literal["stick", "plate"] = default(
        "stick", "a stick with a round tip, or a disc at the end of one"
    )
    position: Vector3 = default(ZEROS, "where it begins, in body axes [m]", [0.05, 0.0, 0.0])
    direction: Direction = default((1.0, 0.0, 0.0), "toward its tip, body axes [-]")
    length: Positive = required("to its tip [m]", 0.3)
    radius: Positive = default(0.01, "of the stick or of the disc [m]")
    mass: Annotated[float, Field(ge=0.0, le=1e6)] = default(0.0, "evenly spread [kg]")

    @property
    def unit(self) -> Floats:
        """The unit vector from its beginning to its tip, body axes, shape (3,)."""
        direction = np.array(self.direction)
        return np.asarray(direction / np.linalg.norm(direction))

    @property
    def tip(self) -> Floats:
        """Its tip, m, body axes, shape (3,)."""
        return np.asarray(np.array(self.position) + self.length * self.unit)


class Load(Keys):
    """The keys of a load."""

    mass: Mass = required("of the load [kg]", 0.1)
    length: Positive = required("from the attachment to the center of the load [m]", 1.0)
    attachment: Vector3 = default(ZEROS, "in body axes [m]", [0.0, 0.0, -0.05])
    radius: Positive = default(0.03, "of the load, a ball [m]")
    rigid: bool = default(False, "whether a fixed rod replaces the cable")


@dataclass(frozen=True)
class Objects:
    """All that a scenario adds to a vehicle."""

    bodies: tuple[Body, ...] = ()
    tool: Tool | None = None
    load: Load | None = None
    cables: tuple[Cable, ...] = ()

    @cached_property
    def hangs(self) -> bool:
        """Whether a load hangs on a cable."""
        return self.load is not None and not self.load.rigid


def touchable(root: mujoco.MjSpec, *, ground: bool, number: int = -1) -> None:
    """Let the vehicle's collision shapes touch other things and maybe the ground, not each other.

    The number is its own among the vehicles that touch each other; -1 for one alone.
    """
    import mujoco

    root.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # a pyramid holds 29 % less diagonally
    root.option.impratio = 10.0  # friction ten times as stiff as the contact: it creeps less
    plane = root.geom("ground")
    if plane is not None and not ground:
        plane.contype = plane.conaffinity = 0
    for geom in root.body("vehicle").find_all("geom"):
        if (geom.name or "").endswith("collision"):
            geom.contype = 1 if number < 0 else 1 | 2 << number  # a bit for all after it
            if number > 0:
                geom.conaffinity = (2 << number) - 2  # the bits of all before it


def add_companion(spec: mujoco.MjSpec, name: str, companion: mujoco.MjSpec) -> None:
    """Add a further vehicle, whose name begins the names of its parts.

    Keyframes, which have only one of them, are removed; ground, lights and cameras of the other
    stay behind.
    """
    remove_keys(spec)
    remove_keys(companion)
    world = companion.worldbody
    for element in (*world.geoms, *world.lights, *world.cameras):
        companion.delete(element)
    for option in ("impratio", "tolerance"):  # else MuJoCo warns of the difference
        setattr(companion.option, option, getattr(spec.option, option))
    spec.attach(companion, prefix=f"{name}_", frame=spec.worldbody.add_frame())


def remove_keys(spec: mujoco.MjSpec) -> None:
    """Remove all keyframes."""
    for key in list(spec.keys):
        spec.delete(key)


def add_objects(spec: mujoco.MjSpec, objects: Objects, companions: Sequence[str] = ()) -> None:
    """Add objects, tool and load to a vehicle. Its keyframes, which lack them, are removed.

    Companions, by name, touch the objects as well.
    """
    remove_keys(spec)
    spec.option.impratio, spec.option.tolerance = FIRMER, 1e-12  # forces without noise
    for body in objects.bodies:
        _add_body(spec, body)
    if objects.tool is not None:
        _add_tool(spec, objects.tool)
    if objects.load is not None:
        _add_load(spec, objects.load)
    for vehicle in ("vehicle", *(f"{name}_vehicle" for name in companions)):
        for body in objects.bodies:
            _add_pairs(spec, vehicle, body)
            _add_force_sensor(spec, vehicle, body.name)
    if objects.load is not None and objects.hangs:
        stretch(spec, "cable", ("payload_attachment", "payload"), objects.load.length)
    for cable in objects.cables:
        add_cable(spec, cable)


def _add_body(spec: mujoco.MjSpec, body: Body) -> None:
    import mujoco

    own = spec.worldbody.add_body(
        name=f"object_{body.name}", pos=body.position, quat=body.quaternion
    )
    if body.joint == "free":
        own.add_freejoint(name=body.name)
        own.gravcomp = float(body.floating)
    elif body.joint == "hinged":
        hinge = mujoco.mjtJoint.mjJNT_HINGE
        own.add_joint(name=f"{body.name}_angle", type=hinge, pos=body.hinge, axis=body.axis)
        own.joints[0].damping = [body.damping, 0.0, 0.0]
    if body.floating or body.damping:  # passive forces, which a vehicle alone does not have
        spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
    shape: dict[str, Any] = {"type": mujoco.mjtGeom.mjGEOM_BOX}
    if body.type == "mesh":
        mesh = spec.add_mesh(name=f"object_{body.name}", file=body.file or "", scale=body.size * 3)
        shape = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": mesh.name}
    elif body.type == "sphere":
        shape = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": (*body.size, 0.0, 0.0)}
    else:
        shape["pos"], shape["size"] = body.box
    own.add_geom(
        name=f"object_{body.name}",
        **shape,
        mass=body.mass or 0.0,
        rgba=FIXED_COLOR if body.joint == "fixed" else MOVING_COLOR,
        **_touching(body.friction, body.softness),
        priority=1,  # its friction and softness count
    )


def _touching(friction: float, softness: float) -> dict[str, Any]:
    """Attributes of a shape that vehicles, the ground and other objects touch."""
    return {
        "group": 2,
        "condim": 3,
        "contype": 1,
        "conaffinity": 1,
        "friction": (friction, 0.005, 0.0001),
        "solref": (softness, 1.0),
        "solimp": IMPEDANCE,
    }


def _add_tool(spec: mujoco.MjSpec, tool: Tool) -> None:
    import mujoco

    own = spec.body("vehicle").add_body(name="tool")
    begin, tip, unit = np.array(tool.position), tool.tip, tool.unit
    touches = {"group": 2, "condim": 3, "contype": 1, "conaffinity": 0, "rgba": TOOL_COLOR}
    capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
    radius = (tool.radius, 0.0, 0.0)
    if tool.type == "stick":
        ends = (*begin, *(tip - tool.radius * unit))
        shape = {"type": capsule, "size": radius, "fromto": ends}
    else:
        rod = {"type": capsule, "size": (0.2 * tool.radius, 0.0, 0.0), "mass": 0.0}
        rod |= {"fromto": (*begin, *(tip - tool.radius * 0.2 * unit)), "rgba": TOOL_COLOR}
        own.add_geom(name="tool_rod", group=2, contype=0, conaffinity=0, **rod)
        ends = (*(tip - PLATE_THICKNESS * unit), *tip)
        shape = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": radius, "fromto": ends}
    own.add_geom(name="tool_collision", mass=tool.mass, **touches, **shape)


def _add_load(spec: mujoco.MjSpec, load: Load) -> None:
    import mujoco

    vehicle, attachment = spec.body("vehicle"), np.array(load.attachment)
    place = attachment - (0.0, 0.0, load.length)
    own = (vehicle if load.rigid else spec.worldbody).add_body(name="payload", pos=place)
    own.add_geom(
        name="payload_collision",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=(load.radius, 0.0, 0.0),
        mass=load.mass,
        rgba=LOAD_COLOR,
        **_touching(0.5, 0.005) | ({"conaffinity": 0} if load.rigid else {}),
    )
    if load.rigid:
        rod = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": (0.003, 0.0, 0.0), "mass": 0.0}
        rod |= {"fromto": (*attachment, *place), "rgba": TOOL_COLOR}
        vehicle.add_geom(name="payload_rod", group=2, contype=0, conaffinity=0, **rod)
        return
    own.add_freejoint(name="payload")
    own.add_site(name="payload")
    vehicle.add_site(name="payload_attachment", pos=attachment)


def _add_pairs(spec: mujoco.MjSpec, vehicle: str, body: Body) -> None:
    """Let every shape of a vehicle that can touch touch an object, with a slow friction.

    MuJoCo's cone of friction is convex: bodies that slide at a speed are pushed apart at friction
    times that speed, and chatter. A longer time constant of friction alone divides that.
    """
    for geom in spec.body(vehicle).find_all("geom"):
        if geom.name.endswith("collision"):
            spec.add_pair(
                geomname1=geom.name,
                geomname2=f"object_{body.name}",
                condim=3,
                friction=(body.friction, body.friction, 0.005, 0.0001, 0.0001),
                solref=(body.softness, 1.0),
                solreffriction=(SLOWER * body.softness, 1.0),
                solimp=IMPEDANCE,
            )


def _add_force_sensor(spec: mujoco.MjSpec, vehicle: str, name: str) -> None:
    """Measure the force (N, world) of a vehicle with all that it carries on an object."""
    import mujoco

    sensor = spec.add_sensor(
        name=f"{vehicle.removesuffix('vehicle')}force_{name}",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_XBODY,  # with the bodies that it carries
        objname=vehicle,
        reftype=mujoco.mjtObj.mjOBJ_BODY,
        refname=f"object_{name}",
        nsample=1,
    )
    force, net = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3  # the sum of all contacts
    sensor.intprm = [force, net, 1]


def distance_ahead(body: Body, point: Floats, direction: Floats) -> float | None:
    """Distance (m) from a point along a unit vector to an object at its initial place, or None.

    Point and vector are in the world, shape (3,); None is for an object that is not ahead.
    """
    turn = rotation_of_quaternion(np.array(body.quaternion))
    begin, along = turn.T @ (point - body.position), turn.T @ direction
    if body.type == "sphere":
        radius, across = body.size[0], begin - (begin @ along) * along
        beside = radius**2 - across @ across
        distance = -begin @ along - np.sqrt(beside) if beside >= 0.0 else 0.0
        return float(distance) if distance > 0.0 else None
    center, half = (np.array(part) for part in body.box)
    with np.errstate(divide="ignore", invalid="ignore"):
        faces = np.sort([(center - half - begin) / along, (center + half - begin) / along], axis=0)
    endless = np.array([[-np.inf], [np.inf]])  # beside a face that it does not approach
    within = np.where(np.abs(begin - center) <= half, endless, -endless)
    faces = np.where(along == 0.0, within, faces)
    entry, leaving = float(faces[0].max()), float(faces[1].min())
    return entry if 0.0 < entry <= leaving else None
