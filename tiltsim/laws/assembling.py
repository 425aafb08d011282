"""Which closed loop a scenario has, under a law or under commands from outside; its `Assembly`."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.equations.actuator_level import actuator_plant, rigid_body
from tiltsim.laws.companions import Member, with_companions
from tiltsim.laws.flown_law import loop_of_law
from tiltsim.laws.kinds import LOOPS_OF_KINDS
from tiltsim.laws.law import Law, servo_lead
from tiltsim.laws.layers.actuation import with_actuation
from tiltsim.laws.layers.contact import (
    with_force_loop,
    with_impedance,
    with_objects,
    with_swing_damping,
)
from tiltsim.laws.layers.estimation import Fusion, with_estimator
from tiltsim.laws.layers.forces import with_air, with_loads, with_rotor_inertia
from tiltsim.laws.layers.instruments import (
    instruments_of,
    with_instruments,
    with_measured_acceleration,
)
from tiltsim.laws.layers.layer import on_equations
from tiltsim.laws.linearizing import (
    TILTROTOR,
    full_pose_loop,
    multirotor_loop,
    singularity_columns,
    tiltrotor_loop,
)
from tiltsim.laws.quadrotor import LAYOUT as QUADROTOR
from tiltsim.laws.quadrotor import (
    QUADROTOR_ATTITUDE_ALTITUDE,
    SWITCHING,
    YAW_POSITION,
    upright_columns,
)
from tiltsim.laws.rotor_loop import RotorLayout, layout_of_vehicle, margins_of, rotor_loop
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.law_controller import LawTable
from tiltsim.scenario.linearizing_controllers import AttitudeForceController
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.system.files import one_thread_at_a_time
from tiltsim.vehicles.rotorcraft import EXTRA_COLUMNS
from tiltsim.vehicles.rotorcraft.others import others_of
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import GaitParameters, planned_tilts
from tiltsim_controllers.laws.observed import Step
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.body import Body
from tiltsim_controllers.vehicle.parameters import Vehicle


def commanded_parameters(parameters: Any) -> Any:
    """The parameters of the vehicle under commands, within the parameters of its layers."""
    inner = getattr(parameters, "inner", None)
    return parameters.law if inner is None else commanded_parameters(inner)


def with_command(parameters: Any, command: Values) -> Any:
    """Parameters of a vehicle under commands, within any layers, with this command.

    ``command`` are tilt angles (rad), then accelerations of the rotors (rad/s^2).
    """
    if hasattr(parameters, "inner"):
        return parameters._replace(inner=with_command(parameters.inner, command))
    law = parameters.law
    tilts = len(law.command.tilts)
    held = type(law.command)(command[:tilts], command[tilts:])
    return parameters._replace(law=law._replace(command=held))


def planned_servo_commands(
    time: float, tilts: int, gait: GaitParameters, knots: Vector, lead: float
) -> Values:
    """Commands (rad) of tilt servos, ahead of a gait by their lag.

    Args:
        time: s.
        tilts: Number of tilts.
        gait, knots: The gait and its table data.
        lead: Lag of the servos, s.
    """
    planned = planned_tilts(time, gait, tuple(knots), tilts)
    return tuple(angle + lead * rate for angle, rate, _ in planned)


@cache
def _commanded_loop(layout: RotorLayout, columns: tuple[str, ...]) -> ClosedLoop:
    """The loop of the vehicles of a layout, with columns among `EXTRA_COLUMNS`."""
    rotors, tilts = layout.places
    planned, sent = layout.places.names("alpha_ref"), layout.places.names("tilt_command")
    command = make_record_type(
        "HeldCommand",
        tilts=vector_of(tilts),  # rad, for the servos
        accelerations=vector_of(rotors),  # rad/s^2, of the rotors, with their signs
    )
    record = make_record_type(
        "CommandedParameters",
        vehicle=Vehicle if layout.cross else Body,
        rotors=float,  # where in the knots the table of the rotors begins
        gait=GaitParameters,
        reference=ReferenceParameters,
        command=command,  # which the plant replaces in its copy of the record
    )
    on_cross = singularity_columns if tilts else upright_columns

    def margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        commands = {column: samples[name] for column, name in zip(planned, sent, strict=True)}
        if layout.cross:
            return {**commands, **on_cross(samples, setup.parameters.law.vehicle)}
        return {**commands, **margins_of(layout)(samples, setup)}

    def held(plan: FlightPlan) -> dict[str, Any]:
        lead = servo_lead(plan.scenario.any_rotorcraft.tilt_servo)
        commands = planned_servo_commands(0.0, tilts, plan.gait.parameters, plan.knots, lead)
        return {"command": command(commands, (0.0,) * rotors)}

    law = Law(
        lambda _seen, p, _knots: Step(p.command.accelerations),
        record,
        held,
        lambda plan: plan.scenario.any_rotorcraft.multirotor.table,
        tilts=lambda _seen, _rates, p, _knots: xp.stack([p.command.tilts, xp.zeros(tilts)], 1),
        units=dict.fromkeys(sent, "rad"),
        records_commands=True,
        columns=columns,
        margins=margins,
        follows_position=lambda scenario: scenario.reference.kind != "attitude_altitude",
    )
    return rotor_loop(layout, law)


def commanded_loop(scenario: Scenario) -> ClosedLoop:
    """The loop of a scenario's rotorcraft under commands, without layers.

    A user's vehicle without the four equal arms has no columns of singularity.
    """
    vehicle = scenario.any_rotorcraft
    if not vehicle.cross:
        return _commanded_loop(layout_of_vehicle(vehicle.multirotor), ("singularity_margin",))
    columns = (*EXTRA_COLUMNS,) if scenario.rotorcraft.has_standard_layout else ()
    return _commanded_loop(TILTROTOR if vehicle.has_tilting_rotors else QUADROTOR, columns)


# --- under laws ----------------------------------------------------------------------------------

LOOPS: Final[dict[str, ClosedLoop]] = {
    "attitude_altitude": tiltrotor_loop("attitude_altitude", False, "", False),
    # the same law with gait_rate_feedforward = true
    "gait_feedforward": tiltrotor_loop("gait_feedforward", False, "", False),
    "full_pose": full_pose_loop(TILTROTOR),
    "yaw_position": YAW_POSITION,
    "switching": SWITCHING,
    "quadrotor_attitude_altitude": QUADROTOR_ATTITUDE_ALTITUDE,
    **LOOPS_OF_KINDS,
}
"""Loops by their names; see `tiltsim.scenario.controller_table.ControllerTable.loop_name`."""


def _linearizing_loop(scenario: Scenario, measured: bool) -> ClosedLoop:
    """The loop of a law by feedback linearization, whose options and layout choose it."""
    controller, vehicle = scenario.controller, scenario.vehicle.resolve()
    strategy = controller.supervision.strategy if controller.supervision else ""
    options = measured, strategy, controller.prioritizes_attitude
    if not isinstance(vehicle, Multirotor):
        return tiltrotor_loop(controller.loop_name, *options)
    layout = layout_of_vehicle(vehicle)
    if not isinstance(controller, AttitudeForceController):
        return full_pose_loop(layout)
    form = controller.resolve_force(vehicle, scenario.gait.plan(vehicle))
    return multirotor_loop(layout, form, *options)


@one_thread_at_a_time
def loop_of(
    scenario: Scenario,
    adapted: Callable[[ClosedLoop], ClosedLoop] = lambda loop: loop,
    *,
    recorded: bool = False,
) -> ClosedLoop:
    """The closed loop of a scenario: its controller inside layers for all that is not ideal.

    Args:
        scenario: The scenario to fly.
        adapted: May change each controller, the first vehicle's first, before layers go around it.
        recorded: See `assemble`.
    """
    controller, external = scenario.controller, scenario.controller.is_external
    plant = scenario.simulation.plant
    # The thesis's equations have no torque but the model's, as long as all is ideal.
    as_printed = plant == "thesis" and scenario.has_ideal_actuators_in_still_air
    measured = not as_printed and controller.measures_angular_acceleration
    any_layout = isinstance(scenario.vehicle.resolve(), Multirotor)
    if external:
        loop = commanded_loop(scenario)
    elif isinstance(controller, LawTable):
        loop = loop_of_law(scenario, recorded=recorded)
    elif any_layout or controller.law == "attitude_altitude":
        loop = _linearizing_loop(scenario, measured)
    else:
        loop = LOOPS[controller.loop_name]
    loop = adapted(loop)
    if controller.estimator is not None:
        loop = with_estimator(loop, Fusion(instruments_of(scenario)))
    if scenario.reference.type == "push" and not external:
        loop = (with_impedance if scenario.reference.impedance else with_force_loop)(loop)
    if scenario.payload is not None and scenario.payload.swing_damping and not external:
        loop = with_swing_damping(loop)
    if scenario.needs_actuation_layer:
        loop = with_actuation(loop, scenario.simulation.latency_steps, external)
    if scenario.has_air:
        loop = with_air(loop)
    if scenario.loads:
        loop = with_loads(loop, len(scenario.loads))
    if scenario.has_rotor_inertia:
        loop = with_rotor_inertia(loop)
    if scenario.sensors.instruments:
        loop = with_instruments(loop, instruments_of(scenario))
    if measured:
        loop = with_measured_acceleration(loop)
    if scenario.has_objects:
        loop = with_objects(loop, others_of(scenario))
    if scenario.companion:
        vehicles, names = (scenario, *scenario.companions), (t.name for t in scenario.companion)
        loops = loop, *(loop_of(each, adapted, recorded=recorded) for each in vehicles[1:])
        found = zip(("", *names), loops, map(plan_flight, vehicles), strict=True)
        return with_companions(
            tuple(Member(n, own, len(own.setup(plan, 0.0).knots)) for n, own, plan in found),
            scenario.downwash is not None,
        )
    if plant == "mujoco" or as_printed:
        return loop
    if plant == "thesis":
        return on_equations(loop, actuator_plant(loop))
    return on_equations(loop, rigid_body(loop, scenario.any_rotorcraft))


def assemble(
    scenario: Scenario,
    adapted: Callable[[ClosedLoop], ClosedLoop] = lambda loop: loop,
    *,
    recorded: bool = False,
) -> Assembly:
    """Plan the flight of a scenario and set up its closed loop.

    Args:
        scenario: The scenario to fly.
        adapted: See `loop_of`.
        recorded: Whether its samples are there already: all of the loop but a user's function is
            then at hand, and no code that the scenario names is executed.
    """
    plan, loop = plan_flight(scenario), loop_of(scenario, adapted, recorded=recorded)
    return Assembly(
        **vars(plan),
        loop=loop,
        setup=loop.setup(plan, loop.signature),
        follows_position=loop.follows_position(scenario),
        traced=loop.is_traceable,
    )
