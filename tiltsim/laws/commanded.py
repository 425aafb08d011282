"""Rotorcraft under commands from outside: from a user's controller or an environment.

The control law is to hold a command; layers treat it as any controller's commands. The rotor speeds
of all vehicles are states here, so that commands may be speeds, thrusts or accelerations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, Columns, ControlSetup, Dynamics, Sampling
from tiltsim.closed_loop.vehicle_kind import VehicleKind
from tiltsim.laws.quadrotor import references, upright_margin
from tiltsim.laws.rotorcraft import (
    held_controls_of,
    observed_of,
    servo_commands_of,
    servo_lead,
    thrust_controls_of,
    torque_free_columns,
)
from tiltsim.laws.tiltrotor import singularity_columns
from tiltsim.models.rotor_table import Multirotor
from tiltsim.vehicles.rotorcraft import (
    OTHER_LAYOUT,
    ROTORCRAFT,
    initial_rotor_speeds,
    rotorcraft_kind,
)
from tiltsim.vehicles.rotorcraft.layout import CROSS, Layout
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.effectiveness import ROTOR_FLOATS, tilts_of
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario

Singularity = Callable[[Mapping[str, Floats], Any], dict[str, Floats]]
"""``(samples, vehicle) -> columns``: how close a vehicle is to a singular attitude."""


@cache
def _parameters_of(layout: Layout, vehicle: type) -> Any:
    """The head of `userdata`; the plant replaces the ``command`` in its copy of the record."""
    command = make_record_type(
        "HeldCommand",
        tilts=vector_of(layout.tilts),  # rad, for the servos
        accelerations=vector_of(layout.rotors),  # rad/s^2, of the rotors, with their signs
    )
    return make_record_type(
        "LoopParameters",
        signature=float,  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
        servo_lead=float,  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
        vehicle=vehicle,
        gait=GaitParameters,
        reference=ReferenceParameters,
        command=command,
    )


def commanded_parameters(parameters: Any) -> Any:
    """The parameters of the vehicle under commands, within the parameters of its layers."""
    inner = getattr(parameters, "inner", None)
    return parameters if inner is None else commanded_parameters(inner)


def with_command(parameters: Any, command: Values) -> Any:
    """Parameters of a vehicle under commands, within any layers, with this command.

    ``command`` are tilt angles (rad), then accelerations of the rotors (rad/s^2).
    """
    if hasattr(parameters, "inner"):
        return parameters._replace(inner=with_command(parameters.inner, command))
    held = parameters.command
    tilts = len(held.tilts)
    return parameters._replace(command=type(held)(command[:tilts], command[tilts:]))


def _commanded_loop(
    model: str,
    layout: Layout,
    kind: VehicleKind,
    vehicle: type,
    singularity: Singularity,
    spins: Values = SPIN,
    tilt_of_rotor: tuple[int, ...] = (),
) -> ClosedLoop:
    """The loop of a vehicle.

    Args:
        model, spins, tilt_of_rotor: See `Dynamics`.
        layout: Layout of its numbers.
        kind: Its kind, whose samples may have tilts that are idle.
        vehicle: The type of its parameters.
        singularity: Columns of the margin.
    """
    rotors, tilts = layout
    planned, fields = layout.names("alpha_ref"), layout.names("tilt_command")
    idle = (len(kind.observed_fields) - len(layout.observed_fields)) // 2
    shown = layout._replace(tilts=tilts + idle)
    observed = observed_of(layout, shown, 0)
    thrusts, servo_commands = thrust_controls_of(spins), servo_commands_of(tilts)

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        command = parameters.command
        return xp.hstack([command.tilts, thrusts(act), command.accelerations])

    @traceable
    def observe(qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        return xp.hstack([observed(qpos, qvel, act), ctrl[:tilts]])

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        reference, names = setup.parameters.reference, shown.names("alpha_ref")
        return {
            **references(samples, reference, setup.knots, tilts=names),
            **{column: samples[name] for column, name in zip(planned, fields, strict=True)},
            **singularity(samples, setup.parameters.vehicle),
        }

    def setup(plan: FlightPlan, signature: float) -> ControlSetup:
        table, gait = plan.scenario.any_rotorcraft, plan.gait.parameters
        own, lead = table.resolve(), servo_lead(table.tilt_servo)
        record = _parameters_of(layout, vehicle)
        held = servo_commands(0.0, lead, gait, plan.knots), (0.0,) * rotors
        command = record.__annotations__["command"](*held)
        flown = vehicle(own.table) if isinstance(own, Multirotor) else own
        return ControlSetup(
            record(signature, lead, flown, gait, plan.reference, command), plan.knots
        )

    return ClosedLoop(
        kind=kind,
        parameters=_parameters_of(layout, vehicle),
        setup=setup,
        dynamics=Dynamics(
            model,
            layout.sizes(),
            lambda plan, _setup: initial_rotor_speeds(plan),
            spins=spins,
            tilt_of_rotor=tilt_of_rotor,
        ),
        sampling=Sampling(controls, held_controls_of(spins, tilts)),
        columns=Columns(observe, derive, fields=fields, units=dict.fromkeys(fields, "rad")),
        follows_position=lambda scenario: scenario.reference.kind != "attitude_altitude",
        uses_gait=tilts > 0,
    )


def _upright(samples: Mapping[str, Floats], _vehicle: Vehicle) -> dict[str, Floats]:
    """Determinant of the quadrotor's attitude-altitude law, and its margin."""
    return {"determinant": np.cos(samples["roll"]), "singularity_margin": upright_margin(samples)}


TILTROTOR: Final = _commanded_loop("tiltrotor", CROSS, ROTORCRAFT, Vehicle, singularity_columns)
"""The tiltrotor under commands; commands of its servos are part of a sample."""

QUADROTOR: Final = _commanded_loop(
    "quadrotor", CROSS._replace(tilts=0), ROTORCRAFT, Vehicle, _upright
)
"""The quadrotor under commands."""

COMMANDED_LOOPS: Final[dict[str, ClosedLoop]] = {"tiltrotor": TILTROTOR, "quadrotor": QUADROTOR}
"""Loops under commands, by the vehicle's model."""

OTHER_LAYOUT_LOOPS: Final = {
    model: replace(loop, kind=OTHER_LAYOUT) for model, loop in COMMANDED_LOOPS.items()
}
"""Loops of a user's vehicle with another layout."""


@cache
def _commanded_multirotor(spins: Values, tilt_of_rotor: tuple[int, ...]) -> ClosedLoop:
    layout = Layout(len(spins), tilts_of(tilt_of_rotor))
    table = make_record_type("Rotors", table=vector_of(ROTOR_FLOATS * layout.rotors))

    def singularity(samples: Mapping[str, Floats], rotors: Any) -> dict[str, Floats]:
        return torque_free_columns(layout, rotors.table, samples)

    kind = rotorcraft_kind(layout, ("singularity_margin",))
    model = f"multirotor_{layout.tilts}"
    return _commanded_loop(model, layout, kind, table, singularity, spins, tilt_of_rotor)


def commanded_loop(scenario: Scenario) -> ClosedLoop:
    """The loop of a scenario's rotorcraft under commands, without layers."""
    vehicle = scenario.vehicle.resolve()
    if isinstance(vehicle, Multirotor):
        return _commanded_multirotor(vehicle.spins, vehicle.tilt_of_rotor)
    loops = COMMANDED_LOOPS if scenario.rotorcraft.has_standard_layout else OTHER_LAYOUT_LOOPS
    return loops[scenario.vehicle.model]
