"""Waypoints in the table behind the parameters, beside the keyframes of a gait."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal

WAYPOINTS = {
    "type": "waypoints",
    "positions": [[0, 0, 0], [0.2, 0.1, 0.1], [0.1, 0.3, 0.2]],
    "times": [0.0, 0.3, 0.8],
}
CASES = {
    "keyframes": {
        "gait": {"type": "walk", "amplitude": 0.3, "period": 1.0},
        "reference": WAYPOINTS,
    },
    "trot": {
        "gait": {"type": "trot_continuous", "amplitude": 0.3, "period": 1.0},
        "reference": {**WAYPOINTS, "acceleration_feedforward": True},
    },
    "tables": {
        "gait": {
            "type": "table",
            "rows": [[0, 0, 0, 0, 0], [0.2, 0.2, -0.1, 0.1, 0.1], [0.3, 0, 0, 0, 0]],
            "repeat": True,
            "scale": 0.5,
        },
        "controller": {
            "gait_rate_feedforward": True,
            "decoupler": "exact",
            "decoupling": "exact",
            "gains": "exact",
        },
        "reference": {
            "type": "table",
            "rows": [
                [0, 0, 0, 0],
                [0.1, 0, 0.02, 0.05],
                [0.3, 0.2, 0.1, 0.1],
                [0.8, 0.1, 0.3, 0.2],
            ],
            "interpolation": "cubic",
        },
    },
    "quadrotor": {
        "vehicle": {"model": "quadrotor", "preset": "ar_drone_2_unrounded"},
        "controller": {"law": "yaw_position"},
        "reference": WAYPOINTS,
    },
}


def fly(case, **simulation):
    document = {**CASES[case], "simulation": {"duration": 0.5, **simulation}}
    return tiltsim.simulate(tiltsim.parse_scenario(document))


@pytest.mark.parametrize(
    ("case", "plant"),
    [
        *((case, "mujoco") for case in CASES),
        *(("keyframes", "thesis"), ("trot", "thesis")),
        pytest.param("quadrotor", "thesis", marks=pytest.mark.slow),  # compiles for seconds
    ],
)
def test_engines_fly_the_same_waypoints(case, plant):
    python, native = (fly(case, plant=plant, engine=engine) for engine in ("python", "native"))
    np.testing.assert_array_equal(python.samples, native.samples)
    at_second = np.argmin(np.abs(python["time"] - 0.3))
    for axis, expected in zip("xyz", WAYPOINTS["positions"][1]):
        assert python[f"{axis}_ref"][at_second] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ({**WAYPOINTS, "times": [0.0, 0.3]}, "3 waypoints but 2 times"),
        ({**WAYPOINTS, "times": [0.0, 0.3, 0.2]}, "must start at 0 and increase"),
        ({"type": "lissajous", "amplitude": [1, 1, 1]}, "reference.angular_frequency"),
        ({"type": "figure_eight", "length": 0.0, "width": 1.0, "angular_frequency": 1.0}, "length"),
    ],
)
def test_mistakes_are_one_line(reference, message):
    assert message in refusal(tiltsim.parse_scenario, {"reference": reference})
