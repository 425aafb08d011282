"""The tilt-car: two discs on a plane, two rotors that push and cannot pull; its metrics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, replace
from functools import lru_cache
from math import cos, sin
from typing import Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.limits import limit_exceeded_of
from tiltsim.closed_loop.loop import VehicleKind
from tiltsim.models import mjcf_editing
from tiltsim.models.parts import ExtraActuators, ModelSpec, TiltServo, Visuals
from tiltsim.resources import shipped_folder
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.system.files import one_thread_at_a_time
from tiltsim.system.hooks import mujoco_hooks
from tiltsim.system.text import Quantity
from tiltsim.vehicles.metrics import (
    horizontal_error_metrics,
    in_last_second,
    mean_of,
    position_error,
    rotor_metrics,
    with_columns_metrics,
)
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.tilt_car.vehicle import TiltCar, counter_yaw_per_tilt

ROTORS: Final = (1, 2)

DISCS: Final = ("x", "y", "vx", "vy", "yaw", "r", "alpha", "alpha_rate")
OBSERVED_FIELDS: Final = (*DISCS, *(f"rotor_speed_{rotor}" for rotor in ROTORS))
"""A sample of any tilt-car after its time: both discs and the rotor speeds."""

COLUMNS: Final = {
    "time": Quantity("time", "s"),
    **{axis: Quantity(axis, "m") for axis in "xy"},
    **{f"v{axis}": Quantity(f"velocity along {axis}", "m/s") for axis in "xy"},
    "yaw": Quantity("yaw", "rad"),
    "r": Quantity("yaw rate r", "rad/s"),
    "alpha": Quantity("tilt angle α", "rad"),
    "alpha_ref": Quantity("planned tilt angle α", "rad"),
    "alpha_rate": Quantity("rate of tilt angle α", "rad/s"),
    **{f"rotor_speed_{i}": Quantity(f"speed of rotor {i}", "rad/s") for i in ROTORS},
    **{f"thrust_{i}": Quantity(f"thrust of rotor {i}", "N") for i in ROTORS},
    **{f"{axis}_ref": Quantity(f"reference {axis}", "m") for axis in "xy"},
    **{f"v{axis}_ref": Quantity(f"reference velocity along {axis}", "m/s") for axis in "xy"},
    "direction": Quantity("direction of the thrusts", "rad"),
    "direction_lower": Quantity("lowest admissible direction", "rad"),
    "direction_upper": Quantity("highest admissible direction", "rad"),
    "direction_ref": Quantity("direction of the desired acceleration", "rad"),
    "input_split": Quantity("ω₁² − ω₂²", "rad^2/s^2"),
}
"""Columns of every flight of a car and their units.

``direction`` is the direction between the thrusts, ``yaw + alpha``; ``direction_lower`` and
``direction_upper`` bound the directions of the sum of both thrusts; ``direction_ref`` is the
direction of the acceleration that the law wants or the reference has, each written as the angle
nearest to ``direction``. ``input_split`` is ``omega_1^2 - omega_2^2``.
"""


def _thrusts(columns: Mapping[str, Floats], scenario: Scenario) -> dict[str, Floats]:
    coefficient = scenario.vehicle.resolve().thrust_coefficient
    return {f"thrust_{i}": coefficient * columns[f"rotor_speed_{i}"] ** 2 for i in ROTORS}


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
    parsed, car = mjcf_editing.parse_mjcf(shipped_folder("mjcf") / "tilt_car.xml"), spec.car
    _set_inertia(parsed, car)
    _set_thrusts(parsed, car)
    root = mjcf_editing.spec_of(parsed)
    mjcf_editing.set_integration(root, spec)
    mjcf_editing.set_flags(root, contact=False, constraint=False)
    # The inertia that the hinge feels while both discs are free to turn.
    inertia = car.top_inertia * car.bottom_inertia / (car.top_inertia + car.bottom_inertia)
    mjcf_editing.set_servos(root, ["tilt"], replace(spec.tilt_servo, max_angle=None), [inertia])
    if not spec.rotor_floor:
        for rotor in ROTORS:
            speed = root.actuator(f"rotor_speed_{rotor}")
            speed.actrange, speed.actlimited = (0.0, 0.0), mujoco.mjtLimited.mjLIMITED_FALSE
    start = root.key("start")
    start.act = [START_SPEED] * 2
    start.ctrl = [0.0, START_SPEED**2, START_SPEED**2, 0.0, 0.0]
    mjcf_editing.add_states(root, "law", spec.law_states)
    complete = root.copy()
    mjcf_editing.remove_visuals(root, contacts=False)
    return complete, root


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


def _compile(
    scenario: Scenario,
    law_states: int,
    extra_actuators: tuple[ExtraActuators, ...],
    userdata_size: int,
    visuals: Visuals,
) -> mujoco.MjModel:
    car, simulation = scenario.vehicle, scenario.simulation
    if extra_actuators:
        raise ValueError("the tilt-car takes no actuators beyond its own")
    spec = TiltCarSpec(
        car.resolve(),
        timestep=simulation.timestep,
        integrator=simulation.integrator,
        userdata_size=userdata_size,
        tilt_servo=TiltServo(car.tilt_servo.natural_frequency, car.tilt_servo.damping_ratio),
        law_states=law_states,
        rotor_floor=scenario.controller.rotors_stop_at_zero,
    )
    return compile_tilt_car(spec, visuals=bool(visuals))


def initial_tilt(plan: FlightPlan) -> tuple[float, float]:
    """Tilt angle (rad) and its rate (rad/s) at time zero: the gait's."""
    angle, rate, _ = plan.gait.jets(0.0)[0]
    return angle, rate


def _initial_motion(plan: FlightPlan) -> tuple[Vector, Vector]:
    """The car turned out of zero tilt at ``initial.attitude``'s yaw, angular momentum conserved."""
    initial = plan.scenario.initial
    share = counter_yaw_per_tilt(plan.scenario.vehicle.resolve())
    tilt, rate = initial_tilt(plan)
    x, y, _ = initial.position
    vx, vy, _ = initial.velocity
    yaw, r = initial.attitude[2], initial.angular_velocity[2]
    return (x, y, yaw - share * tilt, tilt), (vx, vy, r - share * rate, rate)


def tilt_car_metrics(
    columns: Mapping[str, Floats], scenario: Scenario, _follows_position: bool
) -> dict[str, Any]:
    """See `tiltsim.closed_loop.loop.VehicleKind.metrics`."""
    timestep = scenario.simulation.timestep
    last_second = in_last_second(columns["time"], timestep)
    errors = {axis: columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y")}
    metrics = {
        **position_error(*errors.values()),
        **horizontal_error_metrics(columns, timestep),
        **rotor_metrics(columns, scenario.vehicle),
        "final_input_split": mean_of(columns["input_split"], last_second),
        "final_yaw": mean_of(columns["yaw"], last_second),
    }
    for axis, error in errors.items():
        metrics[f"final_position_error_{axis}"] = mean_of(error, last_second)
        metrics[f"max_abs_error_{axis}"] = np.abs(error).max(axis=-1)
    return with_columns_metrics(metrics, columns)


TILT_CAR: Final = VehicleKind(
    observed_fields=OBSERVED_FIELDS,
    columns=COLUMNS,
    thrusts=_thrusts,
    compile=_compile,
    initial_motion=_initial_motion,
    limit_exceeded=limit_exceeded_of(OBSERVED_FIELDS),
    metrics=tilt_car_metrics,
)
"""The tilt-car."""
