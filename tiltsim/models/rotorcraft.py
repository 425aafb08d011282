"""Composing a vehicle's MuJoCo model from the files in ``mjcf/`` and a `Vehicle`'s parameters.

The files hold chapter 3's vehicle. `compile_model` puts another vehicle's numbers in their place,
scales what is drawn with the arms, and compiles. The records for it (`TiltServo`, `Pod`,
`RotorLimits`, `Ground`) hold the defaults; the tables of a scenario check what is put into them.
"""

from __future__ import annotations

from copy import copy
from functools import lru_cache
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.models.mjcf_editing import (
    _add_memories,
    _add_states,
    _add_wrench,
    add_law_states,
    parse_mjcf,
    strip,
)
from tiltsim.models.parts import INTEGRATORS, Ground, Pod, RotorLimits, TiltServo
from tiltsim.resources import shipped_folder
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle

if TYPE_CHECKING:
    import mujoco

    from tiltsim.models.parts import ExtraActuators
    from tiltsim.models.user_vehicle import UserVehicle

MODELS: Final = ("tiltrotor", "quadrotor")
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


STIFF_SERVO: Final = TiltServo()
LIGHT_POD: Final = Pod()
UNLIMITED_ROTORS: Final = RotorLimits()


def compile_model(
    model: str,
    vehicle: Vehicle,
    *,
    timestep: float = 1e-3,
    integrator: str = "RK4",
    userdata_size: int = 0,
    tilt_servo: TiltServo = STIFF_SERVO,
    pod: Pod = LIGHT_POD,
    rotor_limits: RotorLimits = UNLIMITED_ROTORS,
    law_states: int = 0,
    extra_actuators: tuple[ExtraActuators, ...] = (),
    ground: Ground | None = None,
    visuals: bool = True,
    own: UserVehicle | None = None,
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
        What layers around the law append after these; see `tiltsim.models.parts.ExtraActuators`.
    ground : Ground, optional
        Ground to take off from and land on; without it there are no contacts to look for.
    visuals : bool, default=True
        Whether there is anything to see or to measure: geoms, cameras, lights and sensors. They do
        not touch the physics, but keeping them up to date takes a third of a step.
    own : UserVehicle, optional
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
    own: UserVehicle | None,
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
