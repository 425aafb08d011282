"""The law `vectoring` on vehicles that it was not made for, drawn from a seed, in rough worlds."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tiltsim.models.starters import STARTERS, THRUST, Starter, starter_mjcf

SPARE = 1.15
"""Least true thrust at the limits over the true weight."""


def drawn_vehicle(random):
    """Four to eight rotors on a ring that is no circle, plain, canted or on tilts."""
    rotors = 2 * random.integers(2, 5)
    heading = 2.0 * np.pi * (np.arange(rotors) + random.uniform()) / rotors
    places = random.uniform(0.15, 0.4) * np.stack(
        [np.cos(heading), random.uniform(0.8, 1.2) * np.sin(heading), 0.0 * heading], axis=1
    )
    kind = random.choice(["plain", "canted", "tilting"])
    canted = kind == "canted" and rotors >= 6
    lean = (-1.0) ** np.arange(rotors) * np.sin(random.uniform(0.1, 0.6) * canted)
    up = np.sqrt(1.0 - lean**2)
    axes = np.stack([lean * np.sin(heading), -lean * np.cos(heading), up], axis=1)
    angles = (0.0,) * rotors if kind == "tilting" else ()
    return Starter(f"{rotors} rotors, {kind}", places, axes, angles)


def drawn_world(random, vehicle, mjcf):
    """Limits, lag, sampling, latency, noise, gust and errors of the model."""
    body = {"model": "multirotor", "mjcf": mjcf}
    plain = {"vehicle": body, "controller": {"law": "vectoring"}}
    weight = 9.81 * tiltsim.airframe(plain).vehicle.mass
    mass, thrust = random.uniform(1.1, 1.4), random.uniform(0.75, 0.9)
    ratio = max(random.uniform(1.4, 4.0), SPARE * mass / thrust)
    fastest = float(np.sqrt(ratio * weight / (THRUST * vehicle.axes[:, 2].sum())))
    period = random.choice([0.002, 0.004, 0.01])
    latency = period * random.integers(np.ceil(0.004 / period), round(0.02 / period) + 1)
    rotors = {"min_rotor_speed": 0.08 * fastest, "max_rotor_speed": fastest}
    noise = {"position": 0.005, "velocity": 0.02, "attitude": 0.002, "body_rates": 0.01}
    return {
        "vehicle": {**body, **rotors, "rotor_time_constant": random.uniform(0.02, 0.05)},
        "model_error": {"mass": mass, "thrust_coefficient": thrust},
        "simulation": {
            "duration": 5.0,
            "timestep": 0.002,
            "control_timestep": float(period),
            "control_latency": float(latency),
            "engine": "native",
        },
        "sensors": {f"{name}_noise": deviation for name, deviation in noise.items()},
        "air": {
            "drag": {"linear": [0.02 * weight] * 3},
            "gust": {"velocity": [3.0, -2.0, 0.5], "start": 1.0, "rise": 0.3, "duration": 1.5},
        },
    }


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_no_drawn_vehicle_is_lost(seed, monkeypatch, tmp_path):
    random = np.random.default_rng(seed)
    vehicle, file = drawn_vehicle(random), tmp_path / "drawn.xml"
    monkeypatch.setitem(STARTERS, "drawn", vehicle)
    file.write_text(starter_mjcf("drawn"), encoding="utf-8")
    radius, turn = random.uniform(0.5, 2.0), random.uniform(0.5, 1.0)
    free = {"tilts": "free"} if vehicle.angles else {}
    flight = tiltsim.simulate(
        {
            **drawn_world(random, vehicle, str(file)),
            "controller": {"law": "vectoring", **free},
            "reference": {"type": "circle", "radius": radius, "angular_frequency": turn},
            "initial": {
                "position": [radius, 0.1, -0.1],
                "velocity": [0.0, radius * turn, 0.0],
                "attitude": [0.8, -0.4, 0.5],
            },
        }
    )
    assert flight.end.kind == "completed", flight.end
    error = np.linalg.norm(flight["reference_position"] - flight["position"], axis=1)
    assert error.max() < 1.1, vehicle.title
    assert error[flight["time"] > 4.0].max() < 0.05, vehicle.title
