"""Rotorcraft under commands from outside: from a user's controller or an environment.

The control law is to hold a command; layers treat it as any controller's commands. The rotor speeds
of all vehicles are states here, so that commands may be speeds, thrusts or accelerations.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.law import Law, servo_lead
from tiltsim.laws.linearizing import TILTROTOR, singularity_columns
from tiltsim.laws.quadrotor import LAYOUT as QUADROTOR
from tiltsim.laws.quadrotor import upright_columns
from tiltsim.laws.rotor_loop import RotorLayout, layout_of_vehicle, margins_of, rotor_loop
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.rotorcraft import EXTRA_COLUMNS
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
