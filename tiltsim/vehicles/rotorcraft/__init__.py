"""Tiltrotor and quadrotor: a free body with four rotors, tilted or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.closed_loop.limits import (
    ALTITUDE_ERROR,
    BODY_RATE,
    HORIZONTAL_ERROR,
    MAX_BODY_RATE,
    MAX_POSITION_ERROR,
    MAX_ROTOR_SPEED,
    ROTOR_SPEED,
    WITHIN_LIMITS,
    altitude_error,
    horizontal_error,
)
from tiltsim.closed_loop.vehicle_kind import VehicleKind
from tiltsim.models.parts import RotorLimits
from tiltsim.system.quantity import SUBSCRIPTS, Quantity
from tiltsim.vehicles.rotorcraft.layout import OBSERVED_FIELDS
from tiltsim.vehicles.rotorcraft.metrics import rotorcraft_metrics
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.mathematics.rotation import quaternion_from_euler
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Vector, clipped, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.parameters import SPIN
from tiltsim_controllers.vehicle.states import ROTORS, SPEED_1, P

if TYPE_CHECKING:
    import mujoco

    from tiltsim.models.parts import ExtraActuators
    from tiltsim.scenario.scenario import FlightPlan, Scenario
    from tiltsim.scenario.vehicle import VehicleTable

COLUMNS: Final = {
    "time": Quantity("time", "s"),
    **{axis: Quantity(axis, "m") for axis in "xyz"},
    **{f"v{axis}": Quantity(f"velocity along {axis}", "m/s") for axis in "xyz"},
    **{angle: Quantity(angle, "rad") for angle in ("roll", "pitch", "yaw")},
    **{
        name: Quantity(f"body rate {name} about {axis}", "rad/s")
        for name, axis in zip("pqr", "xyz", strict=True)
    },
    **{f"alpha_{i}": Quantity(f"tilt angle α{SUBSCRIPTS[i]}", "rad") for i in ROTORS},
    **{f"alpha_ref_{i}": Quantity(f"planned tilt angle α{SUBSCRIPTS[i]}", "rad") for i in ROTORS},
    **{
        f"alpha_rate_{i}": Quantity(f"rate of tilt angle α{SUBSCRIPTS[i]}", "rad/s") for i in ROTORS
    },
    **{f"rotor_speed_{i}": Quantity(f"speed of rotor {i}", "rad/s") for i in ROTORS},
    **{f"thrust_{i}": Quantity(f"thrust of rotor {i}", "N") for i in ROTORS},
    **{f"{axis}_ref": Quantity(f"reference {axis}", "m") for axis in "xyz"},
    **{f"{angle}_ref": Quantity(f"reference {angle}", "rad") for angle in ("roll", "pitch", "yaw")},
    "singularity_margin": Quantity("singularity margin", "rad"),
    "determinant": Quantity("determinant n · r₃", "1"),
}


@scalar
def rotorcraft_limit_exceeded(
    time: float,
    values: Vector,
    reference: ReferenceParameters,
    knots: Vector,
    follows_position: float,
) -> int:
    """The code of the first limit that a sample of a rotorcraft exceeds, `WITHIN_LIMITS` if none.

    ``values`` begin as `OBSERVED_FIELDS`; ``follows_position`` is 0
    where the horizontal position is free.
    """
    away = follows_position * horizontal_error(time, values, reference, knots)
    if away > MAX_POSITION_ERROR:
        return HORIZONTAL_ERROR
    if altitude_error(time, values, reference, knots) > MAX_POSITION_ERROR:
        return ALTITUDE_ERROR
    for axis in range(3):
        if abs(values[P + axis]) > MAX_BODY_RATE:
            return BODY_RATE + axis
    for rotor in range(4):
        if abs(values[SPEED_1 + rotor]) > MAX_ROTOR_SPEED:
            return ROTOR_SPEED + rotor
    return WITHIN_LIMITS


def rotor_thrusts(columns: Mapping[str, Floats], scenario: Scenario) -> dict[str, Floats]:
    """Thrusts (N) of the four rotors, negative where one turns against its spin."""
    coefficient = scenario.true_rotorcraft.thrust_coefficient
    return {
        f"thrust_{i}": coefficient
        * sign
        * columns[f"rotor_speed_{i}"]
        * np.abs(columns[f"rotor_speed_{i}"])
        * columns.get(f"thrust_factor_{i}", 1.0)  # of a fault
        for i, sign in zip(ROTORS, SPIN, strict=True)
    }


def _thrust_factors(scenario: Scenario) -> tuple[float, float]:
    factors = [1.0]
    for fault in scenario.fault:
        if fault.type == "rotor_loss":
            factors.append(0.0)
        elif fault.type == "partial_thrust":
            factors.append(fault.factor)
    return min(factors), max(factors)


def rotor_limits(scenario: Scenario) -> RotorLimits:
    """The limits of a rotorcraft's speeds and thrusts."""
    vehicle = scenario.rotorcraft
    speeds = vehicle.min_rotor_speed, vehicle.max_rotor_speed
    return RotorLimits(*speeds, _thrust_factors(scenario))


def _compile(
    scenario: Scenario,
    law_states: int,
    extra_actuators: tuple[ExtraActuators, ...],
    userdata_size: int,
    visuals: bool,
) -> mujoco.MjModel:
    from tiltsim.models.parts import Ground, Pod, TiltServo
    from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model

    vehicle: VehicleTable = scenario.rotorcraft
    simulation, ground = scenario.simulation, scenario.ground
    spec = RotorcraftSpec(
        vehicle.model,
        scenario.true_rotorcraft,
        timestep=simulation.timestep,
        integrator=simulation.integrator,
        userdata_size=userdata_size,
        tilt_servo=TiltServo(**vehicle.tilt_servo.model_dump(exclude={"max_rate"})),
        pod=Pod(**vehicle.pod.model_dump()),
        rotor_limits=rotor_limits(scenario),
        law_states=law_states,
        extra_actuators=extra_actuators,
        ground=None if ground is None else Ground(ground.height, ground.friction),
        user_vehicle=vehicle.user_vehicle,
    )
    return compile_model(spec, visuals=visuals)


def initial_tilts(plan: FlightPlan) -> tuple[Quad, Quad]:
    """Tilt angles (rad) and tilt rates (rad/s) of a tiltrotor at time zero: its gait's.

    A flight begins in the midst of its gait, as the thesis has it, whose angles follow the plan
    exactly. So nothing swings in, and no pod is faster than its servo can be.
    """
    gait = plan.gait
    a1, a2, a3, a4, *planned = tilt_reference(0.0, gait.parameters, gait.knots)
    fastest = plan.scenario.rotorcraft.tilt_servo.max_rate or inf
    rate_1, rate_2, rate_3, rate_4 = (clipped(rate, -fastest, fastest) for rate in planned)
    return (a1, a2, a3, a4), (rate_1, rate_2, rate_3, rate_4)


def _initial_motion(plan: FlightPlan) -> tuple[Vector, Vector]:
    initial = plan.scenario.initial
    tilting = plan.scenario.rotorcraft.has_tilting_rotors
    angles, rates = initial_tilts(plan) if tilting else ((), ())
    return (
        (*initial.position, *quaternion_from_euler(*initial.attitude), *angles),
        (*initial.velocity, *initial.angular_velocity, *rates),
    )


ROTORCRAFT: Final = VehicleKind(
    observed_fields=OBSERVED_FIELDS,
    columns=COLUMNS,
    thrusts=rotor_thrusts,
    compile=_compile,
    initial_motion=_initial_motion,
    limit_exceeded=rotorcraft_limit_exceeded,
    metrics=rotorcraft_metrics,
)
"""Tiltrotor and quadrotor."""

SINGULARITY_COLUMNS: Final = ("singularity_margin", "determinant")

OTHER_LAYOUT: Final = replace(
    ROTORCRAFT,
    columns={name: what for name, what in COLUMNS.items() if name not in SINGULARITY_COLUMNS},
)
"""A user's rotorcraft without four equal arms at right angles, of which those columns speak."""
