"""Composing the tilt-car's MuJoCo model from ``mjcf/tilt_car.xml`` and a `TiltCar`'s parameters."""

from __future__ import annotations

from functools import lru_cache
from math import cos, isfinite, sin
from typing import TYPE_CHECKING, Any, Final

from tiltsim.models.mjcf_editing import add_law_states, parse_mjcf, strip
from tiltsim.models.parts import INTEGRATORS, TiltServo
from tiltsim.resources import shipped_folder
from tiltsim_controllers.tilt_car.vehicle import TiltCar

if TYPE_CHECKING:
    import mujoco

IDEAL_SERVO: Final = TiltServo()

START_SPEED: Final = 200.0
"""Rotor speed (rad/s) of the keyframe ``start``: ch. 10's."""


def compile_tilt_car(
    car: TiltCar,
    *,
    timestep: float = 1e-3,
    integrator: str = "RK4",
    userdata_size: int = 0,
    tilt_servo: TiltServo = IDEAL_SERVO,
    law_states: int = 0,
    rotor_floor: bool = True,
    visuals: bool = True,
) -> mujoco.MjModel:
    """Compile the MuJoCo model of a tilt-car.

    Parameters
    ----------
    car : TiltCar
        Physical parameters; both discs weigh half of the mass.
    timestep : float, default=1e-3
        Physics time step, s.
    integrator : str, default="RK4"
        MuJoCo's name: ``Euler``, ``RK4``, ``implicit`` or ``implicitfast``.
    userdata_size : int, default=0
        Numbers of user data in the simulation's state.
    tilt_servo : TiltServo, optional
        The servo that turns the discs against each other; its angle is not limited.
    law_states : int, default=0
        Number of states of a control law of its own, as in
        `tiltsim.models.rotorcraft.compile_model`.
    rotor_floor : bool, default=True
        Whether the rotor speeds, states of the simulation, stop at zero.
    visuals : bool, default=True
        Whether there is anything to see or to measure; see
        `tiltsim.models.rotorcraft.compile_model`.

    Returns
    -------
    mujoco.MjModel
        With the keyframes ``rest`` and ``start`` (rotors at 200 rad/s).

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    import mujoco

    if integrator not in INTEGRATORS:
        raise ValueError(
            f"simulation.integrator = {integrator!r}: unknown; choose {', '.join(INTEGRATORS)}"
        )
    for name, value in {"simulation.timestep": timestep, **car._asdict()}.items():
        if not (isfinite(value) and value > 0.0):
            raise ValueError(f"{name} = {value!r}: must be finite and above 0")
    for name, size in (("userdata_size", userdata_size), ("law_states", law_states)):
        if size < 0:
            raise ValueError(f"{name} = {size!r}: must be at least 0")
    whole, bare = _compose(
        car, timestep, integrator, userdata_size, tilt_servo, law_states, rotor_floor
    )
    return mujoco.MjModel.from_xml_string(whole if visuals else bare)


@lru_cache(maxsize=16)
def _compose(
    car: TiltCar,
    timestep: float,
    integrator: str,
    userdata_size: int,
    tilt_servo: TiltServo,
    law_states: int,
    rotor_floor: bool,
) -> tuple[str, str]:
    """The car's complete MJCF, and the same without what is only drawn."""
    root = parse_mjcf(shipped_folder("mjcf") / "tilt_car.xml")
    root.option.timestep = timestep
    root.option.integrator = integrator
    root.option.flag.contact = "disable"
    root.option.flag.constraint = "disable"
    root.size.nuserdata = userdata_size
    _set_inertia(root, car)
    _set_thrusts(root, car)
    _set_servo(root, car, tilt_servo)
    if not rotor_floor:
        del root.find("default", "rotor_speed").general.actrange
    start = root.keyframe.key["start"]
    start.act = [START_SPEED] * 2
    start.ctrl = [0.0, START_SPEED**2, START_SPEED**2, 0.0, 0.0]
    add_law_states(root, law_states)
    whole = str(root.to_xml_string())
    strip(root, contacts=False)
    return whole, str(root.to_xml_string())


def _set_inertia(root: Any, car: TiltCar) -> None:
    for body, inertia in (("vehicle", car.bottom_inertia), ("top", car.top_inertia)):
        inertial = root.find("body", body).inertial
        inertial.mass = 0.5 * car.mass
        # The car turns about its axis alone; what a body could have is set about the others.
        inertial.diaginertia = [0.6 * inertia, 0.6 * inertia, inertia]


def _set_thrusts(root: Any, car: TiltCar) -> None:
    """Turn the propellers to plus and minus the half angle, lines of thrust through the axis."""
    thrust = root.find("default", "thrust").general
    thrust.gear = (0.0, 0.0, car.thrust_coefficient, 0.0, 0.0, 0.0)
    for rotor, side in ((1, 1.0), (2, -1.0)):
        out = cos(car.half_angle), side * sin(car.half_angle)
        parts = [root.find("site", f"rotor_{rotor}")]
        parts += [root.find("geom", f"{name}_{rotor}") for name in ("duct", "fan")]
        for part in parts:
            reach = (part.pos[0] ** 2 + part.pos[1] ** 2) ** 0.5
            part.pos = (reach * out[0], reach * out[1], part.pos[2])
            part.zaxis = (*out, 0.0)


def _set_servo(root: Any, car: TiltCar, servo: TiltServo) -> None:
    """Gains of the servo on the inertia that the hinge feels while both discs are free to turn."""
    inertia = car.top_inertia * car.bottom_inertia / (car.top_inertia + car.bottom_inertia)
    defaults = root.find("default", "servo")
    defaults.position.kp = inertia * servo.natural_frequency**2
    defaults.position.kv = 2.0 * inertia * servo.damping_ratio * servo.natural_frequency
