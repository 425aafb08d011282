"""The attitude-altitude controller with tilt-rate feed-forward in a closed loop (ch. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tiltsim.laws.rotor_loop import RotorLaw
from tiltsim.laws.tiltrotor import tiltrotor_loops
from tiltsim.laws.tracking import INTEGRALS, integrals_at_rest, tracking_parameters
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim_controllers.laws.gait_feedforward import Parameters, tracking_inputs
from tiltsim_controllers.laws.multirotor_steps import EULER_ANGLES
from tiltsim_controllers.mathematics.scalar import Values

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


def _setup(plan: FlightPlan) -> tuple[Any, Values]:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    vehicle, is_fed_forward = rotorcraft.resolve(), controller.rotor_inertia_feedforward
    law = tracking_parameters(
        plan,
        Parameters,
        vehicle=vehicle,
        supervisor=controller.resolve_supervisor(vehicle),
        rotor_inertia=rotorcraft.rotor_inertia if is_fed_forward else 0.0,
        attitude_error=EULER_ANGLES,
        slowest_rotor=0.0,
        turn_time=0.0,
    )
    return law, ()


GAIT_FEEDFORWARD, MEASURED_GAIT_FEEDFORWARD = tiltrotor_loops(
    RotorLaw(
        "gait_feedforward",
        tracking_inputs,
        Parameters,
        _setup,
        states=INTEGRALS,
        initial=integrals_at_rest,
    )
)
"""The attitude-altitude controller with tilt-rate feed-forward, of the tiltrotor; the second with
the angular acceleration of the plant in place of the model's."""
