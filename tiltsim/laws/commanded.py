"""Rotorcraft under commands from outside: from a user's controller or an environment.

The control law is to hold a command; layers treat it as any controller's commands. The rotor speeds
of all vehicles are states here, so that commands may be speeds, thrusts or accelerations.
"""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.law import Law
from tiltsim.laws.linearizing import TILTROTOR, singularity_columns
from tiltsim.laws.quadrotor import LAYOUT as QUADROTOR
from tiltsim.laws.quadrotor import upright_columns
from tiltsim.laws.rotor_loop import RotorLayout, layout_of_vehicle, rotor_loop, torque_free_columns
from tiltsim.laws.vehicle_loop import servo_lead
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.rotorcraft import EXTRA_COLUMNS
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import GaitParameters, planned_tilts
from tiltsim_controllers.laws.observed import Step
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import ROTOR_FLOATS

Singularity = Callable[[Mapping[str, Floats], Any], dict[str, Floats]]
"""``(samples, vehicle) -> columns``: how close a vehicle is to a singular attitude."""


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
def _commanded_loop(
    layout: RotorLayout, vehicle: Any, columns: tuple[str, ...], singularity: Singularity
) -> ClosedLoop:
    """The loop of the vehicles of a layout, with a type of parameters and columns of a margin."""
    rotors, tilts = layout.places
    planned, sent = layout.places.names("alpha_ref"), layout.places.names("tilt_command")
    command = make_record_type(
        "HeldCommand",
        tilts=vector_of(tilts),  # rad, for the servos
        accelerations=vector_of(rotors),  # rad/s^2, of the rotors, with their signs
    )
    record = make_record_type(
        "CommandedParameters",
        vehicle=vehicle,
        gait=GaitParameters,
        reference=ReferenceParameters,
        command=command,  # which the plant replaces in its copy of the record
    )

    def margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        commands = {column: samples[name] for column, name in zip(planned, sent, strict=True)}
        return {**commands, **singularity(samples, setup.parameters.law.vehicle)}

    def own(plan: FlightPlan) -> dict[str, Any]:
        table = plan.scenario.any_rotorcraft
        lead, flown = servo_lead(table.tilt_servo), table.resolve()
        commands = planned_servo_commands(0.0, tilts, plan.gait.parameters, plan.knots, lead)
        return {
            "vehicle": vehicle(flown.table) if isinstance(flown, Multirotor) else flown,
            "command": command(commands, (0.0,) * rotors),
        }

    law = Law(
        lambda _seen, p, _knots: Step(p.command.accelerations),
        record,
        own,
        tilts=lambda _seen, _rates, p, _knots: xp.stack([p.command.tilts, xp.zeros(tilts)], 1),
        units=dict.fromkeys(sent, "rad"),
        records_commands=True,
        columns=columns,
        margins=margins,
        follows_position=lambda scenario: scenario.reference.kind != "attitude_altitude",
    )
    return rotor_loop(layout, law)


@cache
def _multirotor(layout: RotorLayout) -> ClosedLoop:
    places = layout.places
    table = make_record_type("Rotors", table=vector_of(ROTOR_FLOATS * places.rotors))

    def singularity(samples: Mapping[str, Floats], rotors: Any) -> dict[str, Floats]:
        return torque_free_columns(places, rotors.table, samples)

    return _commanded_loop(layout, table, ("singularity_margin",), singularity)


def commanded_loop(scenario: Scenario) -> ClosedLoop:
    """The loop of a scenario's rotorcraft under commands, without layers.

    A user's vehicle without the four equal arms has no columns of singularity.
    """
    vehicle = scenario.vehicle.resolve()
    if isinstance(vehicle, Multirotor):
        return _multirotor(layout_of_vehicle(vehicle))
    columns = (*EXTRA_COLUMNS,) if scenario.rotorcraft.has_standard_layout else ()
    if scenario.vehicle.has_tilting_rotors:
        return _commanded_loop(TILTROTOR, Vehicle, columns, singularity_columns)
    return _commanded_loop(QUADROTOR, Vehicle, columns, upright_columns)
