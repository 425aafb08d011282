"""The attitude-altitude controller of the quadrotor (ch. 2, Appendix B)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Monitoring,
    Sampling,
    Sizes,
)
from tiltsim.equations.quadrotor import initial_state, rigid_body
from tiltsim.laws.quadrotor import (
    equation_rates,
    observe_equations,
    observe_quadrotor,
    references,
    rigid_body_state,
    thrust_axis_cause,
    thrust_axis_value,
    upright_margin,
)
from tiltsim.scenario.quadrotor_controllers import QuadrotorAttitudeAltitudeController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim_controllers.laws.quadrotor_attitude_altitude import Gains, attitude_altitude_inputs
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle
from tiltsim_controllers.vehicle.quadrotor_mixer import thrust_controls

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    vehicle: Vehicle
    gains: Gains
    reference: ReferenceParameters


@scalar
def _attitude_altitude_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All eight controls: thrusts, idle rotor states."""
    vehicle = parameters.vehicle
    thrust, roll_torque, pitch_torque, yaw_torque = attitude_altitude_inputs(
        time,
        rigid_body_state(qpos, qvel, 0.0, 0.0),
        vehicle,
        parameters.gains,
        parameters.reference,
    )
    thrusts = thrust_controls(thrust, roll_torque, pitch_torque, yaw_torque, vehicle)
    return (*thrusts, 0.0, 0.0, 0.0, 0.0)


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, QuadrotorAttitudeAltitudeController)
    vehicle, gains = plan.scenario.rotorcraft.resolve(), controller.resolve_gains()
    return ControlSetup(LoopParameters(signature, vehicle, gains, plan.reference))


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    reference = setup.parameters.reference
    return {
        **references(samples, reference, setup.knots),
        # cos(roll) cos(pitch) of the altitude times 1 / cos(pitch) of the Euler angles
        "determinant": np.cos(samples["roll"]),
        "singularity_margin": upright_margin(samples),
    }


@scalar
def _equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """The control law on the thesis's equations."""
    return attitude_altitude_inputs(
        time,
        (*rigid_body(state), 0.0, 0.0),
        parameters.vehicle,
        parameters.gains,
        parameters.reference,
    )


QUADROTOR_ATTITUDE_ALTITUDE: Final = ClosedLoop(
    kind=ROTORCRAFT,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=Dynamics(
        "quadrotor",
        Sizes(qpos=7, qvel=6, act=4, ctrl=8),
        lambda _plan, _setup: (0.0, 0.0, 0.0, 0.0),
        commands_thrusts=True,
        spins=SPIN,
    ),
    sampling=Sampling(_attitude_altitude_controls),
    columns=Columns(observe_quadrotor, _derive, observe_reads_controls=True),
    monitoring=Monitoring(thrust_axis_value, thrust_axis_cause),
    equations=Equations(
        inputs=_equation_inputs,
        inputs_size=4,
        rates=equation_rates,
        initial=lambda plan, _setup: initial_state(plan.scenario),
        observe=observe_equations,
    ),
    follows_position=lambda _scenario: False,
    uses_gait=False,
)
"""The attitude-altitude controller of the quadrotor."""
