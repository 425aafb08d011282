"""Checks between the tables of a scenario, each valid alone, and of its time steps."""

from __future__ import annotations

import re
from typing import Any, Final

import numpy as np

from tiltsim.scenario.claim import NAME
from tiltsim.scenario.controller import laws_for
from tiltsim.scenario.gait import FixedGait
from tiltsim.scenario.messages import InvalidValueError, choose
from tiltsim.scenario.reference import WaypointReference
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim.scenario.simulation_table import InitialTable
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.scenario.vehicle import (
    ModelErrorTable,
    PodTable,
    TiltServoTable,
    VehicleTable,
    require_physical_inertia,
)
from tiltsim_controllers.analysis.stability import ErrorLoop
from tiltsim_controllers.laws.supervisor import LAG
from tiltsim_controllers.vehicle.parameters import Vehicle

MAX_KNOTS: Final = 1500
"""Numbers of a gait and a reference together, which every evaluation of the law reads."""

MAX_LOOP_STEP: Final = 2.5
"""Largest product of timestep and closed-loop pole; RK4 turns unstable at 2.78, ode3 at 2.51."""

MAX_HOVER_SPEED: Final = 5000.0
"""Rotor speed (rad/s) in hover beyond that of any rotor: tips at 7 cm would be supersonic."""

MAX_HELD_STEP: Final = 2.0
"""Largest product of control timestep and pole, where a held third derivative turns unstable."""

MAX_SERVO_STEP: Final = {"mujoco": 2.6, "thesis": 2.45}
"""Largest product of timestep and servo pole, by plant.

On the real axis RK4 turns unstable at 2.78 and ode3 at 2.51; at a damping ratio of 0.3 or more both
are stable at these. With less, ode3 is stable up to `MAX_UNDAMPED_SERVO_STEP`.
"""

MAX_UNDAMPED_SERVO_STEP: Final = 1.7
"""On the thesis plant: ode3 turns unstable at 1.73 on the imaginary axis."""


def check_consistency(scenario: ScenarioTables) -> None:
    """Refuse a scenario whose tables contradict each other.

    Raises `InvalidValueError` for the first contradiction, with the key and what is allowed.
    """
    _check_law(scenario)
    _check_actuators(scenario)
    _check_model_error(scenario)
    _check_gait(scenario)
    _check_reference(scenario)
    _check_rotor_limits(scenario)
    _check_ground(scenario)
    _check_claims(scenario)


def _check_law(scenario: ScenarioTables) -> None:
    controller, vehicle = scenario.controller, scenario.vehicle
    if vehicle.model not in controller.vehicle_models:
        raise scenario.mistake(
            "controller.law",
            f"controls the {' or '.join(controller.vehicle_models)}, and vehicle.model = "
            f"{vehicle.model!r}; choose {', '.join(laws_for(vehicle.model))}",
        )
    speed = scenario.initial.rotor_speed
    if isinstance(speed, tuple) and len(speed) != vehicle.rotor_count:
        raise scenario.mistake(
            "initial.rotor_speed",
            f"the {vehicle.model} has {vehicle.rotor_count} rotors; give one value or one each",
        )
    if vehicle.is_planar:
        _check_plane(scenario)
        _check_planar_gait(scenario)
    else:
        _check_layout(scenario)
        if controller.is_external:
            _check_external(scenario)
    if not vehicle.has_tilting_rotors:
        _check_fixed_rotors(scenario)


def _check_fixed_rotors(scenario: ScenarioTables) -> None:
    keys = {"gait.type": "fixed", "gait": FixedGait()}
    keys |= {"vehicle.tilt_servo": TiltServoTable(), "vehicle.pod": PodTable()}
    if not scenario.controller.is_external:  # external commands act on rotors with a speed
        keys |= {"vehicle.min_rotor_speed": None, "vehicle.max_rotor_speed": None}
        keys["vehicle.rotor_inertia"] = 0.0
        keys["initial.rotor_speed"] = InitialTable().rotor_speed
    for key, default in keys.items():
        scenario.require(
            key,
            default,
            "not supported for the quadrotor, whose rotors do not tilt and produce the "
            "commanded thrust at once; remove it",
        )


def _check_actuators(scenario: ScenarioTables) -> None:
    vehicle = scenario.vehicle
    if scenario.has_air and vehicle.is_planar:
        raise scenario.mistake(
            "vehicle.model", "aerodynamic effects are not supported; remove [air]"
        )
    supported = vehicle.has_tilting_rotors and not vehicle.is_planar
    for key, value, ideal in scenario.actuator_options:
        if value != ideal and not supported:
            raise InvalidValueError(key, value, f"not supported for the {vehicle.model}; remove it")
    faults = [(fault.rotor, fault.type == "stuck_servo") for fault in scenario.fault]
    for rotor, stuck in faults:
        if faults.count((rotor, stuck)) > 1:
            twice = "stuck servo" if stuck else "loss of thrust"
            raise InvalidValueError("fault.rotor", rotor, f"has more than one {twice}")
    if scenario.controller.measures_angular_acceleration:
        reason = 'not supported with controller.angular_acceleration = "measured"; remove it'
        scenario.require("ground", None, reason)
        scenario.require("vehicle.mjcf", None, reason)
        if scenario.rotorcraft.rotor_time_constant is None:
            reason = (
                'not supported with controller.angular_acceleration = "measured" without lag; '
                "set vehicle.rotor_time_constant or remove it"
            )
            scenario.require("vehicle.rotor_inertia", 0.0, reason)
    if scenario.controller.prioritizes_attitude and not scenario.rotorcraft.has_rotor_limits:
        raise scenario.mistake(
            "controller.allocation",
            "needs rotor limits: vehicle.min_rotor_speed or vehicle.max_rotor_speed",
        )


def _check_layout(scenario: ScenarioTables) -> None:
    user_vehicle, external = scenario.rotorcraft.user_vehicle, scenario.controller.is_external
    if user_vehicle is None or not user_vehicle.layout_mismatch:
        return
    if not external:
        raise scenario.mistake(
            "vehicle.mjcf",
            f"{user_vehicle.layout_mismatch}; the {scenario.controller.law} law needs four equal "
            'arms at right angles, law = "python" supports any layout',
        )
    reason = f"{user_vehicle.layout_mismatch}; needs four equal arms at right angles"
    scenario.require("vehicle.rotor_inertia", 0.0, reason)


def _check_external(scenario: ScenarioTables) -> None:
    reason = 'law = "python" is supported on the {} only'
    scenario.require("simulation.plant", "mujoco", reason.format("mujoco plant"))
    if scenario.simulation.engine == "native":
        raise scenario.mistake("simulation.engine", reason.format("python engine"))


def _check_model_error(scenario: ScenarioTables) -> None:
    error = scenario.model_error
    if error == ModelErrorTable():
        return
    if not isinstance(scenario.vehicle, VehicleTable):
        raise scenario.mistake(
            "vehicle.model", "[model_error] is supported for rotorcraft only; remove it"
        )
    if scenario.vehicle.mjcf is not None:
        scenario.require("model_error.arm_length", 1.0, "defined by vehicle.mjcf; remove it")
    require_physical_inertia(
        "model_error.inertia", list(error.inertia), scenario.true_rotorcraft[1:4]
    )


_SPATIAL_KEYS: Final = ("position", "velocity", "acceleration", "amplitude")
"""Keys of references that hold a vector in the world."""


def _check_plane(scenario: ScenarioTables) -> None:
    """Refuse motion out of a tilt-car's plane, and references of yaw, which is not controlled."""
    initial, reference = scenario.initial, scenario.reference
    out_of_plane: dict[str, tuple[float, ...]] = {
        "initial.position": initial.position[2:],
        "initial.velocity": initial.velocity[2:],
        "initial.attitude": initial.attitude[:2],
        "initial.angular_velocity": initial.angular_velocity[:2],
    }
    out_of_plane |= {f"reference.{key}": v[2:] for key, v in reference if key in _SPATIAL_KEYS}
    for key, components in out_of_plane.items():
        if any(components):
            raise scenario.mistake(
                key, "the tilt_car stays in its plane: only x, y and yaw may be nonzero"
            )
    scenario.require("reference.yaw", 0.0, "yaw is not an output of the tilt_car's laws")


def _check_planar_gait(scenario: ScenarioTables) -> None:
    gait, law = scenario.gait, scenario.controller.law
    allowed = scenario.controller.gait_types
    takes_none = allowed == ("fixed",)
    if gait.type not in allowed:
        raise scenario.mistake(
            "gait.type",
            f"the {law} law does not use a gait; remove [gait]"
            if takes_none
            else f"the {law} law needs one of {', '.join(allowed)}",
        )
    if takes_none:
        reason = f"the {law} law commands the tilt itself; remove [gait]"
        scenario.require("gait", FixedGait(), reason)


def _check_reference(scenario: ScenarioTables) -> None:
    controller, reference = scenario.controller, scenario.reference
    kinds = {*controller.reference_kinds}
    if "pose" in kinds:
        kinds.add("position")  # a pose of zero roll and pitch is written like a position
    if reference.kind not in kinds:
        if reference.kind == "pose":
            key = "roll" if reference.roll else "pitch"
            reason = f"roll and pitch are not outputs of the {controller.law} law"
            raise scenario.mistake(f"reference.{key}", reason)
        raise scenario.mistake("reference.type", f"the {controller.law} law cannot track it")
    if reference.type == "waypoints" and scenario.vehicle.is_planar:
        raise scenario.mistake("reference.type", "the tilt_car's laws cannot track it")
    if reference.adds_acceleration and not controller.omits_reference_acceleration:
        own = isinstance(controller, AttitudeAltitudeController)
        option = " with gait_rate_feedforward" if own else ""
        raise scenario.mistake(
            "reference.acceleration_feedforward",
            f"the {controller.law} law{option} always includes all derivatives; remove it",
        )
    if isinstance(controller, AttitudeAltitudeController):
        needs_none = reference.kind == "attitude_altitude"
        if needs_none != (controller.decoupler == "none"):
            raise scenario.mistake(
                "controller.decoupler",
                f"reference.type = {reference.type!r} needs "
                + ("none" if needs_none else "conventional, modified or exact"),
            )


def _check_gait(scenario: ScenarioTables) -> None:
    key, value = scenario.gait.size

    def mistake(reason: str) -> InvalidValueError:
        return InvalidValueError(f"gait.{key}", value, reason)

    try:
        gait = scenario.gait.plan(scenario.vehicle.resolve())
    except ValueError as error:
        raise mistake(str(error)) from None
    limit = scenario.vehicle.tilt_servo.angle_limit
    if limit is not None and gait.amplitude > limit:
        raise mistake(
            f"tilts by {gait.amplitude:.4g} rad, beyond the servo limit "
            f"vehicle.tilt_servo.max_angle = {limit}"
        )
    knots = len(gait.knots)
    if knots > MAX_KNOTS:
        raise mistake(f"too many keyframes: {knots} numbers, at most {MAX_KNOTS}")
    reference = scenario.reference
    total = knots + len(reference.knots)
    if isinstance(reference, WaypointReference) and total > MAX_KNOTS:
        raise InvalidValueError(
            "reference.times",
            len(reference.times),
            f"too many waypoints: {total} numbers with the gait's, at most {MAX_KNOTS}",
        )
    if scenario.controller.commands_tilts and not gait.is_constant:
        raise scenario.mistake(
            "gait.type",
            f"the {scenario.controller.law} law commands the tilts itself; give the initial angles "
            "as a fixed gait",
        )


def _check_ground(scenario: ScenarioTables) -> None:
    ground = scenario.ground
    if ground is None:
        return
    if scenario.vehicle.is_planar:
        raise scenario.mistake("ground", "not supported for the tilt_car, which moves in a plane")
    reason = "its equations have no ground contact; use mujoco"
    scenario.require("simulation.plant", "mujoco", reason)
    user_vehicle = scenario.rotorcraft.user_vehicle
    if user_vehicle is not None and not user_vehicle.has_contact_geoms:
        raise scenario.mistake(
            "ground", "vehicle.mjcf needs a geom 'ground', and geoms whose names end in 'collision'"
        )
    if scenario.initial.position[2] < ground.height:
        raise scenario.mistake("initial.position", f"below ground.height = {ground.height}")


def _check_rotor_limits(scenario: ScenarioTables) -> None:
    if not isinstance(scenario.vehicle, VehicleTable):
        return
    low, high = scenario.vehicle.min_rotor_speed, scenario.vehicle.max_rotor_speed
    for speed in scenario.initial.rotor_speeds(scenario.vehicle.rotor_count):
        if (low is not None and speed < low) or (high is not None and speed > high):
            raise InvalidValueError(
                "initial.rotor_speed",
                speed,
                f"must lie within the rotor limits, {low or 0} to {high or 'any'} rad/s",
            )


def check_time_steps(scenario: ScenarioTables) -> None:
    """Refuse servos, supervisors and laws that a scenario's time steps make unstable.

    Raises `InvalidValueError`, also for gains that are unstable at any step.
    """
    _check_servo(scenario)
    _check_supervisor(scenario)
    _check_stability(scenario)


def _check_servo(scenario: ScenarioTables) -> None:
    servo, timestep = scenario.vehicle.tilt_servo, scenario.simulation.timestep
    # The fastest pole of the servo must stay where explicit integration is stable.
    fastest = servo.natural_frequency * max(1.0, 2.0 * servo.damping_ratio)
    plant = scenario.simulation.plant
    limit = MAX_SERVO_STEP[plant]
    if plant == "thesis" and servo.damping_ratio < 0.3:
        limit = MAX_UNDAMPED_SERVO_STEP
    # On the thesis plant ideal pods follow the gait exactly.
    moves = plant == "mujoco" or not scenario.has_ideal_actuators_in_still_air
    if scenario.vehicle.has_tilting_rotors and moves and fastest * timestep > limit:
        raise scenario.mistake(
            "simulation.timestep",
            f"too long for a tilt servo at {servo.natural_frequency:g} rad/s; at most "
            f"{limit / fastest:.3g} s, or a slower vehicle.tilt_servo",
        )


def _check_supervisor(scenario: ScenarioTables) -> None:
    """Refuse a supervisor that cannot keep its thresholds, or is sampled too slowly for its lag."""
    supervisor = scenario.controller.supervision
    if supervisor is None:
        return
    supervisor.resolve(scenario.rotorcraft.resolve())
    longest = MAX_HELD_STEP * LAG
    step, strategy = scenario.simulation.control_timestep, supervisor.strategy
    if strategy != "scale" and step >= longest:
        raise scenario.mistake(
            "simulation.control_timestep",
            f"too long for controller.supervisor.strategy = {strategy}, which moves with a lag "
            f"of {LAG:g} s; below {longest:g} s",
        )


def _check_stability(scenario: ScenarioTables) -> None:
    controller = scenario.controller
    if controller.allow_unstable:
        return
    vehicle: Any = scenario.vehicle.resolve()  # each controller's table takes its own vehicle
    for loop in controller.error_loops(vehicle):
        if not loop.stable:
            raise scenario.mistake(
                "controller.gains",
                f"fails the Routh-Hurwitz criterion under {controller.linearization}: "
                f"{loop.condition}; change the gains or set controller.allow_unstable = true",
            )
        _check_speed(scenario, loop)


def _check_speed(scenario: ScenarioTables, loop: ErrorLoop) -> None:
    """Refuse a loop whose fastest pole the time steps cannot follow.

    The published decoupling matrix speeds the attitude loops up some 700 times, so that
    harmless-looking gains can outrun the integrator within a few steps.
    """
    fastest = float(np.abs(np.roots(loop.polynomial)).max())
    limits = {"timestep": MAX_LOOP_STEP, "control_timestep": MAX_HELD_STEP}
    for key, limit in limits.items():
        step = getattr(scenario.simulation, key)
        if fastest * step > limit:
            _check_weight(scenario)
            raise scenario.mistake(
                f"simulation.{key}",
                f"too long for the {loop.name} loop under "
                f"{scenario.controller.linearization}, with its fastest pole at {fastest:.4g} "
                f"rad/s; at most {limit / fastest:.3g} s, or slower gains, or "
                "controller.allow_unstable = true",
            )


def _check_weight(scenario: ScenarioTables) -> None:
    """Refuse a mass, such as one in grams, that no rotors carry; loops are as fast as rotors."""
    vehicle = scenario.vehicle.resolve()
    if isinstance(vehicle, Vehicle) and vehicle.hover_rotor_speed > MAX_HOVER_SPEED:
        raise InvalidValueError(
            "vehicle.mass",
            vehicle.mass,
            f"is in kg; to hover its rotors would have to turn at {vehicle.hover_rotor_speed:.4g} "
            "rad/s; check mass and thrust_coefficient",
        )


def _check_claims(scenario: ScenarioTables) -> None:
    for expectation in scenario.expect:
        name = expectation.claim
        if re.match(NAME, name) and name not in scenario.claim:
            raise expectation.mistake("claim", "no such table; " + choose(name, scenario.claim))
