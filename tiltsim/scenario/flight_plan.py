"""The plan of a flight: its tilt angles and its reference over time."""

from __future__ import annotations

from dataclasses import dataclass

from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.references.trajectories import ReferenceParameters


@dataclass(frozen=True, eq=False)
class FlightPlan:
    """A scenario with its gait planned and its reference placed.

    Attributes
    ----------
    scenario
        The scenario.
    gait
        Its gait, planned for its vehicle.
    reference
        The record of its reference.
    knots
        Keyframes of the gait, then waypoints of the reference, as scalar functions read them.
    """

    scenario: Scenario
    gait: Gait
    reference: ReferenceParameters
    knots: Values


def plan_flight(scenario: Scenario) -> FlightPlan:
    """Plan a scenario's gait, and place the knots of its reference after the gait's."""
    gait = scenario.gait.plan(scenario.vehicle.resolve())
    return FlightPlan(scenario, gait, *scenario.reference.after_gait(gait.knots))
