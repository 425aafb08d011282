"""Make the plant that a scenario names."""

from __future__ import annotations

from typing import Any

from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.plant import Plant
from tiltsim.plants.thesis_plant import ThesisPlant
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.interrupts import reraise_swallowed_interrupts


def make_plant(scenario: Scenario, controller: Any = None) -> Plant:
    """The plant that a scenario asks for, at its initial state.

    ``controller`` is a user's own, for scenarios whose law is ``python``.
    """
    if scenario.controller.law == "python":
        from tiltsim.plants.user_controlled_plant import UserControlledPlant

        return UserControlledPlant(scenario, controller)
    thesis = scenario.simulation.plant == "thesis"
    with reraise_swallowed_interrupts():  # it may compile
        return ThesisPlant(scenario) if thesis else MujocoPlant(scenario)
