"""Compiling the tilt-car's MuJoCo model from ``mjcf/tilt_car.xml`` and a `TiltCarSpec`."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from functools import lru_cache
from math import cos, sin
from typing import TYPE_CHECKING, Any, Final

from tiltsim.models import mjcf_editing
from tiltsim.models.parts import ModelSpec
from tiltsim.resources import shipped_folder
from tiltsim.system.files import one_thread_at_a_time
from tiltsim.system.hooks import mujoco_hooks
from tiltsim_controllers.tilt_car.vehicle import TiltCar

if TYPE_CHECKING:
    import mujoco

ROTORS: Final = (1, 2)

START_SPEED: Final = 200.0  # rotor speed (rad/s) of the keyframe ``start``: ch. 10's


@dataclass(frozen=True)
class TiltCarSpec(ModelSpec):
    """Specification of a tilt-car's model."""

    car: TiltCar  # both discs weigh half of the mass
    _: KW_ONLY
    rotor_floor: bool = True  # whether the rotor speeds, states of the simulation, stop at zero


@one_thread_at_a_time
def compile_tilt_car(spec: TiltCarSpec, *, visuals: bool = True) -> mujoco.MjModel:
    """Compile the MuJoCo model of a tilt-car, with the keyframes ``rest`` and ``start``.

    ``visuals`` keeps parts that are only drawn or measured, as for rotorcraft.
    """
    complete, bare = _compose(spec)
    with mujoco_hooks():
        return (complete if visuals else bare).copy().compile()


@lru_cache(maxsize=16)
def _compose(spec: TiltCarSpec) -> tuple[mujoco.MjSpec, mujoco.MjSpec]:
    """The complete car, and the car without visuals."""
    root, car = mjcf_editing.parse_mjcf(shipped_folder("mjcf") / "tilt_car.xml"), spec.car
    root.option.timestep = spec.timestep
    root.option.integrator = spec.integrator
    root.option.flag.contact = "disable"
    root.option.flag.constraint = "disable"
    root.size.nuserdata = spec.userdata_size
    _set_inertia(root, car)
    _set_thrusts(root, car)
    # The inertia that the hinge feels while both discs are free to turn.
    inertia = car.top_inertia * car.bottom_inertia / (car.top_inertia + car.bottom_inertia)
    mjcf_editing.set_servos(root, ["tilt"], replace(spec.tilt_servo, max_angle=None), [inertia])
    if not spec.rotor_floor:
        for rotor in ROTORS:
            speed = root.find("actuator", f"rotor_speed_{rotor}")
            speed.actrange, speed.actlimited = (0.0, 0.0), "false"
    start = root.find("key", "start")
    start.act = [START_SPEED] * 2
    start.ctrl = [0.0, START_SPEED**2, START_SPEED**2, 0.0, 0.0]
    mjcf_editing.add_states(root, "law", spec.law_states)
    complete = mjcf_editing.spec_of(root)
    mjcf_editing.remove_visuals(root, contacts=False)
    return complete, mjcf_editing.spec_of(root)


def _set_inertia(root: Any, car: TiltCar) -> None:
    for body, inertia in (("vehicle", car.bottom_inertia), ("top", car.top_inertia)):
        inertial = root.find("body", body).inertial
        inertial.mass = 0.5 * car.mass
        # The car turns about its axis only; the other moments are any that a body can have.
        inertial.diaginertia = [0.6 * inertia, 0.6 * inertia, inertia]


def _set_thrusts(root: Any, car: TiltCar) -> None:
    """Turn the propellers to plus and minus the half angle, lines of thrust through the axis."""
    for rotor, side in zip(ROTORS, (1.0, -1.0), strict=True):
        thrust = root.find("actuator", f"thrust_{rotor}")
        thrust.gear = (0.0, 0.0, car.thrust_coefficient, 0.0, 0.0, 0.0)
        out = cos(car.half_angle), side * sin(car.half_angle)
        parts = [root.find("site", f"rotor_{rotor}")]
        parts += [root.find("geom", f"{name}_{rotor}") for name in ("duct", "fan")]
        for part in parts:
            reach = (part.pos[0] ** 2 + part.pos[1] ** 2) ** 0.5
            part.pos = (reach * out[0], reach * out[1], part.pos[2])
            part.zaxis = (*out, 0.0)
