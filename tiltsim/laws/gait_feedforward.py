"""The attitude-altitude controller with tilt-rate feed-forward in a closed loop (ch. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tiltsim.laws.rotor_loop import RotorLaw
from tiltsim.laws.tiltrotor import tiltrotor_loops
from tiltsim.laws.tracking import INTEGRALS, integrals_at_rest, tracking_fields
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim_controllers.laws.gait_feedforward import Parameters, tracking_inputs
from tiltsim_controllers.mathematics.scalar import Values

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


def _setup(plan: FlightPlan) -> tuple[Parameters, Values]:
    scenario, controller = plan.scenario, plan.scenario.controller
    assert isinstance(controller, AttitudeAltitudeController)
    vehicle, spin_inertia = scenario.rotorcraft.resolve(), scenario.rotorcraft.rotor_inertia
    law = Parameters(
        vehicle=vehicle,
        **tracking_fields(plan),
        supervisor=controller.resolve_supervisor(vehicle),
        rotor_inertia=spin_inertia if controller.rotor_inertia_feedforward else 0.0,
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
