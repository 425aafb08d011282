"""Vehicles under commands from outside: from a user's controller or an environment.

The control law is to hold a `HeldCommand`; layers treat it as any controller's commands. The rotor
speeds of both vehicles are states here, so that commands may be speeds, thrusts or accelerations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, Columns, ControlSetup, Dynamics, Sampling, Sizes
from tiltsim.laws.full_pose import TILT_COMMANDS
from tiltsim.laws.quadrotor import constant_attitude_references, rigid_body_state, upright_margin
from tiltsim.laws.tiltrotor import (
    TILT_REFERENCE_COLUMNS,
    four,
    gait_servo_commands,
    initial_signed_rotor_speeds,
    observe_tiltrotor,
    refreshed_controls,
    rotor_thrust_controls,
    servo_lead,
    singularity_columns,
    tiltrotor_dynamics,
)
from tiltsim.vehicles.rotorcraft import OTHER_LAYOUT, ROTORCRAFT
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


class HeldCommand(NamedTuple):
    """The last command."""

    tilt_1: float = 0.0  # rad, for the servos
    tilt_2: float = 0.0
    tilt_3: float = 0.0
    tilt_4: float = 0.0
    acceleration_1: float = 0.0  # rad/s^2, of the rotors, with their signs
    acceleration_2: float = 0.0
    acceleration_3: float = 0.0
    acceleration_4: float = 0.0


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    vehicle: Vehicle
    gait: GaitParameters
    reference: ReferenceParameters
    command: HeldCommand = HeldCommand()  # the plant replaces it in its copy of the record


@scalar
def _commanded_tiltrotor_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All twelve controls of the tiltrotor."""
    command = parameters.command
    return (
        command.tilt_1,
        command.tilt_2,
        command.tilt_3,
        command.tilt_4,
        *rotor_thrust_controls(act),
        command.acceleration_1,
        command.acceleration_2,
        command.acceleration_3,
        command.acceleration_4,
    )


@scalar
def _commanded_quadrotor_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All eight controls of the quadrotor."""
    command = parameters.command
    return (
        *rotor_thrust_controls(act),
        command.acceleration_1,
        command.acceleration_2,
        command.acceleration_3,
        command.acceleration_4,
    )


@scalar
def _refreshed_quadrotor_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: LoopParameters
) -> Values:
    """Held controls with the thrusts of the present rotor speeds."""
    return (*rotor_thrust_controls(act), ctrl[4], ctrl[5], ctrl[6], ctrl[7])


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    rotorcraft, gait = plan.scenario.rotorcraft, plan.gait.parameters
    lead = servo_lead(rotorcraft.tilt_servo)
    held = HeldCommand(*gait_servo_commands(0.0, lead, gait, plan.knots))
    parameters = LoopParameters(signature, lead, rotorcraft.resolve(), gait, plan.reference, held)
    return ControlSetup(parameters, plan.knots)


def commanded_parameters(parameters: Any) -> LoopParameters:
    """The parameters of the vehicle under commands within those of its layers."""
    if isinstance(parameters, LoopParameters):
        return parameters
    return commanded_parameters(parameters.inner)


def with_command(parameters: Any, command: HeldCommand) -> Any:
    """Parameters of a vehicle under commands, within any layers, with this command."""
    if isinstance(parameters, LoopParameters):
        return parameters._replace(command=command)
    return parameters._replace(inner=with_command(parameters.inner, command))


@scalar
def _observe_commanded_quadrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The rigid body, no tilt, the rotor speeds, which are states here, no tilt rates."""
    body = rigid_body_state(qpos, qvel, 0.0, 0.0)[:12]
    return (*body, 0.0, 0.0, 0.0, 0.0, *four(act, 0), 0.0, 0.0, 0.0, 0.0)


@scalar
def _observe_commanded_tiltrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """A sample of any tiltrotor, and the commands of its servos."""
    return (*observe_tiltrotor(qpos, qvel, act, ctrl), *four(ctrl, 0))


def _derive_tiltrotor(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    commands = zip(TILT_REFERENCE_COLUMNS, TILT_COMMANDS, strict=True)
    return {
        **constant_attitude_references(samples, setup.parameters.reference, setup.knots),
        **{column: samples[name] for column, name in commands},
        **singularity_columns(samples, setup.parameters.vehicle),
    }


def _derive_quadrotor(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    return {
        **constant_attitude_references(samples, setup.parameters.reference, setup.knots),
        "determinant": np.cos(samples["roll"]),  # of the attitude-altitude law
        "singularity_margin": upright_margin(samples),
    }


def _follows_position(scenario: Scenario) -> bool:
    return scenario.reference.kind != "attitude_altitude"


TILTROTOR: Final = ClosedLoop(
    kind=ROTORCRAFT,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=tiltrotor_dynamics(),
    sampling=Sampling(_commanded_tiltrotor_controls, refreshed_controls),
    columns=Columns(
        _observe_commanded_tiltrotor,
        _derive_tiltrotor,
        fields=TILT_COMMANDS,
        units=dict.fromkeys(TILT_COMMANDS, "rad"),
    ),
    follows_position=_follows_position,
)
"""The tiltrotor under commands; those of its servos are part of a sample."""

QUADROTOR: Final = ClosedLoop(
    kind=ROTORCRAFT,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=Dynamics(
        "quadrotor",
        Sizes(qpos=7, qvel=6, act=4, ctrl=8),
        lambda plan, _setup: initial_signed_rotor_speeds(plan.scenario),
    ),
    sampling=Sampling(_commanded_quadrotor_controls, _refreshed_quadrotor_controls),
    columns=Columns(_observe_commanded_quadrotor, _derive_quadrotor),
    follows_position=_follows_position,
    uses_gait=False,
)
"""The quadrotor under commands."""

COMMANDED_LOOPS: Final[dict[str, ClosedLoop]] = {"tiltrotor": TILTROTOR, "quadrotor": QUADROTOR}
"""Loops under commands, by the vehicle's model."""

OTHER_LAYOUT_LOOPS: Final = {
    model: replace(loop, kind=OTHER_LAYOUT) for model, loop in COMMANDED_LOOPS.items()
}
"""Those of a user's vehicle with another layout."""
