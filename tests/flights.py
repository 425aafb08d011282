"""Short flights for the tests of views, flown once."""

from __future__ import annotations

from functools import cache

import tiltsim
from tiltsim.vehicles.rotorcraft import ROTORCRAFT

BASE = {"simulation": {"duration": 1.2, "timestep": 0.002, "engine": "python"}}
SAMPLE_FIELDS = ("time", *ROTORCRAFT.observed_fields)
"""The first fields of a sample of any rotorcraft; a law's own states follow."""

FIXED = {"gait": {"type": "fixed", "angles": [-0.65, -0.65, 0.65, 0.65]}}
TROT = {
    "title": "A trot around a circle",
    "gait": {"type": "trot_continuous", "amplitude": 0.65, "period": 1.0},
    "reference": {"type": "circle", "radius": 2.0, "angular_frequency": 0.5},
}
LIMITED = {"vehicle": {"min_rotor_speed": 150.0, "max_rotor_speed": 390.0}}
FREE = {
    "controller": {"decoupler": "none"},
    "reference": {"type": "attitude_altitude", "roll": 0.1, "altitude": 0.2},
}
TILT_CAR = {
    "title": "A penguin's swing",
    "vehicle": {"model": "tilt_car"},
    "controller": {"law": "tilt_car_planned_direction"},
    "gait": {"type": "penguin_large"},
    "reference": {"type": "line", "velocity": [0.0, 0.0, 0.0], "acceleration": [1.0, 0.0, 0.0]},
}
JUMPS = {"gait": {"type": "trot_instant", "amplitude": 0.65, "period": 0.8}}
SUPERVISED = {"controller": {"supervisor": {"strategy": "return_to_red", "min_margin": 0.9}}}
OTHER_KINDS = {"tilt_car": TILT_CAR}
"""Flights of vehicles that are no rotorcraft."""

RECIPES = {
    "fixed": FIXED,
    "trot": TROT,
    "limited": FIXED | LIMITED,
    "free": FREE,
    "jumps": JUMPS,
    "supervised": JUMPS | SUPERVISED,
}


@cache
def flight(name):
    """A flight by its name in `RECIPES` or `OTHER_KINDS`; do not change it."""
    scenario = tiltsim.parse_scenario(BASE | (RECIPES | OTHER_KINDS)[name], f"tests/{name}")
    return tiltsim.simulate(scenario)


def saved(name, folder):
    """The folder of a flight's results."""
    flight(name).save(folder / name)
    return folder / name
