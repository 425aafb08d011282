"""Checks between the tables of a scenario, each valid alone."""

import re
from math import pi
from typing import Final

from tiltsim.scenario.companion import check_companions
from tiltsim.scenario.controller import CONTROLLERS, laws_for
from tiltsim.scenario.expectation import NAME
from tiltsim.scenario.gait import FixedGait, TableGait
from tiltsim.scenario.instruments import check_instruments
from tiltsim.scenario.interaction import check_objects
from tiltsim.scenario.linearizing_controllers import (
    AttitudeAltitudeController,
    AttitudeForceController,
    FullPoseController,
)
from tiltsim.scenario.messages import InvalidValueError, choose
from tiltsim.scenario.outputs import check_decoupler, check_dimension, check_full_pose
from tiltsim.scenario.reference import WaypointReference
from tiltsim.scenario.rotorcraft import MultirotorTable, RotorcraftTable, TiltServoTable
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim.scenario.simulation_table import InitialTable
from tiltsim.scenario.vehicle import (
    ModelErrorTable,
    PodTable,
    VehicleTable,
    require_physical_inertia,
)

MAX_KNOTS: Final = 1500
"""Numbers of a gait and a reference together, except tables, which have a separate limit."""


def check_consistency(scenario: ScenarioTables) -> None:
    """Refuse a scenario whose tables contradict each other.

    Raises `InvalidValueError` for the first contradiction, with the key and the allowed values.
    """
    _check_law(scenario)
    _check_actuators(scenario)
    _check_model_error(scenario)
    _check_gait(scenario)
    _check_reference(scenario)
    _check_time_tables(scenario)
    _check_rotor_limits(scenario)
    _check_ground(scenario)
    check_instruments(scenario)
    check_objects(scenario)
    _check_claims(scenario)
    _check_engine(scenario)
    scenario.controller.check_scenario(scenario)
    _check_rigid_body(scenario)
    check_companions(scenario)


def _check_engine(scenario: ScenarioTables) -> None:
    simulation = scenario.simulation
    if simulation.engine == "jax":
        if simulation.plant == "mujoco":
            reason = 'simulation.engine = "jax" is supported on the plants thesis and rigid_body'
            raise scenario.mistake("simulation.plant", reason)
    elif simulation.precision != "float64":
        raise scenario.mistake("simulation.precision", 'needs simulation.engine = "jax"')
    if simulation.batch_functions == "quick" and simulation.plant == "mujoco":
        raise scenario.mistake(
            "simulation.batch_functions", 'needs simulation.plant = "thesis" or "rigid_body"'
        )


def _check_rigid_body(scenario: ScenarioTables) -> None:
    """Refuse vehicles that the plant ``rigid_body`` cannot be."""
    vehicle = scenario.vehicle
    if scenario.simulation.plant != "rigid_body":
        return
    if not isinstance(vehicle, RotorcraftTable):
        reason = f"supports no {vehicle.model}; use mujoco or thesis"
        raise scenario.mistake("simulation.plant", reason)
    if isinstance(vehicle, VehicleTable):
        scenario.require("vehicle.pod", PodTable(), "the rigid_body plant has massless pods")
    file = vehicle.user_vehicle
    if file is not None and file.unmodeled_properties:
        reason = f"neglects of vehicle.mjcf {file.unmodeled_properties}; use mujoco"
        raise scenario.mistake("simulation.plant", reason)


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
    if vehicle.model == "quadrotor":
        _check_fixed_rotors(scenario)
    if isinstance(vehicle, MultirotorTable):
        _check_multirotor(scenario, vehicle)


def _check_multirotor(scenario: ScenarioTables, vehicle: MultirotorTable) -> None:
    if not vehicle.has_tilting_rotors:
        scenario.require(
            "vehicle.tilt_servo", TiltServoTable(), "vehicle.mjcf has no tilts; remove it"
        )
    controller, rotors = scenario.controller, vehicle.rotor_count
    if rotors < 4 and controller.needs_four_rotors and not controller.commands_tilts:
        reason = f"{rotors} rotors control attitude and lift only together with their tilts"
        if not vehicle.has_tilting_rotors:
            raise scenario.mistake("vehicle.mjcf", f"{reason}, and none of them tilts")
        raise scenario.mistake(
            "controller.law", f"{reason}; choose full_pose, or geometric with tilts = free"
        )


def _check_fixed_rotors(scenario: ScenarioTables) -> None:
    keys = {"gait.type": "fixed", "gait": FixedGait()}
    keys |= {"vehicle.tilt_servo": TiltServoTable(), "vehicle.pod": PodTable()}
    if not scenario.controller.rotors_have_speeds:
        keys |= {"vehicle.min_rotor_speed": None, "vehicle.max_rotor_speed": None}
        keys["initial.rotor_speed"] = InitialTable().rotor_speed
    if not scenario.controller.is_external:
        keys["vehicle.rotor_inertia"] = 0.0
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
    for load in scenario.loads if vehicle.is_planar else ():
        reason = f"not supported for the {vehicle.model}; choose acceleration"
        raise InvalidValueError("disturbance.type", load.type, reason)
    supported = vehicle.model in {"tiltrotor", "multirotor"}
    for key, value, ideal in scenario.actuator_options:
        if value != ideal and not supported:
            raise InvalidValueError(key, value, f"not supported for the {vehicle.model}; remove it")
    for fault in scenario.fault:
        if fault.rotor > vehicle.rotor_count:
            reason = f"the vehicle has {vehicle.rotor_count} rotors"
            raise InvalidValueError("fault.rotor", fault.rotor, reason)
        fixed = supported and scenario.any_rotorcraft.tilt_of_rotor(fault.rotor) < 0
        if fault.type == "stuck_servo" and fixed:
            raise InvalidValueError("fault.rotor", fault.rotor, "is fixed and has no servo")
    faults = [(fault.rotor, fault.type == "stuck_servo") for fault in scenario.fault]
    for rotor, stuck in faults:
        if faults.count((rotor, stuck)) > 1:
            twice = "stuck servo" if stuck else "loss of thrust"
            raise InvalidValueError("fault.rotor", rotor, f"has more than one {twice}")
    if scenario.controller.measures_angular_acceleration:
        _check_measured_acceleration(scenario)
    if scenario.controller.prioritizes_attitude and not scenario.any_rotorcraft.has_rotor_limits:
        raise scenario.mistake(
            "controller.allocation",
            "needs rotor limits: vehicle.min_rotor_speed or vehicle.max_rotor_speed",
        )


def _check_measured_acceleration(scenario: ScenarioTables) -> None:
    """Refuse vehicles whose angular acceleration is not known before the controls."""
    vehicle = scenario.vehicle
    reason = 'not supported with controller.angular_acceleration = "measured"'
    scenario.require("ground", None, f"{reason}; remove it")
    if isinstance(vehicle, MultirotorTable):
        if scenario.simulation.plant == "mujoco" and not vehicle.file.pods_are_balanced:
            raise scenario.mistake(
                "simulation.plant",
                f"{reason} of a vehicle whose mass or inertia moves with its pods; use rigid_body, "
                "or balance the pods of vehicle.mjcf about their hinges",
            )
    else:
        scenario.require("vehicle.mjcf", None, f"{reason}; remove it")
    if scenario.any_rotorcraft.rotor_time_constant is None:
        lag = f"{reason} without lag; set vehicle.rotor_time_constant or remove it"
        scenario.require("vehicle.rotor_inertia", 0.0, lag)


def _check_layout(scenario: ScenarioTables) -> None:
    user_vehicle, external = scenario.any_rotorcraft.user_vehicle, scenario.controller.is_external
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
    if scenario.simulation.engine not in ("auto", "python"):
        raise scenario.mistake("simulation.engine", reason.format("python engine"))


def _check_model_error(scenario: ScenarioTables) -> None:
    error = scenario.model_error
    if error == ModelErrorTable():
        return
    if not isinstance(scenario.vehicle, RotorcraftTable):
        raise scenario.mistake(
            "vehicle.model", "[model_error] is supported for rotorcraft only; remove it"
        )
    if scenario.vehicle.mjcf is not None:
        scenario.require("model_error.arm_length", 1.0, "defined by vehicle.mjcf; remove it")
    vehicle = scenario.true_vehicle
    require_physical_inertia("model_error.inertia", list(error.inertia), vehicle.moments)


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
    if reference.turns and not controller.follows_turns:
        able = [law for law in laws_for(scenario.vehicle.model) if CONTROLLERS[law].follows_turns]
        reason = f"the {controller.law} law cannot follow roll, pitch and yaw that vary"
        choice = f"; choose {', '.join(able)}" if able else ""
        raise scenario.mistake("reference.type", f"{reason}{choice}")
    if reference.kind not in kinds:
        if reference.kind == "pose":
            key = "roll" if reference.roll else "pitch"
            reason = f"roll and pitch are not outputs of the {controller.law} law"
            raise scenario.mistake(f"reference.{key}", reason)
        raise scenario.mistake("reference.type", f"the {controller.law} law cannot track it")
    if abs(reference.roll) >= 0.5 * pi and not isinstance(controller, AttitudeForceController):
        reason = f"the {controller.law} law cannot turn it over; must be below pi/2"
        raise scenario.mistake("reference.roll", reason)
    if reference.type in {"waypoints", "table"} and scenario.vehicle.is_planar:
        raise scenario.mistake("reference.type", "the tilt_car's laws cannot track it")
    if reference.adds_acceleration and not controller.omits_reference_acceleration:
        own = isinstance(controller, AttitudeAltitudeController)
        option = " with gait_rate_feedforward" if own else ""
        raise scenario.mistake(
            "reference.acceleration_feedforward",
            f"the {controller.law} law{option} always includes all derivatives; set it to false",
        )
    if isinstance(controller, AttitudeAltitudeController):
        check_decoupler(scenario, controller.decoupler)


def _check_time_tables(scenario: ScenarioTables) -> None:
    duration = scenario.simulation.duration
    for name, table in scenario.time_tables.items():
        if table.ends_before(duration):
            last = table.table[-1][0]
            raise scenario.mistake(
                "simulation.duration",
                f"the {name} ends at {last:g} s; give its function again, {name}= of "
                f"tiltsim.load_scenario, or hold its last row: {name}.hold = true",
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
    # Its largest angle is a sum of polynomials and may exceed its own key by a rounding.
    if limit is not None and gait.amplitude > limit * (1.0 + 1e-12):
        raise mistake(
            f"tilts by {gait.amplitude:.4g} rad, beyond the servo limit "
            f"vehicle.tilt_servo.max_angle = {limit}"
        )
    knots = 0 if isinstance(scenario.gait, TableGait) else len(gait.knots)
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
    if isinstance(scenario.controller, AttitudeForceController):
        check_dimension(scenario, scenario.controller, gait)
    if isinstance(scenario.controller, FullPoseController):
        check_full_pose(scenario, scenario.controller, gait)
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
    user_vehicle = scenario.any_rotorcraft.user_vehicle
    if user_vehicle is not None and not user_vehicle.has_contact_geoms:
        raise scenario.mistake(
            "ground", "vehicle.mjcf needs a geom 'ground', and geoms whose names end in 'collision'"
        )
    if scenario.initial.position[2] < ground.height:
        raise scenario.mistake("initial.position", f"below ground.height = {ground.height}")


def _check_rotor_limits(scenario: ScenarioTables) -> None:
    if not isinstance(scenario.vehicle, RotorcraftTable):
        return
    if isinstance(scenario.vehicle, MultirotorTable) and scenario.initial.rotor_speed is None:
        return  # the speeds of hover
    low, high = scenario.vehicle.min_rotor_speed, scenario.vehicle.max_rotor_speed
    for speed in scenario.initial.rotor_speeds(scenario.vehicle.rotor_count):
        if (low is not None and speed < low) or (high is not None and speed > high):
            raise InvalidValueError(
                "initial.rotor_speed",
                speed,
                f"must lie within the rotor limits, {low or 0} to {high or 'any'} rad/s",
            )


def _check_claims(scenario: ScenarioTables) -> None:
    for expectation in scenario.expect:
        name = expectation.claim
        if re.match(NAME, name) and name not in scenario.claim:
            raise expectation.mistake("claim", "no such table; " + choose(name, scenario.claim))
