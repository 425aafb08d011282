"""The attitude-altitude controller with tilt-rate feed-forward in a closed loop (ch. 4)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from tiltsim.closed_loop.loop import Monitoring
from tiltsim.laws.rotor_loop import RotorLaw
from tiltsim.laws.tiltrotor import (
    TILTROTOR_LAYOUT,
    determinant_and_speed_causes,
    determinant_and_speeds,
    singularity_margins,
    tiltrotor_motion,
    watched_vehicle,
)
from tiltsim.laws.tracking import tracking_fields, tracking_loop
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim_controllers.laws.gait_feedforward import Parameters, tracking_inputs
from tiltsim_controllers.laws.tiltrotor_supervisor import SUPERVISION
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


_LAW: Final = RotorLaw(
    "gait_feedforward",
    tracking_inputs,
    Parameters,
    _setup,
    margins=singularity_margins,
    motion=tiltrotor_motion,
)

GAIT_FEEDFORWARD, MEASURED_GAIT_FEEDFORWARD = (
    replace(
        tracking_loop(
            TILTROTOR_LAYOUT, _LAW._replace(measured=measured), SUPERVISION, watched_vehicle
        ),
        kind=ROTORCRAFT,
        monitoring=Monitoring(determinant_and_speeds, determinant_and_speed_causes),
    )
    for measured in (False, True)
)
"""The attitude-altitude controller with tilt-rate feed-forward, of the tiltrotor; the second with
the angular acceleration of the plant in place of the model's."""
