"""Flights along tables of position and attitude, on both plants and engines."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tiltsim
from tests.refusals import refusal

TURNS = "fleet/omni_octorotor#turns_over"
PLANTS = "mujoco", "rigid_body"
FLIGHTS = {
    "attitude_force": ("fleet/omni_octorotor#hover", {"simulation.timestep": 0.002}),
    "full_pose": (
        "fleet/tilt_hexarotor#hover",
        {"controller": {"law": "full_pose"}, "simulation.timestep": 0.001},
    ),
}
"""A vehicle that can follow any attitude, or some, by the law."""


def pose(time):
    """From rest, a part of a circle with a turn about all axes."""
    share = (time / 4.0) ** 4
    return 0.5 * sin(share), 0.5 - 0.5 * cos(share), 0.1 * share, 0.6 * share, -0.2 * share, share


@cache
def flown(law, plant, engine="native", reference=pose, duration=4.0):
    name, changes = FLIGHTS[law]
    changes = {**changes, "simulation.duration": duration, "simulation.plant": plant, "expect": []}
    changes["simulation.engine"] = engine
    return tiltsim.simulate(tiltsim.load_scenario(name, changes, reference=reference))


def turned_by(flight, other):
    """The largest angle (rad) between the attitudes of two flights."""
    angles = flight["attitude"] - other["attitude"]
    return np.abs(np.arctan2(np.sin(angles), np.cos(angles))).max()


@pytest.mark.parametrize(("law", "plant"), list(zip(FLIGHTS, PLANTS)))
def test_a_csv_is_followed_as_the_function_that_it_was_made_of(law, plant, tmp_path):
    file = tmp_path / "pose.csv"
    times = np.linspace(0.0, 4.0, 161)  # not the samples of the function
    lines = [",".join(f"{value:.12f}" for value in (t, *pose(t))) for t in times.tolist()]
    file.write_text("\n".join(["time,x,y,z,roll,pitch,yaw", *lines]))
    by_function, by_file = flown(law, plant), flown(law, plant, reference=str(file))
    assert by_function.end.kind == by_file.end.kind == "completed"
    assert np.abs(by_function["roll"]).max() > 0.5
    assert turned_by(by_function, by_file) < 1e-6
    assert np.abs(by_function["position"] - by_file["position"]).max() < 1e-6


@pytest.mark.parametrize("plant", PLANTS)
def test_quaternions_of_any_sign_and_rounded_norm_are_the_same_attitude(plant, tmp_path):
    """The turn over, past the roll and yaw of pi; quaternions of SciPy."""
    rows = np.array(tiltsim.load_scenario(TURNS).reference.table)
    signs = np.where(np.arange(len(rows)) % 3, -1.0, 1.0)[:, np.newaxis] * 1.001
    turned = Rotation.from_euler("ZYX", rows[:, :3:-1]).as_quat(scalar_first=True)
    file = tmp_path / "turns.csv"
    head, table = "time,x,y,z,qw,qx,qy,qz", np.hstack([rows[:, :4], signs * turned])
    np.savetxt(file, table, delimiter=",", header=head, comments="", fmt="%.17g")
    changes = {"simulation.plant": plant, "simulation.duration": 12.0, "expect": []}
    by_angles = tiltsim.load_scenario(TURNS, changes)
    flights = [tiltsim.simulate(by_angles)]
    flights.append(tiltsim.simulate(tiltsim.load_scenario(by_angles, reference=str(file))))
    assert np.ptp(flights[0]["roll"]) > 6.0
    assert np.abs(flights[0]["position"] - flights[1]["position"]).max() < 1e-9
    assert turned_by(*flights) < 1e-9


@pytest.mark.parametrize("law", FLIGHTS)
def test_mujoco_and_the_equations_turn_alike(law):
    flights = [flown(law, plant) for plant in PLANTS]
    assert np.abs(flights[0]["position"] - flights[1]["position"]).max() < 1e-6
    assert turned_by(*flights) < 1e-6


def end_of_pose(time):
    """Already turned at the start, where the vehicle is level."""
    return pose(3.0 + time)


@pytest.mark.parametrize(("law", "plant"), list(zip(FLIGHTS, PLANTS)))
def test_python_and_native_turn_alike_in_every_bit(law, plant):
    flights = [flown(law, plant, engine, end_of_pose, 0.1) for engine in ("python", "native")]
    for column in flights[0].columns:
        np.testing.assert_array_equal(*(flight[column] for flight in flights))


@pytest.mark.parametrize("law", FLIGHTS)
def test_the_reference_attitude_follows_the_table(law):
    flight = flown(law, "rigid_body")
    asked = np.array([pose(time)[3:] for time in flight["time"]])
    np.testing.assert_allclose(flight["reference_attitude"], asked, atol=1e-6)
    assert flight.metrics()["final_attitude_error"] < 0.07  # full_pose: the gyroscopic torque
    assert flight.metrics()["max_position_error"] < 0.01


def heading(time):
    """A yaw alone, without gyroscopic torque, of which the law of ch. 3 does not know."""
    return 0.0, 0.0, 0.0, 0.0, 0.0, (time / 4.0) ** 4


def test_full_pose_feeds_the_motion_of_the_attitude_forward():
    """Without the rates that it derives it lags by half a radian."""
    flight = flown("full_pose", "rigid_body", reference=heading)
    assert flight["body_rates"][-1][2] > 0.99
    assert flight.metrics()["final_attitude_error"] < 1e-4


def test_an_omnidirectional_vehicle_turns_over_on_a_circle():
    changes = {"simulation.engine": "native", "expect": []}
    flights = [
        tiltsim.simulate(tiltsim.load_scenario(TURNS, {**changes, "simulation.plant": plant}))
        for plant in PLANTS
    ]
    for flight in flights:
        assert flight.end.kind == "completed"
        assert np.ptp(np.unwrap(flight["roll"])) > 2.0 * pi - 1e-3
        assert flight.metrics()["max_position_error"] < 1e-3
    assert np.abs(flights[0]["position"] - flights[1]["position"]).max() < 1e-6
    assert turned_by(*flights) < 1e-6


def test_your_own_controllers_see_the_attitude_of_the_table():
    seen = []

    def controller(observed):
        seen.append((observed.time, observed.reference.attitude))
        return tiltsim.Command(rotor_accelerations=np.zeros(8))

    @tiltsim.law
    def law(observed):
        return tiltsim.Command(rotor_accelerations=0.0 * observed.rotor_speeds)

    changes = {"simulation.duration": 0.1, "expect": []}
    for given in (controller, law):
        scenario = tiltsim.load_scenario(
            FLIGHTS["attitude_force"][0], changes, reference=pose, controller=given
        )
        flight = tiltsim.simulate(scenario)
        asked = np.array([pose(time)[3:] for time in flight["time"]])
        np.testing.assert_allclose(flight["reference_attitude"], asked, atol=1e-8)
    for time, attitude in seen:
        np.testing.assert_allclose(attitude, pose(time)[3:], atol=1e-8)


def test_a_law_that_cannot_turn_says_which_can():
    line = refusal(
        tiltsim.load_scenario,
        "fleet/hexarotor#hover",
        {"controller": {"law": "geometric"}, "simulation.duration": 4.0, "expect": []},
        reference=pose,
    )
    assert line.endswith("choose full_pose, attitude_force, vectoring, python, numpy")
