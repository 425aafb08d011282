"""From which attitudes the gaits of ch. 3 to 8 come back, on the thesis's equations."""

from __future__ import annotations

from typing import Any, Final

from tiltsim.linear.attraction import Attraction, attraction
from tiltsim.scenario.loading import load_scenario

GAITS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "ch. 3, gait 1": ("ch03_gaits/stabilization#gait_1", {}),
    "ch. 4, fixed at 0.65": ("ch04_tracking/setpoint#rho_065_modified", {}),
    "ch. 4, trot to 0.65, T = 2 s": (
        "ch04_tracking/line#continuous_t2_modified",
        {"reference.type": "setpoint"},
    ),
    "ch. 5, walk at 1/3, T = 1 s": ("ch05_gaits/line#walk_third_t1_modified", {}),
    "ch. 6, gait 3, red": ("ch06_two_color/stabilization#gait_3", {}),
    "ch. 7, gait 2, red": ("ch07_robust_gaits/circle#gait_2", {}),
    "ch. 8, E1": ("ch08_generalized_map/stabilization#E1", {}),
}
"""Scenarios with overrides, by what a reader calls them."""

SETTLED: Final[dict[str, Any]] = {
    "simulation.plant": "thesis",
    "simulation.engine": "native",
    "simulation.duration": 16.0,  # the altitude decays as exp(-0.2 t)
}


def attraction_map(name: str, coarse: int = 10, refinements: int = 1) -> Attraction:
    """The map of one of `GAITS`; see `tiltsim.linear.attraction.attraction`."""
    address, overrides = GAITS[name]
    scenario = load_scenario(address, SETTLED | overrides)
    return attraction(scenario, coarse=coarse, refinements=refinements)
