"""What a scenario plans for a flight: its tilt angles and its reference over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario
    from tiltsim_controllers.gaits.plans import Gait
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
    knots: tuple[float, ...]


def plan_flight(scenario: Scenario) -> FlightPlan:
    """Plan the gait of a scenario and place its reference behind it."""
    gait = scenario.gait.plan(scenario.vehicle.resolve())
    return FlightPlan(scenario, gait, *scenario.reference.placed(gait.knots))
