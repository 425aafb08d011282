"""Full-pose control of the tiltrotor: the tilt angles are inputs, too (ch. 3, Sec. 6.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from tiltsim.closed_loop.loop import Monitoring
from tiltsim.laws.rotor_loop import RotorLaw, rotor_loop
from tiltsim.laws.tiltrotor import (
    ROTOR_STOPS,
    TILTROTOR_LAYOUT,
    rotor_speeds_along_spin,
    singularity_margins,
    tiltrotor_motion,
)
from tiltsim.scenario.tiltrotor_controllers import FullPoseController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT, initial_tilts
from tiltsim_controllers.laws.full_pose import Parameters, full_pose_inputs, limited_tilt_rate
from tiltsim_controllers.mathematics.scalar import Quad, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


@scalar
def _inputs(
    time: float, state: Values, tilt_rates: Values, states: Values, parameters: Any, knots: Vector
) -> Values:
    """Rotor accelerations and tilt rates, which the ``states`` integrate; see `RotorLaw.inputs`."""
    limits = parameters.law.limits
    u1, u2, u3, u4, rate_1, rate_2, rate_3, rate_4 = full_pose_inputs(
        time, state, parameters.law, knots
    )
    # The law's limit sees a pod that stops at its servo's stop, but not the command beyond it.
    a1, a2, a3, a4 = states
    rate_1 = limited_tilt_rate(rate_1, a1, limits)
    rate_2 = limited_tilt_rate(rate_2, a2, limits)
    rate_3 = limited_tilt_rate(rate_3, a3, limits)
    rate_4 = limited_tilt_rate(rate_4, a4, limits)
    return u1, u2, u3, u4, rate_1, rate_2, rate_3, rate_4


@scalar
def sign_check_values(time: float, values: Vector, parameters: Any, knots: Vector) -> Quad:
    """The rotor speeds along their spin."""
    return rotor_speeds_along_spin(values)


def _setup(plan: FlightPlan) -> tuple[Parameters, Values]:
    controller, vehicle = plan.scenario.controller, plan.scenario.rotorcraft.resolve()
    assert isinstance(controller, FullPoseController)
    law = Parameters(
        vehicle,
        controller.resolve_gains(),
        plan.reference,
        controller.resolve_limits(),
        controller.resolve_tilt_weight(vehicle),
        controller.resolve_failure(),
    )
    return law, ()


FULL_POSE: Final = replace(
    rotor_loop(
        TILTROTOR_LAYOUT,
        RotorLaw(
            "full_pose",
            _inputs,
            Parameters,
            _setup,
            states=dict.fromkeys(TILTROTOR_LAYOUT.places.names("tilt_command"), "rad"),
            initial=lambda plan: initial_tilts(plan)[0],
            commands=0,
            margins=singularity_margins,
            motion=tiltrotor_motion,
        ),
    ),
    kind=ROTORCRAFT,
    monitoring=Monitoring(sign_check_values, lambda _sample, _setup: ROTOR_STOPS),
    uses_gait=True,  # its angles at time zero
)
"""Full-pose control of the tiltrotor."""
