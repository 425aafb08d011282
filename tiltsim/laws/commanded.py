"""Rotorcraft under commands from outside: from a user's controller or an environment.

The control law is to hold a command; layers treat it as any controller's commands. The rotor speeds
of all vehicles are states here, so that commands may be speeds, thrusts or accelerations.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, Final

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, VehicleKind
from tiltsim.laws.law import Law
from tiltsim.laws.quadrotor import LAYOUT as QUADROTOR
from tiltsim.laws.quadrotor import upright_columns
from tiltsim.laws.rotor_loop import RotorLayout, layout_of_vehicle, rotor_loop, torque_free_columns
from tiltsim.laws.tiltrotor import LAYOUT, singularity_columns
from tiltsim.laws.vehicle_loop import servo_lead
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.rotorcraft import OTHER_LAYOUT, ROTORCRAFT, rotorcraft_kind
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import planned_tilts
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.laws.observed import Step
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.effectiveness import ROTOR_FLOATS
from tiltsim_controllers.vehicle.parameters import Vehicle

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


def _commanded_loop(
    layout: RotorLayout, kind: VehicleKind, vehicle: type, singularity: Singularity
) -> ClosedLoop:
    """The loop of a vehicle.

    Args:
        layout: Layout of its numbers.
        kind: Its kind, whose samples may have tilts that are idle.
        vehicle: The type of its parameters.
        singularity: Columns of the margin.
    """
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

    def setup(plan: FlightPlan) -> tuple[Any, Values]:
        table, gait = plan.scenario.any_rotorcraft, plan.gait.parameters
        lead, own = servo_lead(table.tilt_servo), table.resolve()
        commands = planned_servo_commands(0.0, tilts, gait, plan.knots, lead)
        held = command(commands, (0.0,) * rotors)
        flown = vehicle(own.table) if isinstance(own, Multirotor) else own
        return record(flown, gait, plan.reference, held), ()

    law = Law(
        lambda _seen, p, _knots: Step(p.command.accelerations),
        record,
        setup,
        tilts=lambda _seen, _rates, p, _knots: xp.stack([p.command.tilts, xp.zeros(tilts)], 1),
        units=dict.fromkeys(sent, "rad"),
        records_commands=True,
        margins=margins,
        follows_position=lambda scenario: scenario.reference.kind != "attitude_altitude",
    )
    return replace(rotor_loop(layout, law), kind=kind)


COMMANDED_LOOPS: Final[dict[str, ClosedLoop]] = {
    "tiltrotor": _commanded_loop(LAYOUT, ROTORCRAFT, Vehicle, singularity_columns),
    "quadrotor": _commanded_loop(QUADROTOR, ROTORCRAFT, Vehicle, upright_columns),
}
"""Loops under commands, by the vehicle's model; commands of its servos are part of a sample."""

OTHER_LAYOUT_LOOPS: Final = {
    model: replace(loop, kind=OTHER_LAYOUT) for model, loop in COMMANDED_LOOPS.items()
}
"""Loops of a user's vehicle with another layout."""


@cache
def _commanded_multirotor(layout: RotorLayout) -> ClosedLoop:
    places = layout.places
    table = make_record_type("Rotors", table=vector_of(ROTOR_FLOATS * places.rotors))

    def singularity(samples: Mapping[str, Floats], rotors: Any) -> dict[str, Floats]:
        return torque_free_columns(places, rotors.table, samples)

    kind = rotorcraft_kind(places, ("singularity_margin",))
    return _commanded_loop(layout, kind, table, singularity)


def commanded_loop(scenario: Scenario) -> ClosedLoop:
    """The loop of a scenario's rotorcraft under commands, without layers."""
    vehicle = scenario.vehicle.resolve()
    if isinstance(vehicle, Multirotor):
        return _commanded_multirotor(layout_of_vehicle(vehicle))
    loops = COMMANDED_LOOPS if scenario.rotorcraft.has_standard_layout else OTHER_LAYOUT_LOOPS
    return loops[scenario.vehicle.model]
