"""The yaw-position law around the quadrotor (ch. 2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim.closed_loop.loop import ControlSetup, SignCheck
from tiltsim.equations.quadrotor import extended_equations_of_motion, law_state
from tiltsim.laws.quadrotor import (
    equations,
    extended_controls,
    extended_loop,
    extended_singularity_columns,
    observe_extended_equations,
    references,
    rigid_body_state,
    thrust_axis_check,
    thrust_tilt_cosine,
)
from tiltsim.scenario.quadrotor_controllers import YawPositionController
from tiltsim_controllers.laws.yaw_position import Parameters, yaw_position_inputs
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    law: Parameters


@scalar
def yaw_position_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All ten controls: thrusts, idle rotor states, the law's own states."""
    law = parameters.law
    state = rigid_body_state(qpos, qvel, act[4], act[5])
    return extended_controls(yaw_position_inputs(time, state, law, knots), law.vehicle)


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, YawPositionController)
    law = Parameters(plan.scenario.rotorcraft.resolve(), controller.resolve_gains(), plan.reference)
    return ControlSetup(LoopParameters(signature, law), plan.knots)


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    # Roll and pitch are no outputs: they are what the position takes.
    attitude = (samples["roll"], samples["pitch"], law.reference.yaw)
    columns = references(samples, law.reference, setup.knots, attitude)
    return columns | extended_singularity_columns(samples, law.vehicle)


@scalar
def watch_attitude_and_extension(values: Vector, parameters: LoopParameters) -> tuple[float, float]:
    """The cosine of the thrust axis' tilt and the extension's thrust."""
    return thrust_tilt_cosine(values), values[24]


def extension_thrust_check(sample: Mapping[str, float]) -> SignCheck:
    """The thrust of the extension: without thrust the decoupling matrix is singular."""
    thrust = sample["extension_thrust"]
    return SignCheck(thrust, "the decoupling matrix became singular: the thrust came to zero")


@scalar
def equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """The law on the thesis's equations."""
    return yaw_position_inputs(time, law_state(state), parameters.law, knots)


@scalar
def equation_rates(
    time: float,
    state: Vector,
    inputs: Vector,
    parameters: LoopParameters,
    knots: Vector,
    disturbance: Triple,
) -> Values:
    """The thesis's equations under this law."""
    return extended_equations_of_motion(state, inputs, parameters.law.vehicle, disturbance)


@scalar
def observe_in_equations(
    time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """What a sample holds, from the state of the thesis's equations."""
    return observe_extended_equations(state, inputs, parameters.law.vehicle)


YAW_POSITION: Final = extended_loop(
    LoopParameters,
    yaw_position_controls,
    equations(equation_inputs, 6, equation_rates, observe_in_equations),
    setup=_setup,
    derive=_derive,
    watched=lambda sample, _setup: (thrust_axis_check(sample), extension_thrust_check(sample)),
    watch=watch_attitude_and_extension,
)
"""The yaw-position law around the quadrotor."""
