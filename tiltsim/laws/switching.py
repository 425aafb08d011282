"""Switching between two controllers of the quadrotor (ch. 2, Sec. 5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

import tiltsim_controllers.laws.yaw_position as yaw_position
from tiltsim.closed_loop.loop import Columns, ControlSetup, Monitoring
from tiltsim.engines.sample_evaluation import evaluate_over_samples
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
    thrust_axis_value,
)
from tiltsim.scenario.quadrotor_controllers import SwitchingController
from tiltsim_controllers.laws.switching import (
    EXTENSIONS,
    Parameters,
    Zone,
    in_attitude_zone,
    switching_inputs,
)
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
def _switching_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All ten controls: thrusts, idle rotor states, the controller's states."""
    law = parameters.law
    state = rigid_body_state(qpos, qvel, act[4], act[5])
    return extended_controls(switching_inputs(time, state, law, knots), law.yaw_position.vehicle)


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, SwitchingController)
    vehicle = plan.scenario.rotorcraft.resolve()
    law = Parameters(
        yaw_position.Parameters(vehicle, controller.resolve_gains(), plan.reference),
        controller.resolve_attitude_gains(),
        Zone(*controller.zone.roll, *controller.zone.pitch),
        EXTENSIONS[controller.extension],
        controller.extension_rate,
    )
    return ControlSetup(LoopParameters(signature, vehicle, law), plan.knots)


@scalar
def _inside(time: float, attitude: Vector, zone: Zone, knots: Vector) -> tuple[float]:
    """1 where the attitude-altitude controller is active, else 0."""
    return (1.0 if in_attitude_zone(attitude[0], attitude[1], zone) else 0.0,)


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    reference = law.yaw_position.reference
    attitude = np.stack([samples["roll"], samples["pitch"]], axis=-1)
    zone = ControlSetup(law.zone)
    (inside,) = evaluate_over_samples(_inside, 1, samples["time"], attitude, zone).T
    # Outside the zone roll and pitch are not outputs: they follow from the position.
    roll = np.where(inside > 0.0, reference.roll, samples["roll"])
    pitch = np.where(inside > 0.0, reference.pitch, samples["pitch"])
    return {
        **references(samples, reference, setup.knots, (roll, pitch, reference.yaw)),
        **extended_singularity_columns(samples, law.yaw_position.vehicle),
        "attitude_zone": inside,
    }


@scalar
def _equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """The control law on the thesis's equations."""
    return switching_inputs(time, (*rigid_body(state), state[12], state[13]), parameters.law, knots)


SWITCHING: Final = replace(
    extended_loop(
        LoopParameters,
        _setup,
        _switching_controls,
        _equation_inputs,
        Columns(
            observe_extended_quadrotor,
            _derive,
            fields=EXTENSION_FIELDS,
            units={**EXTENSION_COLUMNS, "attitude_zone": "1"},
            observe_reads_controls=True,
        ),
        # The thrust of the extension may be anything while the other controller is active.
        Monitoring(thrust_axis_value, thrust_axis_cause),
    ),
    # In the zone, where the vehicle is meant to end up, the position is free.
    follows_position=lambda _scenario: False,
)
"""Switching between yaw-position and attitude-altitude control of the quadrotor."""
