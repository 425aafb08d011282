"""Compiling a tiltrotor's or quadrotor's MuJoCo model from ``mjcf/`` and a `RotorcraftSpec`.

The files hold chapter 3's vehicle. `compile_model` replaces its parameters by another vehicle's,
scales the geometry with the arms, and compiles.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import mujoco
import numpy as np

from tiltsim.models import mjcf_editing
from tiltsim.models.cross import as_multirotor
from tiltsim.models.objects import Objects, add_companion, add_objects, touchable
from tiltsim.models.parts import (
    SERVO_ARMATURE,
    ExtraActuators,
    Ground,
    ModelSpec,
    Pod,
    RotorLimits,
    Visuals,
)
from tiltsim.models.rotor_table import Multirotor
from tiltsim.models.user_vehicle import UserVehicle
from tiltsim.resources import shipped_folder
from tiltsim.system.files import one_thread_at_a_time
from tiltsim.system.hooks import mujoco_hooks
from tiltsim_controllers.vehicle.body import ROTORS
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, Vehicle

START_SPEED: Final = 300.0  # rotor speed (rad/s) of the keyframe ``start``
LIMITED: Final = mujoco.mjtLimited.mjLIMITED_TRUE


@dataclass(frozen=True)
class RotorcraftSpec(ModelSpec):
    """Specification of a rotorcraft's model."""

    model: str  # tiltrotor, quadrotor (no hinges; pods are part of the body) or multirotor (a file)
    vehicle: Vehicle | Multirotor  # physical parameters, the pods' included
    _: KW_ONLY
    pod: Pod = field(default=Pod())  # ignored for a quadrotor
    rotor_limits: RotorLimits = field(default=RotorLimits())
    extra_actuators: tuple[ExtraActuators, ...] = ()  # of layers, after the law's states
    ground: Ground | None = None  # None disables contacts
    objects: Objects | None = None  # None for a vehicle alone
    companions: tuple[tuple[str, RotorcraftSpec], ...] = ()  # in the same world, by name
    number: int = -1  # from 0, among vehicles that touch each other; -1 for one alone
    user_vehicle: UserVehicle | None = None
    """A user's file in place of the shipped one; its geoms may have mass and are always kept."""

    @property
    def tilts(self) -> int:
        """Number of tilt hinges."""
        if isinstance(self.vehicle, Multirotor):
            return self.vehicle.tilts
        return len(ROTORS) if self.model == "tiltrotor" else 0

    @property
    def has_stops(self) -> bool:
        """Whether the hinges have stops."""
        return self.tilts > 0 and self.tilt_servo.max_angle is not None

    @property
    def as_read(self) -> _AsRead:
        """The vehicle without the parts of a flight."""
        return _AsRead(
            self.model,
            self.user_vehicle,
            self.vehicle.arm_length if isinstance(self.vehicle, Vehicle) else 0.0,
            self.pod,
        )

    @property
    def touches(self) -> bool:
        """Whether there is something to touch."""
        return self.ground is not None or self.objects is not None or self.number >= 0

    @property
    def wrench(self) -> bool:
        """Whether some layer acts on the body."""
        return any(extra.wrench for extra in self.extra_actuators)


@one_thread_at_a_time
def compile_model(spec: RotorcraftSpec, *, visuals: Visuals = True) -> mujoco.MjModel:
    """Compile the MuJoCo model of a rotorcraft.

    Mass and inertia of the compiled model are the vehicle's at any tilt: the pods' are
    subtracted from the body's. There are no contacts but with the ground and with objects.

    Args:
        spec: The specification of the model.
        visuals: Whether to keep parts that are only drawn or measured: geoms, cameras and others.
            They do not affect the physics, but updating them takes a third of a step. Or a
            function that adds further ones to the model before it is compiled.

    Returns:
        With the keyframes ``hover`` (in equilibrium) and ``start`` (rotors at 300 rad/s).

    Raises:
        ValueError: If the pods are too heavy for the vehicle.
    """
    vehicles = [spec, *(companion for _, companion in spec.companions)]
    # One that is kept complete may have springs and dampers, which no bare model has.
    whole = bool(visuals) or any(_bare_of(_structure(one)) is None for one in vehicles)
    world, *others = (_compose(_structure(one), whole).copy() for one in vehicles)
    for own, one in zip((world, *others), vehicles, strict=True):
        _set_parameters(own, one)
    for (name, one), companion in zip(spec.companions, others, strict=True):
        if one.objects is not None:
            add_objects(companion, one.objects)
        add_companion(world, name, companion)
    if spec.objects is not None:
        add_objects(world, spec.objects, [name for name, _ in spec.companions])
    if callable(visuals):
        visuals(world)
    with mujoco_hooks():
        return world.compile()


def _structure(spec: RotorcraftSpec) -> RotorcraftSpec:
    """Equal for vehicles whose compositions differ in numbers only; see `_set_parameters`."""
    if spec.user_vehicle is not None:
        vehicle: Vehicle | Multirotor = spec.user_vehicle.vehicle
    else:
        arm_length = cast(Vehicle, spec.vehicle).arm_length
        vehicle = PRESETS["ar_drone_2"]._replace(arm_length=arm_length)
    return replace(spec, vehicle=vehicle, userdata_size=0, companions=())


def _set_parameters(own: mujoco.MjSpec, spec: RotorcraftSpec) -> None:
    """Give a composed vehicle its mass, inertia, coefficients, gravity and room for user data."""
    vehicle, user = spec.vehicle, spec.user_vehicle
    own.option.gravity = (0.0, 0.0, -vehicle.gravity)
    own.nuserdata = spec.userdata_size
    if user is not None:
        user.set_inertia(own, vehicle)
    elif isinstance(vehicle, Vehicle):
        body = own.body("vehicle")
        body.mass, body.inertia = _body_inertia(spec, vehicle)
    if isinstance(vehicle, Vehicle):
        _set_keyframes(own, vehicle, spec.tilts)
    for i, rotor in enumerate(as_multirotor(vehicle, tilting=False).rotors, start=1):
        gear = (0.0, 0.0, rotor.thrust, 0.0, 0.0, -rotor.spin * rotor.drag)
        own.actuator(f"thrust_{i}").gear = gear


class _AsRead(NamedTuple):
    """All that decides how a file is read."""

    model: str
    user_vehicle: UserVehicle | None
    arm_length: float
    pod: Pod


@lru_cache(maxsize=64)  # dm_control takes a hundred times longer than MuJoCo's compiler
def _complete(read: _AsRead) -> mujoco.MjSpec:
    """A shipped vehicle with these arms and pods, or a user's as it is."""
    own = read.user_vehicle
    shipped = shipped_folder("mjcf") / f"{read.model}.xml"
    root = mjcf_editing.parse_mjcf(shipped if own is None else Path(own.path))
    if own is None:
        _scale_lengths(root, read.arm_length)
        if read.model == "tiltrotor":
            _set_pods(root, read.pod)
    return mjcf_editing.spec_of(root)


@lru_cache(maxsize=64)
def _bare(read: _AsRead, contacts: bool, wrench: bool) -> mujoco.MjSpec | None:
    """It without visuals; None where they act."""
    complete = _complete(read)
    if read.user_vehicle is not None and read.model != "multirotor":
        return None
    bare = complete.copy()
    mjcf_editing.remove_visuals(bare, contacts=contacts, kept=["imu"] * wrench)
    return bare if read.user_vehicle is None or _moves_alike(complete, bare) else None


def _bare_of(spec: RotorcraftSpec) -> mujoco.MjSpec | None:
    return _bare(spec.as_read, spec.touches, spec.wrench)


@lru_cache(maxsize=64)
def _compose(spec: RotorcraftSpec, whole: bool) -> mujoco.MjSpec:
    """The vehicle with all parts of a flight, complete or without visuals."""
    vehicle, servo, user_vehicle = spec.vehicle, spec.tilt_servo, spec.user_vehicle
    bare = None if whole else _bare_of(spec)
    root = (_complete(spec.as_read) if bare is None else bare).copy()
    mjcf_editing.set_integration(root, spec)
    constraint = spec.touches or spec.has_stops
    mjcf_editing.set_flags(root, contact=spec.touches, constraint=constraint)

    hinges = [f"tilt_{i}" for i in range(1, spec.tilts + 1)]
    if isinstance(vehicle, Vehicle):
        _set_keyframes(root, vehicle, len(hinges))
    _limit_rotors(root, spec)
    if hinges:
        inertias = (spec.pod.inertia + SERVO_ARMATURE,) * len(hinges)
        if user_vehicle is not None:
            inertias = user_vehicle.hinge_inertias
        mjcf_editing.set_servos(root, hinges, servo, inertias)
    mjcf_editing.add_states(root, "law", spec.law_states)
    center = _center_site(root, spec)
    for index, extra in enumerate(spec.extra_actuators, start=1):
        mjcf_editing.add_states(root, f"layer_{index}_state", extra.states)
        if extra.begins_with_rotor_speeds:
            _limit_speeds(root, f"layer_{index}_state", spec)
        mjcf_editing.add_memories(root, f"layer_{index}_memory", extra.memories)
        if extra.wrench:
            mjcf_editing.add_wrench(root, f"layer_{index}", center)
        mjcf_editing.add_hinge_torques(root, f"layer_{index}", extra.hinge_torques)
    if spec.touches:
        touchable(root, ground=spec.ground is not None, number=spec.number)
    if spec.ground is not None:
        _set_ground(root, spec.ground)
    return root


def _center_site(root: mujoco.MjSpec, spec: RotorcraftSpec) -> str:
    """The name of a site in the center of mass, along the body's axes, added if necessary."""
    if spec.user_vehicle is None or isinstance(spec.vehicle, Vehicle):
        return "imu"
    name = "layer_center"
    if spec.wrench:
        root.body("vehicle").add_site(name=name, pos=spec.user_vehicle.center)
    return name


def _moves_alike(complete: mujoco.MjSpec, bare: mujoco.MjSpec) -> bool:
    """Whether drawn and measured parts give a user's vehicle no mass, spring or damper."""
    try:
        with mujoco_hooks():
            models = complete.copy().compile(), bare.copy().compile()
    except ValueError:  # a body is left without mass
        return False
    with_visuals, without = models
    medium = np.array([with_visuals.opt.density, with_visuals.opt.viscosity])  # drags shapes
    passive = (with_visuals.jnt_stiffness, with_visuals.dof_damping, medium)
    return not any(part.any() for part in passive) and all(
        (getattr(with_visuals, name) == getattr(without, name)).all()
        for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature")
    )


def _scale_lengths(root: Any, arm_length: float) -> None:
    """Scale the vehicle's positions and shapes so that its arms have this length (m)."""
    ratio = arm_length / root.find("body", "pod_1").pos[0]
    defaults = root.find("default", "vehicle")  # None where the elements have taken them
    pending = [root.find("body", "vehicle"), *([] if defaults is None else [defaults])]
    while pending:
        element = pending.pop()
        pending.extend(element.all_children())
        for name in ("pos", "size", "fromto"):
            length = getattr(element, name, None)
            if length is not None:
                setattr(element, name, length * ratio)


def _limit_rotors(root: mujoco.MjSpec, spec: RotorcraftSpec) -> None:
    thrust_range = spec.rotor_limits.thrust_range
    if thrust_range is not None:
        for i in range(1, len(spec.vehicle.spins) + 1):
            thrust = root.actuator(f"thrust_{i}")
            thrust.ctrlrange, thrust.ctrllimited = thrust_range, LIMITED
            thrust.inheritrange = 0.0
    _limit_speeds(root, "rotor_speed", spec)


def _limit_speeds(root: mujoco.MjSpec, name: str, spec: RotorcraftSpec) -> None:
    """Keep the activations ``name_1``, ``name_2``, ... within the limits of the rotors' speeds."""
    for i, spin in enumerate(spec.vehicle.spins, start=1):
        speed_range = spec.rotor_limits.speed_range(spin)
        if speed_range is not None:
            rotor = root.actuator(f"{name}_{i}")
            rotor.actrange, rotor.actlimited = speed_range, LIMITED


def _set_pods(root: Any, pod: Pod) -> None:
    for i in ROTORS:
        root.find("joint", f"tilt_{i}").armature = SERVO_ARMATURE
        inertial = root.find("body", f"pod_{i}").inertial
        inertial.mass = pod.mass
        inertial.diaginertia = [pod.inertia] * 3


def _body_inertia(spec: RotorcraftSpec, vehicle: Vehicle) -> tuple[float, list[float]]:
    """Mass and principal moments of inertia of the body: the vehicle's less its hinged pods'."""
    pod = spec.pod if spec.tilts else None
    mass = vehicle.mass
    moments = [vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz]
    if pod is not None:
        mass -= 4.0 * pod.mass
        of_two_opposite_pods = 2.0 * pod.mass * vehicle.arm_length**2  # point masses
        for axis, pairs in enumerate((1.0, 1.0, 2.0)):  # the pairs that lie off this axis
            moments[axis] -= 4.0 * pod.inertia + pairs * of_two_opposite_pods
    if mass <= 0.0 or min(moments) <= 0.0 or 2.0 * max(moments) > sum(moments):
        raise ValueError(
            f"vehicle.mass = {vehicle.mass!r}, vehicle.inertia = {list(vehicle[1:4])}, pods {pod}:"
            f" the body without its pods would have {mass:.6g} kg and the moments of inertia"
            f" {', '.join(f'{moment:.6g}' for moment in moments)} kg m^2; all must be above 0, and"
            " none larger than the sum of the other two"
        )
    return mass, moments


def _set_ground(root: mujoco.MjSpec, ground: Ground) -> None:
    """Let the vehicle's collision shapes touch the ground."""
    plane = root.geom("ground")
    plane.pos = (0.0, 0.0, ground.height)
    plane.friction = (ground.friction, 0.005, 0.0001)
    plane.priority = 1  # its friction counts, not the larger of the two
    plane.conaffinity = 1


def _set_keyframes(root: mujoco.MjSpec, vehicle: Vehicle, hinges: int) -> None:
    """Let the rotors of an upright, untilted vehicle turn at the speeds of the keyframes."""
    for name, speed in (("hover", vehicle.hover_rotor_speed), ("start", START_SPEED)):
        key = root.key(name)
        if key is not None:
            act, ctrl = list(key.act), list(key.ctrl) or [0.0] * hinges
            key.act = [*(spin * speed for spin in SPIN), *act[4:]]
            # thrusts, then rates of the rotor speeds
            key.ctrl = [*ctrl[:hinges], *[speed**2] * 4, *[0.0] * 4, *ctrl[hinges + 8 :]]
