"""Checks between the tables of a scenario, each valid alone.

A check yields what it refuses: a key and the reason, and a value where it is not the key's own.
"""

import re
from math import pi
from typing import Final

from tiltsim.scenario.controller import CONTROLLERS, laws_for
from tiltsim.scenario.expectation import NAME
from tiltsim.scenario.gait import TableGait
from tiltsim.scenario.instruments import instrument_refusals
from tiltsim.scenario.interaction import check_companions, object_refusals, unknown_vehicle
from tiltsim.scenario.linearizing_controllers import (
    AttitudeAltitudeController,
    AttitudeForceController,
)
from tiltsim.scenario.messages import InvalidValueError, choose
from tiltsim.scenario.metric_names import split_metric
from tiltsim.scenario.reference import WaypointReference
from tiltsim.scenario.rotorcraft import MultirotorTable, RotorcraftTable
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim.scenario.table import Refusals
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
    for key, reason, *value in _refusals(scenario):
        raise InvalidValueError(key, value[0], reason) if value else scenario.mistake(key, reason)


def _refusals(scenario: ScenarioTables) -> Refusals:
    yield from _law(scenario)
    yield from _actuators(scenario)
    yield from _model_error(scenario)
    yield from _gait(scenario)
    yield from _reference(scenario)
    for name, table in scenario.time_tables.items():
        if table.ends_before(scenario.simulation.duration):
            hint = (
                f"give its function again, {name}= of tiltsim.load_scenario, or hold its last row"
            )
            reason = f"the {name} ends at {table.table[-1][0]:g} s; {hint}: {name}.hold = true"
            yield "simulation.duration", reason
    yield from _rotor_limits(scenario)
    yield from _ground(scenario)
    yield from instrument_refusals(scenario)
    yield from object_refusals(scenario)
    for expectation in scenario.expect:
        name, (vehicle, _) = expectation.claim, split_metric(expectation.metric)
        if reason := unknown_vehicle(vehicle, [table.name for table in scenario.companion]):
            yield "expect.metric", f"no vehicle {vehicle}; {reason}", expectation.metric
        if re.match(NAME, name) and name not in scenario.claim:
            yield "expect.claim", "no such table; " + choose(name, scenario.claim), name
    yield from _engine(scenario)
    scenario.controller.check_scenario(scenario)
    yield from _plant(scenario)
    check_companions(scenario)


def _engine(scenario: ScenarioTables) -> Refusals:
    if scenario.simulation.engine == "jax" and scenario.simulation.plant == "mujoco":
        reason = 'simulation.engine = "jax" is supported on the plants thesis and rigid_body'
        yield "simulation.plant", reason


def _plant(scenario: ScenarioTables) -> Refusals:
    """Vehicles that a plant of equations other than the thesis's cannot be."""
    vehicle, plant = scenario.vehicle, scenario.simulation.plant
    if plant in ("mujoco", "thesis"):
        return
    if not isinstance(vehicle, RotorcraftTable):
        yield "simulation.plant", f"supports no {vehicle.model}; use mujoco or thesis"
        return
    if isinstance(vehicle, VehicleTable):
        scenario.require("vehicle.pod", PodTable(), f"the {plant} plant has massless pods")
    file = vehicle.user_vehicle
    if file is not None and file.unmodeled_properties:
        reason = f"neglects of vehicle.mjcf {file.unmodeled_properties}; use mujoco"
        yield "simulation.plant", reason


def _law(scenario: ScenarioTables) -> Refusals:
    controller, vehicle = scenario.controller, scenario.vehicle
    if vehicle.model not in controller.vehicle_models:
        able = f"controls the {' or '.join(controller.vehicle_models)}, and vehicle.model = "
        yield (
            "controller.law",
            f"{able}{vehicle.model!r}; choose {', '.join(laws_for(vehicle.model))}",
        )
    speed, rotors = scenario.initial.rotor_speed, vehicle.rotor_count
    if isinstance(speed, tuple) and len(speed) != rotors:
        reason = f"the {vehicle.model} has {rotors} rotors; give one value or one each"
        yield "initial.rotor_speed", reason
    if not vehicle.is_planar:
        yield from _layout(scenario)
        if controller.is_external:
            reason = 'law = "python" is supported on the {} only'
            scenario.require("simulation.plant", "mujoco", reason.format("mujoco plant"))
            if scenario.simulation.engine not in ("auto", "python"):
                yield "simulation.engine", reason.format("python engine")
    yield from vehicle.refusals(scenario)


def _actuators(scenario: ScenarioTables) -> Refusals:
    vehicle, rotors = scenario.vehicle, scenario.vehicle.rotor_count
    if scenario.has_air and vehicle.is_planar:
        yield "vehicle.model", "aerodynamic effects are not supported; remove [air]"
    unsupported = f"not supported for the {vehicle.model}"
    for load in scenario.loads if vehicle.is_planar else ():
        yield "disturbance.type", f"{unsupported}; choose acceleration", load.type
    for key, value, ideal in scenario.actuator_options:
        if value != ideal and not vehicle.has_actuators:
            yield key, f"{unsupported}; remove it", value
    for fault in scenario.fault:
        if fault.rotor > rotors:
            yield "fault.rotor", f"the vehicle has {rotors} rotors", fault.rotor
        fixed = vehicle.has_actuators and scenario.any_rotorcraft.tilt_of_rotor(fault.rotor) < 0
        if fault.type == "stuck_servo" and fixed:
            yield "fault.rotor", "is fixed and has no servo", fault.rotor
    faults = [(fault.rotor, fault.type == "stuck_servo") for fault in scenario.fault]
    for rotor, stuck in faults:
        if faults.count((rotor, stuck)) > 1:
            twice = "stuck servo" if stuck else "loss of thrust"
            yield "fault.rotor", f"has more than one {twice}", rotor
    if scenario.controller.measures_angular_acceleration:
        yield from _measured_acceleration(scenario)
    if scenario.controller.prioritizes_attitude and not scenario.any_rotorcraft.has_rotor_limits:
        reason = "needs rotor limits: vehicle.min_rotor_speed or vehicle.max_rotor_speed"
        yield "controller.allocation", reason


def _measured_acceleration(scenario: ScenarioTables) -> Refusals:
    """Vehicles whose angular acceleration is not known before the controls."""
    vehicle = scenario.vehicle
    reason = 'not supported with controller.angular_acceleration = "measured"'
    scenario.require("ground", None, f"{reason}; remove it")
    if not isinstance(vehicle, MultirotorTable):
        scenario.require("vehicle.mjcf", None, f"{reason}; remove it")
    elif scenario.simulation.plant == "mujoco" and not vehicle.file.pods_are_balanced:
        moves = "of a vehicle whose mass or inertia moves with its pods; use rigid_body, or balance"
        yield "simulation.plant", f"{reason} {moves} the pods of vehicle.mjcf about their hinges"
    if scenario.any_rotorcraft.rotor_time_constant is None:
        lag = f"{reason} without lag; set vehicle.rotor_time_constant or remove it"
        scenario.require("vehicle.rotor_inertia", 0.0, lag)


def _layout(scenario: ScenarioTables) -> Refusals:
    file, controller = scenario.any_rotorcraft.user_vehicle, scenario.controller
    if file is None or not file.layout_mismatch:
        return
    if not controller.is_external:
        needs = f"the {controller.law} law needs four equal arms at right angles, law = "
        yield "vehicle.mjcf", f'{file.layout_mismatch}; {needs}"python" supports any layout'
    reason = f"{file.layout_mismatch}; needs four equal arms at right angles"
    scenario.require("vehicle.rotor_inertia", 0.0, reason)


def _model_error(scenario: ScenarioTables) -> Refusals:
    error = scenario.model_error
    if error == ModelErrorTable():
        return
    if not isinstance(scenario.vehicle, RotorcraftTable):
        yield "vehicle.model", "[model_error] is supported for rotorcraft only; remove it"
        return
    if scenario.vehicle.mjcf is not None:
        scenario.require("model_error.arm_length", 1.0, "defined by vehicle.mjcf; remove it")
    vehicle = scenario.true_vehicle
    require_physical_inertia("model_error.inertia", list(error.inertia), vehicle.moments)


def _reference(scenario: ScenarioTables) -> Refusals:
    controller, reference = scenario.controller, scenario.reference
    law, kinds = f"the {controller.law} law", {*controller.reference_kinds}
    if "pose" in kinds:
        kinds.add("position")  # a pose of zero roll and pitch is written like a position
    if reference.turns and not controller.follows_turns:
        able = [law for law in laws_for(scenario.vehicle.model) if CONTROLLERS[law].follows_turns]
        choice = f"; choose {', '.join(able)}" if able else ""
        yield "reference.type", f"{law} cannot follow roll, pitch and yaw that vary{choice}"
    if reference.kind not in kinds:
        if reference.kind == "pose":
            key = "roll" if reference.roll else "pitch"
            yield f"reference.{key}", f"roll and pitch are not outputs of {law}"
        yield "reference.type", f"{law} cannot track it"
    if abs(reference.roll) >= 0.5 * pi and not isinstance(controller, AttitudeForceController):
        yield "reference.roll", f"{law} cannot turn it over; must be below pi/2"
    if reference.type in {"waypoints", "table"} and scenario.vehicle.is_planar:
        yield "reference.type", f"the {scenario.vehicle.model}'s laws cannot track it"
    if reference.adds_acceleration and not controller.omits_reference_acceleration:
        own = isinstance(controller, AttitudeAltitudeController)
        option = " with gait_rate_feedforward" if own else ""
        reason = f"{law}{option} always includes all derivatives; set it to false"
        yield "reference.acceleration_feedforward", reason


def _gait(scenario: ScenarioTables) -> Refusals:
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
        yield key, f"tilts by {gait.amplitude:.4g} rad, {beyond}", value
    knots = 0 if isinstance(table, TableGait) else len(gait.knots)
    if knots > MAX_KNOTS:
        yield key, f"too many keyframes: {knots} numbers, at most {MAX_KNOTS}", value
    reference = scenario.reference
    total = knots + len(reference.knots)
    if isinstance(reference, WaypointReference) and total > MAX_KNOTS:
        reason = f"too many waypoints: {total} numbers with the gait's, at most {MAX_KNOTS}"
        yield "reference.times", reason, len(reference.times)
    if controller.commands_tilts and not gait.is_constant:
        give = "give the initial angles as a fixed gait"
        yield "gait.type", f"the {controller.law} law commands the tilts itself; {give}"


def _ground(scenario: ScenarioTables) -> Refusals:
    ground = scenario.ground
    if ground is None:
        return
    if scenario.vehicle.is_planar:
        yield "ground", f"not supported for the {scenario.vehicle.model}, which moves in a plane"
    reason = "its equations have no ground contact; use mujoco"
    scenario.require("simulation.plant", "mujoco", reason)
    file = scenario.any_rotorcraft.user_vehicle
    if file is not None and not file.has_contact_geoms:
        needs = "vehicle.mjcf needs a geom 'ground', and geoms whose names end in 'collision'"
        yield "ground", needs
    if scenario.initial.position[2] < ground.height:
        yield "initial.position", f"below ground.height = {ground.height}"


def _rotor_limits(scenario: ScenarioTables) -> Refusals:
    vehicle, initial = scenario.vehicle, scenario.initial
    if not isinstance(vehicle, RotorcraftTable):
        return
    if isinstance(vehicle, MultirotorTable) and initial.rotor_speed is None:
        return  # the speeds of hover
    low, high = vehicle.min_rotor_speed, vehicle.max_rotor_speed
    reason = f"must lie within the rotor limits, {low or 0} to {high or 'any'} rad/s"
    for speed in initial.rotor_speeds(vehicle.rotor_count):
        if (low is not None and speed < low) or (high is not None and speed > high):
            yield "initial.rotor_speed", reason, speed
