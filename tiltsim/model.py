"""Composing a vehicle's MuJoCo model from the files in ``mjcf/`` and a `Vehicle`'s parameters.

The files hold chapter 3's vehicle. `compile_model` puts another vehicle's numbers in their place,
scales what is drawn with the arms, and compiles. The records for it (`TiltServo`, `Pod`,
`RotorLimits`, `Ground`) hold the defaults; the tables of a scenario check what is put into them.
"""

from __future__ import annotations

import warnings
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from controllers.vehicle import SPIN, Vehicle
from tiltsim.library import shipped_folder

if TYPE_CHECKING:
    import mujoco

    from tiltsim.loop import ExtraActuators
    from tiltsim.own_vehicle import OwnVehicle

MODELS: Final = ("tiltrotor", "quadrotor")
INTEGRATORS: Final = ("Euler", "RK4", "implicit", "implicitfast")
ROTORS: Final = (1, 2, 3, 4)

SERVO_ARMATURE: Final = 1e-6
"""Inertia (kg m^2) of a tilt servo behind its gear, as felt at the hinge.

It loads the servo but, other than the pod's own inertia, turns no body in reaction.
"""

START_SPEED: Final = 300.0
"""Rotor speed (rad/s) of the keyframe ``start``."""


def _require_positive(name: str, value: float, unit: str) -> None:
    if not (isfinite(value) and value > 0.0):
        raise ValueError(f"{name} = {value!r}: must be finite and above 0 {unit}")


def _require_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ValueError(f"{name} = {value!r}: unknown; choose {', '.join(choices)}")


@dataclass(frozen=True)
class TiltServo:
    """The position servo that tilts a pod: ``alpha'' = w^2 (command - alpha) - 2 zeta w alpha'``.

    This holds exactly on a body that does not move; on a free one, which gives way to the pod's
    reaction, the servo is slightly faster.

    Attributes
    ----------
    natural_frequency : float
        ``w``, rad/s.
    damping_ratio : float
        ``zeta``, dimensionless.
    max_angle : float or None
        Largest tilt angle either way, rad: the command is clipped there and the hinge has a stop.
        None leaves the pod free to turn around.
    """

    natural_frequency: float = 300.0
    damping_ratio: float = 1.0
    max_angle: float | None = None


@dataclass(frozen=True)
class Pod:
    """The part of a rotor that tilts; its centre of mass lies on the hinge.

    The defaults are as good as nothing, for the thesis gives its pods no inertia: a pod that
    turns by 1 rad then turns chapter 3's body by less than 5e-11 rad. MuJoCo refuses moving
    bodies below 1e-15; the armature keeps the hinge's equation well conditioned.

    Attributes
    ----------
    mass : float
        kg.
    inertia : float
        About any axis through the pod's centre of mass, kg m^2; the same for all axes, so that
        the vehicle's inertia does not depend on the tilt.
    """

    mass: float = 1e-9
    inertia: float = 1e-13


@dataclass(frozen=True)
class RotorLimits:
    """Limits on a rotor's speed, held by MuJoCo at the end of each step.

    Within a step the stages of RK4 may see speeds beyond a limit by what one step adds. The thrust
    stays within the limits there, too.

    Attributes
    ----------
    min_speed : float or None
        Smallest ``|varpi|``, rad/s: the rotor cannot reverse. None lets it stop and reverse.
    max_speed : float or None
        Largest ``|varpi|``, rad/s, in either sense where the rotor may reverse. None is unlimited.
    thrust_factors : tuple of float
        The least and the greatest factor on the thrust that the flight brings: faults.
    """

    min_speed: float | None = None
    max_speed: float | None = None
    thrust_factors: tuple[float, float] = (1.0, 1.0)

    def speed_range(self, spin: float) -> tuple[float, float] | None:
        """The range (rad/s) of the signed speed of a rotor with this spin; None if unlimited."""
        if self.min_speed is None and self.max_speed is None:
            return None
        upper = inf if self.max_speed is None else self.max_speed
        lower = -upper if self.min_speed is None else self.min_speed
        return (lower, upper) if spin > 0.0 else (-upper, -lower)

    @property
    def thrust_range(self) -> tuple[float, float] | None:
        """The range ((rad/s)^2) of the controls of the thrusts; None if unlimited."""
        along_spin = self.speed_range(1.0)
        if along_spin is None:
            return None
        lower, upper = along_spin
        least, greatest = self.thrust_factors
        return lower * abs(lower) * (least if lower > 0.0 else greatest), greatest * upper * upper


@dataclass(frozen=True)
class Ground:
    """Level ground that the vehicle can stand on.

    Attributes
    ----------
    height : float
        m, world.
    friction : float
        Coefficient of sliding friction.
    """

    height: float = 0.0
    friction: float = 0.8


def compile_model(
    model: str,
    vehicle: Vehicle,
    *,
    timestep: float = 1e-3,
    integrator: str = "RK4",
    userdata_size: int = 0,
    tilt_servo: TiltServo = TiltServo(),
    pod: Pod = Pod(),
    rotor_limits: RotorLimits = RotorLimits(),
    law_states: int = 0,
    extra_actuators: tuple[ExtraActuators, ...] = (),
    ground: Ground | None = None,
    visuals: bool = True,
    own: OwnVehicle | None = None,
) -> mujoco.MjModel:
    """Compile the MuJoCo model of a vehicle.

    Mass and inertia of the compiled model are the vehicle's at any tilt: what the pods weigh is
    taken from the body. Nothing collides but, if there is ground, the vehicle with it.

    Parameters
    ----------
    model : str
        ``tiltrotor`` or ``quadrotor`` (without hinges; its pods are part of the body).
    vehicle : Vehicle
        Physical parameters, the pods' included.
    timestep : float, default=1e-3
        Physics time step, s.
    integrator : str, default="RK4"
        MuJoCo's name: ``Euler``, ``RK4``, ``implicit`` or ``implicitfast``.
    userdata_size : int, default=0
        Numbers of user data in the simulation's state.
    tilt_servo : TiltServo, optional
        The tilt servos. Without effect on a quadrotor.
    pod : Pod, optional
        The pods' own mass and inertia. Without effect on a quadrotor.
    rotor_limits : RotorLimits, optional
        Limits on the rotor speeds.
    law_states : int, default=0
        Number of states of a control law of its own: integrators ``law_1``, ``law_2``, ... after
        all other actuators, which act on nothing; ctrl is the state's rate.
    extra_actuators : tuple, optional
        What layers around the law append after these; see `tiltsim.loop.ExtraActuators`.
    ground : Ground, optional
        Ground to take off from and land on; without it there are no contacts to look for.
    visuals : bool, default=True
        Whether there is anything to see or to measure: geoms, cameras, lights and sensors. They do
        not touch the physics, but keeping them up to date takes a third of a step.
    own : OwnVehicle, optional
        A user's own file in place of the shipped one, with its own arms and pods; its geoms may
        have mass and always stay.

    Returns
    -------
    mujoco.MjModel
        With the keyframes ``hover`` (in equilibrium) and ``start`` (rotors at 300 rad/s).

    Raises
    ------
    ValueError
        If an argument is out of range, or the pods are too heavy for the vehicle.
    """
    import mujoco

    _require_choice("vehicle.model", model, MODELS)
    _require_choice("simulation.integrator", integrator, INTEGRATORS)
    _require_positive("simulation.timestep", timestep, "s")
    for name, size in (("userdata_size", userdata_size), ("law_states", law_states)):
        if size < 0:
            raise ValueError(f"{name} = {size!r}: must be at least 0")
    for name, value in vehicle._asdict().items():
        _require_positive(f"vehicle.{name}", value, "(SI)")

    description = (
        *(timestep, integrator, userdata_size),
        *(tilt_servo, pod, rotor_limits, law_states, extra_actuators, ground),
    )
    likeness = (model, vehicle.arm_length, *description, visuals)
    if own is None and likeness in _compiled:
        return _with_parameters(*_compiled[likeness], vehicle, pod)
    whole, bare, assets = _compose(model, vehicle, *description, own)
    compiled = mujoco.MjModel.from_xml_string(whole if visuals else bare, assets)
    if own is None and (model != "tiltrotor" or tilt_servo.max_angle is None):
        if len(_compiled) >= LIKENESSES:
            _compiled.clear()
        _compiled[likeness] = copy(compiled), mujoco.MjData(compiled)
    return compiled


LIKENESSES: Final = 32
"""How many models are kept to make others of them."""

_compiled: dict[tuple[Any, ...], tuple[mujoco.MjModel, mujoco.MjData]] = {}
"""Compiled models, with data to work in, by all that `_with_parameters` cannot change.

Models with stops are not among them: MuJoCo's solver scales with a mean inertia that only its
compiler computes.
"""


def _with_parameters(
    compiled: mujoco.MjModel, data: mujoco.MjData, vehicle: Vehicle, pod: Pod
) -> mujoco.MjModel:
    """A copy of a model with another vehicle's mass, inertia, coefficients and gravity.

    Bit for bit what compiling gives, a hundred times faster, but for the mean mass and inertia in
    ``stat``, which nothing here reads.
    """
    import mujoco

    model = copy(compiled)
    body = model.body("vehicle").id
    model.body_mass[body], model.body_inertia[body] = _body_inertia(
        vehicle, pod if model.njnt > 1 else None
    )
    for i, spin in zip(ROTORS, SPIN, strict=True):
        model.actuator(f"thrust_{i}").gear[:] = _thrust_gear(vehicle, spin)
    model.opt.gravity[:] = (0.0, 0.0, -vehicle.gravity)
    hover, speed = model.key("hover").id, vehicle.hover_rotor_speed
    model.key_act[hover, :4] = [spin * speed for spin in SPIN]
    thrusts = model.actuator("thrust_1").id
    model.key_ctrl[hover, thrusts : thrusts + 4] = speed**2
    mujoco.mj_setConst(model, data)
    return model


@lru_cache(maxsize=64)  # dm_control takes several times longer than MuJoCo's compiler
def _compose(
    model: str,
    vehicle: Vehicle,
    timestep: float,
    integrator: str,
    userdata_size: int,
    tilt_servo: TiltServo,
    pod: Pod,
    rotor_limits: RotorLimits,
    law_states: int,
    extra_actuators: tuple[ExtraActuators, ...],
    ground: Ground | None,
    own: OwnVehicle | None,
) -> tuple[str, str, dict[str, bytes]]:
    """The vehicle's complete MJCF, the same without what is only drawn, and the files they name.

    The arguments are `compile_model`'s, found valid. A flight is flown on the one and shown on the
    other, so both are made at once.
    """
    root = parse_mjcf(shipped_folder("mjcf") / f"{model}.xml" if own is None else Path(own.path))
    tilting = model == "tiltrotor"
    stops = tilting and tilt_servo.max_angle is not None

    root.option.timestep = timestep
    root.option.integrator = integrator
    root.option.gravity = (0.0, 0.0, -vehicle.gravity)
    root.option.flag.contact = "disable" if ground is None else "enable"
    root.option.flag.constraint = "disable" if ground is None and not stops else "enable"
    root.size.nuserdata = userdata_size

    if own is None:
        _scale_lengths(root, vehicle.arm_length)
        _set_inertia(root, vehicle, pod if tilting else None)
    else:
        own.set_inertia(root, vehicle)
    _set_rotors(root, vehicle, rotor_limits)
    if tilting and own is None:
        _set_servos(root, tilt_servo, pod)
    elif tilting and own is not None:
        own.set_servos(root, tilt_servo)
    for name, speed in (("hover", vehicle.hover_rotor_speed), ("start", START_SPEED)):
        key = root.find("key", name)
        if key is not None:
            _set_keyframe(key, speed)
    add_law_states(root, law_states)
    for index, extra in enumerate(extra_actuators, start=1):
        _add_states(root, f"layer_{index}_state", extra.states)
        _add_memories(root, f"layer_{index}_memory", extra.memories)
        if extra.wrench:
            _add_wrench(root, f"layer_{index}")
    if ground is not None:
        _set_ground(root, ground)
    whole = str(root.to_xml_string())
    if own is not None:
        return whole, whole, dict(root.get_assets())
    strip(root, contacts=ground is not None)
    return whole, str(root.to_xml_string()), {}


def strip(root: Any, contacts: bool) -> None:
    """Remove what is only drawn or read: geoms without contacts, cameras, lights and sensors.

    The shipped vehicles have neither springs nor dampers, so that MuJoCo need not look for them.
    """
    root.option.flag.spring = root.option.flag.damper = "disable"
    for geom in root.find_all("geom"):
        if not contacts or not geom.name.endswith(("collision", "ground")):
            geom.remove()
    for kind in ("camera", "light", "sensor"):
        for element in root.find_all(kind):
            element.remove()
    acted_on = {getattr(actuator.site, "name", actuator.site) for actuator in root.actuator.general}
    for site in root.find_all("site"):
        if site.name not in acted_on:
            site.remove()


def parse_mjcf(path: Path) -> Any:
    """An MJCF file as dm_control's tree."""
    with warnings.catch_warnings():
        # dm_control tries its window systems on import; without a screen GLFW complains.
        warnings.filterwarnings("ignore", module="glfw")
        from dm_control import mjcf
    return mjcf.from_path(str(path))


def _scale_lengths(root: Any, arm_length: float) -> None:
    """Scale the vehicle's positions and shapes so that its arms have this length (m)."""
    ratio = arm_length / root.find("body", "pod_1").pos[0]
    pending = [root.find("body", "vehicle"), root.find("default", "vehicle")]
    while pending:
        element = pending.pop()
        pending.extend(element.all_children())
        for name in ("pos", "size", "fromto"):
            length = getattr(element, name, None)
            if length is not None:
                setattr(element, name, length * ratio)


def _set_rotors(root: Any, vehicle: Vehicle, limits: RotorLimits) -> None:
    for i, spin in zip(ROTORS, SPIN, strict=True):
        root.find("actuator", f"thrust_{i}").gear = _thrust_gear(vehicle, spin)
        speed_range = limits.speed_range(spin)
        if speed_range is not None:
            root.find("actuator", f"rotor_speed_{i}").actrange = speed_range
            root.find("actuator", f"thrust_{i}").ctrlrange = limits.thrust_range


def _thrust_gear(vehicle: Vehicle, spin: float) -> tuple[float, ...]:
    """Thrust and drag torque per unit of control."""
    drag = -spin * vehicle.drag_coefficient
    return 0.0, 0.0, vehicle.thrust_coefficient, 0.0, 0.0, drag


def _set_inertia(root: Any, vehicle: Vehicle, pod: Pod | None) -> None:
    """Give the pods their mass and inertia and the body the rest of the vehicle's."""
    inertial = root.find("body", "vehicle").inertial
    inertial.mass, inertial.diaginertia = _body_inertia(vehicle, pod)
    if pod is not None:
        for i in ROTORS:
            inertial = root.find("body", f"pod_{i}").inertial
            inertial.mass = pod.mass
            inertial.diaginertia = [pod.inertia] * 3


def _body_inertia(vehicle: Vehicle, pod: Pod | None) -> tuple[float, list[float]]:
    """Mass and principal moments of inertia of the body: the vehicle's less its pods'."""
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


def _set_servos(root: Any, servo: TiltServo, pod: Pod) -> None:
    defaults = root.find("default", "servo")
    inertia = pod.inertia + SERVO_ARMATURE
    defaults.joint.armature = SERVO_ARMATURE
    defaults.position.kp = inertia * servo.natural_frequency**2
    defaults.position.kv = 2.0 * inertia * servo.damping_ratio * servo.natural_frequency
    if servo.max_angle is not None:
        angle_range = (-servo.max_angle, servo.max_angle)
        defaults.joint.range = angle_range
        # As stiff as MuJoCo allows: its usual stop is softer than the servo and would do nothing.
        defaults.joint.solreflimit = (2.0 * root.option.timestep, 1.0)
        defaults.joint.solimplimit = (0.99, 0.99, 0.001, 0.5, 2.0)
        defaults.position.ctrlrange = angle_range


def _set_ground(root: Any, ground: Ground) -> None:
    """Let the vehicle's collision shapes touch the ground, and nothing else."""
    plane = root.find("geom", "ground")
    plane.pos = (0.0, 0.0, ground.height)
    plane.friction = (ground.friction, 0.005, 0.0001)
    plane.priority = 1  # its friction counts, not the larger of the two
    plane.conaffinity = 1
    for geom in root.find("body", "vehicle").find_all("geom"):
        if (geom.name or "").endswith("collision"):
            geom.contype = 1


def _set_keyframe(key: Any, rotor_speed: float) -> None:
    """Let all rotors of an upright, untilted vehicle turn at this speed (rad/s)."""
    key.act = [spin * rotor_speed for spin in SPIN]
    ctrl = key.ctrl.copy()
    ctrl[-8:-4] = rotor_speed**2  # the thrust actuators stand before the four rotor speeds
    key.ctrl = ctrl


def add_law_states(root: Any, count: int) -> None:
    """Append the states of a law: integrators that act on nothing."""
    _add_states(root, "law", count)


def _add_states(root: Any, name: str, count: int) -> None:
    """Append integrators that act on nothing; in the keyframes they rest at zero."""
    joint = _idle_joint(root)
    for index in range(1, count + 1):
        root.actuator.add(
            "general",
            name=f"{name}_{index}",
            joint=joint,
            dyntype="integrator",
            gainprm=[0.0],
        )
    _extend_keyframes(root, act=count, ctrl=count)


def _idle_joint(root: Any) -> Any:
    """What actuators without gain act on; of all that there is, a joint costs MuJoCo least."""
    vehicle = root.find("body", "vehicle")
    return vehicle.freejoint or vehicle.joint[-1]


def _add_memories(root: Any, name: str, count: int) -> None:
    """Append actuators without gain, whose controls remember what a held law has said."""
    joint = _idle_joint(root)
    for index in range(1, count + 1):
        root.actuator.add(
            "general",
            name=f"{name}_{index}",
            joint=joint,
            gainprm=[0.0],
        )
    _extend_keyframes(root, ctrl=count)


def _add_wrench(root: Any, name: str) -> None:
    """Append a force and a torque on the body at its centre, in body axes."""
    for index, axis in enumerate(
        ("force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z")
    ):
        gear = [0.0] * 6
        gear[index] = 1.0
        root.actuator.add("general", name=f"{name}_{axis}", site="imu", gear=gear)
    _extend_keyframes(root, ctrl=6)


def _extend_keyframes(root: Any, act: int = 0, ctrl: int = 0) -> None:
    for key in root.keyframe.key:
        key.act = [*key.act, *[0.0] * act]
        key.ctrl = [*key.ctrl, *[0.0] * ctrl]
