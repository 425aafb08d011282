"""Checks between the tables of a scenario, each valid alone."""

import re
from math import pi
from typing import Final

from tiltsim.scenario.controller import CONTROLLERS, laws_for
from tiltsim.scenario.expectation import NAME
from tiltsim.scenario.gait import TableGait
from tiltsim.scenario.instruments import check_instruments
from tiltsim.scenario.interaction import check_companions, check_objects, unknown_vehicle
from tiltsim.scenario.linearizing_controllers import (
    AttitudeAltitudeController,
    AttitudeForceController,
)
from tiltsim.scenario.messages import InvalidValueError, choose
from tiltsim.scenario.metric_names import split_metric
from tiltsim.scenario.reference import WaypointReference
from tiltsim.scenario.rotorcraft import MultirotorTable, RotorcraftTable
from tiltsim.scenario.scenario_tables import ScenarioTables
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
    _law(scenario)
    _actuators(scenario)
    _model_error(scenario)
    _gait(scenario)
    _reference(scenario)
    for name, table in scenario.time_tables.items():
        if table.ends_before(scenario.simulation.duration):
            hint = (
                f"give its function again, {name}= of tiltsim.load_scenario, or hold its last row"
            )
            reason = f"the {name} ends at {table.table[-1][0]:g} s; {hint}: {name}.hold = true"
            scenario.refuse("simulation.duration", reason)
    _rotor_limits(scenario)
    _ground(scenario)
    check_instruments(scenario)
    check_objects(scenario)
    for expectation in scenario.expect:
        name, (vehicle, _) = expectation.claim, split_metric(expectation.metric)
        if reason := unknown_vehicle(vehicle, [table.name for table in scenario.companion]):
            scenario.refuse("expect.metric", f"no vehicle {vehicle}; {reason}", expectation.metric)
        if re.match(NAME, name) and name not in scenario.claim:
            scenario.refuse("expect.claim", "no such table; " + choose(name, scenario.claim), name)
    scenario.controller.check_scenario(scenario)
    _plant(scenario)
    check_companions(scenario)


def _plant(scenario: ScenarioTables) -> None:
    """Vehicles that a plant of equations other than the thesis's cannot be."""
    vehicle, plant = scenario.vehicle, scenario.simulation.plant
    if scenario.simulation.engine == "jax" and plant == "mujoco":
        reason = 'simulation.engine = "jax" is supported on the plants thesis and rigid_body'
        scenario.refuse("simulation.plant", reason)
    if plant in ("mujoco", "thesis"):
        return
    if not isinstance(vehicle, RotorcraftTable):
        scenario.refuse("simulation.plant", f"supports no {vehicle.model}; use mujoco or thesis")
    if isinstance(vehicle, VehicleTable):
        scenario.require("vehicle.pod", PodTable(), f"the {plant} plant has massless pods")
    file = vehicle.user_vehicle
    if file is not None and file.unmodeled_properties:
        reason = f"neglects of vehicle.mjcf {file.unmodeled_properties}; use mujoco"
        scenario.refuse("simulation.plant", reason)


def _law(scenario: ScenarioTables) -> None:
    controller, vehicle = scenario.controller, scenario.vehicle
    if vehicle.model not in controller.vehicle_models:
        able = f"controls the {' or '.join(controller.vehicle_models)}, and vehicle.model = "
        scenario.refuse(
            "controller.law",
            f"{able}{vehicle.model!r}; choose {', '.join(laws_for(vehicle.model))}",
        )
    speed, rotors = scenario.initial.rotor_speed, vehicle.rotor_count
    if isinstance(speed, tuple) and len(speed) != rotors:
        reason = f"the {vehicle.model} has {rotors} rotors; give one value or one each"
        scenario.refuse("initial.rotor_speed", reason)
    if not vehicle.is_planar:
        _layout(scenario)
        if controller.is_external:
            reason = 'law = "python" is supported on the {} only'
            scenario.require("simulation.plant", "mujoco", reason.format("mujoco plant"))
            if scenario.simulation.engine not in ("auto", "python"):
                scenario.refuse("simulation.engine", reason.format("python engine"))
    vehicle.check_scenario(scenario)


def _actuators(scenario: ScenarioTables) -> None:
    vehicle, rotors = scenario.vehicle, scenario.vehicle.rotor_count
    if scenario.has_air and vehicle.is_planar:
        scenario.refuse("vehicle.model", "aerodynamic effects are not supported; remove [air]")
    unsupported = f"not supported for the {vehicle.model}"
    for load in scenario.loads if vehicle.is_planar else ():
        scenario.refuse("disturbance.type", f"{unsupported}; choose acceleration", load.type)
    for key, value, ideal in scenario.actuator_options:
        if value != ideal and not vehicle.has_actuators:
            scenario.refuse(key, f"{unsupported}; remove it", value)
    for fault in scenario.fault:
        if fault.rotor > rotors:
            scenario.refuse("fault.rotor", f"the vehicle has {rotors} rotors", fault.rotor)
        fixed = vehicle.has_actuators and scenario.any_rotorcraft.tilt_of_rotor(fault.rotor) < 0
        if fault.type == "stuck_servo" and fixed:
            scenario.refuse("fault.rotor", "is fixed and has no servo", fault.rotor)
    faults = [(fault.rotor, fault.type == "stuck_servo") for fault in scenario.fault]
    for rotor, stuck in faults:
        if faults.count((rotor, stuck)) > 1:
            twice = "stuck servo" if stuck else "loss of thrust"
            scenario.refuse("fault.rotor", f"has more than one {twice}", rotor)
    if scenario.controller.measures_angular_acceleration:
        _measured_acceleration(scenario)
    if scenario.controller.prioritizes_attitude and not scenario.any_rotorcraft.has_rotor_limits:
        reason = "needs rotor limits: vehicle.min_rotor_speed or vehicle.max_rotor_speed"
        scenario.refuse("controller.allocation", reason)


def _measured_acceleration(scenario: ScenarioTables) -> None:
    """Vehicles whose angular acceleration is not known before the controls."""
    vehicle = scenario.vehicle
    reason = 'not supported with controller.angular_acceleration = "measured"'
    scenario.require("ground", None, f"{reason}; remove it")
    if not isinstance(vehicle, MultirotorTable):
        scenario.require("vehicle.mjcf", None, f"{reason}; remove it")
    elif scenario.simulation.plant == "mujoco" and not vehicle.file.pods_are_balanced:
        moves = "of a vehicle whose mass or inertia moves with its pods; use rigid_body, or balance"
        scenario.refuse(
            "simulation.plant", f"{reason} {moves} the pods of vehicle.mjcf about their hinges"
        )
    if scenario.any_rotorcraft.rotor_time_constant is None:
        lag = f"{reason} without lag; set vehicle.rotor_time_constant or remove it"
        scenario.require("vehicle.rotor_inertia", 0.0, lag)


def _layout(scenario: ScenarioTables) -> None:
    file, controller = scenario.any_rotorcraft.user_vehicle, scenario.controller
    if file is None or not file.layout_mismatch:
        return
    if not controller.is_external:
        needs = f"the {controller.law} law needs four equal arms at right angles, law = "
        scenario.refuse(
            "vehicle.mjcf", f'{file.layout_mismatch}; {needs}"python" supports any layout'
        )
    reason = f"{file.layout_mismatch}; needs four equal arms at right angles"
    scenario.require("vehicle.rotor_inertia", 0.0, reason)


def _model_error(scenario: ScenarioTables) -> None:
    error = scenario.model_error
    if error == ModelErrorTable():
        return
    if not isinstance(scenario.vehicle, RotorcraftTable):
        scenario.refuse(
            "vehicle.model", "[model_error] is supported for rotorcraft only; remove it"
        )
    if scenario.vehicle.mjcf is not None:
        scenario.require("model_error.arm_length", 1.0, "defined by vehicle.mjcf; remove it")
    vehicle = scenario.true_vehicle
    require_physical_inertia("model_error.inertia", list(error.inertia), vehicle.moments)


def _reference(scenario: ScenarioTables) -> None:
    controller, reference = scenario.controller, scenario.reference
    law, kinds = f"the {controller.law} law", {*controller.reference_kinds}
    if "pose" in kinds:
        kinds.add("position")  # a pose of zero roll and pitch is written like a position
    if reference.turns and not controller.follows_turns:
        able = [law for law in laws_for(scenario.vehicle.model) if CONTROLLERS[law].follows_turns]
        choice = f"; choose {', '.join(able)}" if able else ""
        scenario.refuse(
            "reference.type", f"{law} cannot follow roll, pitch and yaw that vary{choice}"
        )
    if reference.kind not in kinds:
        if reference.kind == "pose":
            key = "roll" if reference.roll else "pitch"
            scenario.refuse(f"reference.{key}", f"roll and pitch are not outputs of {law}")
        scenario.refuse("reference.type", f"{law} cannot track it")
    if abs(reference.roll) >= 0.5 * pi and not isinstance(controller, AttitudeForceController):
        scenario.refuse("reference.roll", f"{law} cannot turn it over; must be below pi/2")
    if reference.type in {"waypoints", "table"} and scenario.vehicle.is_planar:
        scenario.refuse("reference.type", f"the {scenario.vehicle.model}'s laws cannot track it")
    if reference.adds_acceleration and not controller.omits_reference_acceleration:
        own = isinstance(controller, AttitudeAltitudeController)
        option = " with gait_rate_feedforward" if own else ""
        reason = f"{law}{option} always includes all derivatives; set it to false"
        scenario.refuse("reference.acceleration_feedforward", reason)


def _gait(scenario: ScenarioTables) -> None:
    table, controller = scenario.gait, scenario.controller
    size, value = table.size
    key = f"gait.{size}"
    try:
        gait = table.plan(scenario.vehicle.resolve())
    except InvalidValueError:  # of another key than its size
        raise
    except ValueError as error:
        raise InvalidValueError(key, value, str(error)) from None
    limit = scenario.vehicle.tilt_servo.angle_limit
    # Its largest angle is a sum of polynomials and may exceed its own key by a rounding.
    if limit is not None and gait.amplitude > limit * (1.0 + 1e-12):
        beyond = f"beyond the servo limit vehicle.tilt_servo.max_angle = {limit}"
        scenario.refuse(key, f"tilts by {gait.amplitude:.4g} rad, {beyond}", value)
    knots = 0 if isinstance(table, TableGait) else len(gait.knots)
    if knots > MAX_KNOTS:
        scenario.refuse(key, f"too many keyframes: {knots} numbers, at most {MAX_KNOTS}", value)
    reference = scenario.reference
    total = knots + len(reference.knots)
    if isinstance(reference, WaypointReference) and total > MAX_KNOTS:
        reason = f"too many waypoints: {total} numbers with the gait's, at most {MAX_KNOTS}"
        scenario.refuse("reference.times", reason, len(reference.times))
    if controller.commands_tilts and not gait.is_constant:
        give = "give the initial angles as a fixed gait"
        scenario.refuse("gait.type", f"the {controller.law} law commands the tilts itself; {give}")


def _ground(scenario: ScenarioTables) -> None:
    ground = scenario.ground
    if ground is None:
        return
    if scenario.vehicle.is_planar:
        scenario.refuse(
            "ground", f"not supported for the {scenario.vehicle.model}, which moves in a plane"
        )
    reason = "its equations have no ground contact; use mujoco"
    scenario.require("simulation.plant", "mujoco", reason)
    file = scenario.any_rotorcraft.user_vehicle
    if file is not None and not file.has_contact_geoms:
        needs = "vehicle.mjcf needs a geom 'ground', and geoms whose names end in 'collision'"
        scenario.refuse("ground", needs)
    if scenario.initial.position[2] < ground.height:
        scenario.refuse("initial.position", f"below ground.height = {ground.height}")


def _rotor_limits(scenario: ScenarioTables) -> None:
    vehicle, initial = scenario.vehicle, scenario.initial
    if not isinstance(vehicle, RotorcraftTable):
        return
    if isinstance(vehicle, MultirotorTable) and initial.rotor_speed is None:
        return  # the speeds of hover
    low, high = vehicle.min_rotor_speed, vehicle.max_rotor_speed
    reason = f"must lie within the rotor limits, {low or 0} to {high or 'any'} rad/s"
    for speed in initial.rotor_speeds(vehicle.rotor_count):
        if (low is not None and speed < low) or (high is not None and speed > high):
            scenario.refuse("initial.rotor_speed", reason, speed)
