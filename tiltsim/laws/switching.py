"""Switching between two laws around the quadrotor (ch. 2, Sec. 5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

import tiltsim_controllers.laws.yaw_position as yaw_position
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
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    law: Parameters


@scalar
def switching_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All ten controls: thrusts, idle rotor states, the law's own states."""
    law = parameters.law
    state = rigid_body_state(qpos, qvel, act[4], act[5])
    return extended_controls(switching_inputs(time, state, law, knots), law.yaw_position.vehicle)


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, SwitchingController)
    law = Parameters(
        yaw_position.Parameters(
            plan.scenario.rotorcraft.resolve(), controller.resolve_gains(), plan.reference
        ),
        controller.resolve_attitude_gains(),
        Zone(*controller.zone.roll, *controller.zone.pitch),
        EXTENSIONS[controller.extension],
        controller.extension_rate,
    )
    return ControlSetup(LoopParameters(signature, law), plan.knots)


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    reference = law.yaw_position.reference
    attitudes = zip(samples["roll"].tolist(), samples["pitch"].tolist(), strict=True)
    inside = np.array([in_attitude_zone(*attitude, law.zone) for attitude in attitudes], float)
    # Outside of the zone roll and pitch are no outputs: they are what the position takes.
    roll = np.where(inside > 0.0, reference.roll, samples["roll"])
    pitch = np.where(inside > 0.0, reference.pitch, samples["pitch"])
    return {
        **references(samples, reference, setup.knots, (roll, pitch, reference.yaw)),
        **extended_singularity_columns(samples, law.yaw_position.vehicle),
        "attitude_zone": inside,
    }


def _watched(sample: Mapping[str, float], _setup: ControlSetup) -> tuple[SignCheck, ...]:
    # Not the extension's thrust: while the other law flies it may be anything.
    return (thrust_axis_check(sample),)


@scalar
def equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """The law on the thesis's equations."""
    return switching_inputs(time, law_state(state), parameters.law, knots)


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
    return extended_equations_of_motion(
        state, inputs, parameters.law.yaw_position.vehicle, disturbance
    )


@scalar
def observe_in_equations(
    time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """What a sample holds, from the state of the thesis's equations."""
    return observe_extended_equations(state, inputs, parameters.law.yaw_position.vehicle)


SWITCHING: Final = extended_loop(
    LoopParameters,
    switching_controls,
    equations(equation_inputs, 6, equation_rates, observe_in_equations),
    setup=_setup,
    derive=_derive,
    watched=_watched,
    watch=thrust_axis_value,
    own_columns={"attitude_zone": "1"},
    # In the zone, where the law is meant to end up, the position is free.
    follows_position=False,
)
"""Switching between yaw-position and attitude-altitude control of the quadrotor."""
