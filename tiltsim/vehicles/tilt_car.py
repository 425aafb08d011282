"""The tilt-car: two discs on a plane, two rotors that push and cannot pull; its metrics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.limits import limit_exceeded_of
from tiltsim.closed_loop.loop import VehicleKind
from tiltsim.models.parts import ExtraActuators, TiltServo, Visuals
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.system.text import Quantity
from tiltsim.vehicles.spans import (
    horizontal_error_metrics,
    in_last_second,
    mean_of,
    position_error,
    rotor_metrics,
    with_columns_metrics,
)
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.tilt_car.vehicle import counter_yaw_per_tilt

if TYPE_CHECKING:
    import mujoco


ROTORS: Final = (1, 2)

OBSERVED_FIELDS: Final = (
    "x",
    "y",
    "vx",
    "vy",
    "yaw",
    "r",
    "alpha",
    "alpha_rate",
    "rotor_speed_1",
    "rotor_speed_2",
)
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


def _compile(
    scenario: Scenario,
    law_states: int,
    extra_actuators: tuple[ExtraActuators, ...],
    userdata_size: int,
    visuals: Visuals,
) -> mujoco.MjModel:
    from tiltsim.models.tilt_car import TiltCarSpec, compile_tilt_car

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
