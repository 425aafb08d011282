"""The yaw-position controller of the quadrotor (ch. 2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim.closed_loop.loop import Columns, ControlSetup, Monitoring
from tiltsim.equations.quadrotor import rigid_body
from tiltsim.laws.quadrotor import (
    EXTENSION_COLUMNS,
    EXTENSION_FIELDS,
    extended_controls,
    extended_loop,
    extended_singularity_columns,
    observe_extended_quadrotor,
    references,
    rigid_body_state,
    thrust_axis_cause,
    thrust_tilt_cosine,
)
from tiltsim.scenario.quadrotor_controllers import YawPositionController
from tiltsim_controllers.laws.yaw_position import Parameters, yaw_position_inputs
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    vehicle: Vehicle
    law: Parameters


@scalar
def _yaw_position_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All ten controls: thrusts, idle rotor states, the controller's states."""
    law = parameters.law
    state = rigid_body_state(qpos, qvel, act[4], act[5])
    return extended_controls(yaw_position_inputs(time, state, law, knots), law.vehicle)


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, YawPositionController)
    vehicle = plan.scenario.rotorcraft.resolve()
    law = Parameters(vehicle, controller.resolve_gains(), plan.reference)
    return ControlSetup(LoopParameters(signature, vehicle, law), plan.knots)


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    # Roll and pitch are not outputs: they follow from the position.
    attitude = (samples["roll"], samples["pitch"], law.reference.yaw)
    columns = references(samples, law.reference, setup.knots, attitude)
    return columns | extended_singularity_columns(samples, law.vehicle)


@scalar
def sign_check_values(
    time: float, values: Vector, parameters: LoopParameters, knots: Vector
) -> tuple[float, float]:
    """The cosine of the thrust axis's tilt and the extension's thrust."""
    return thrust_tilt_cosine(values), values[24]


@scalar
def _equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """The control law on the thesis's equations."""
    return yaw_position_inputs(
        time, (*rigid_body(state), state[12], state[13]), parameters.law, knots
    )


YAW_POSITION: Final = extended_loop(
    LoopParameters,
    _setup,
    _yaw_position_controls,
    _equation_inputs,
    Columns(
        observe_extended_quadrotor,
        _derive,
        fields=EXTENSION_FIELDS,
        units=EXTENSION_COLUMNS,
        observe_reads_controls=True,
    ),
    Monitoring(
        sign_check_values,
        lambda sample, setup: (
            *thrust_axis_cause(sample, setup),
            "the decoupling matrix became singular: the thrust came to zero",
        ),
    ),
)
"""The yaw-position controller of the quadrotor."""
