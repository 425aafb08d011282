"""An autopilot in lockstep, with a double of the firmware."""

from __future__ import annotations

import socket
import struct

import numpy as np
import pytest

import tiltsim
from tests.plants.firmware_double import HEIGHT, Firmware, Px4Firmware
from tiltsim.models.cross import as_multirotor
from tiltsim.plants.autopilot import Mixer, ardupilot_files
from tiltsim_controllers.vehicle.rotors import force_and_torque

TILTING = [*(f"along_{i}" for i in range(1, 7)), *(f"across_{i}" for i in range(1, 7))]


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def scenario(port, duration=1.0, tilting=False, **keys):
    table = {"type": "ardupilot", "port": port, "rate": 250.0, "wait": 2.0, "hold": 5.0, **keys}
    if tilting:
        vehicle = {
            "model": "multirotor",
            "mjcf": "mjcf/tilt_hexarotor.xml",
            "max_rotor_speed": 838.0,
        }
        vehicle["mjcf"] = tiltsim.load_scenario("fleet/tilt_hexarotor#hover").vehicle.mjcf
        table["outputs"] = TILTING
    else:
        vehicle = {"model": "quadrotor", "max_rotor_speed": 600.0}
    return tiltsim.parse_scenario(
        {
            "vehicle": vehicle,
            "autopilot": table,
            "simulation": {"duration": duration, "record_timestep": 0.004},
            **({"gait": {"type": "fixed", "angles": [0.0] * 6}} if tilting else {}),
        }
    )


def firmware(flown, exchanges=100_000, **options):
    """A double for the vehicle of a scenario."""
    table = flown.any_rotorcraft
    vehicle = as_multirotor(table.resolve(), tilting=table.has_tilting_rotors)
    full = np.array(vehicle.thrust_coefficients) * table.max_rotor_speed**2
    scale = np.array(vehicle.spins) * full / np.array(vehicle.thrust_coefficients)
    columns = []
    for angle in (0.0, np.pi / 2)[: 1 + (vehicle.tilts > 0)]:
        force, torque = force_and_torque(vehicle.table, [angle] * vehicle.tilts)
        columns.append(np.vstack([force, torque]) * scale)
    kind = Px4Firmware if flown.autopilot.type == "px4" else Firmware
    made = kind(
        flown.autopilot.port,
        np.hstack(columns),
        vehicle.mass * vehicle.gravity,
        np.diag(np.reshape(vehicle.inertia, (3, 3))),
        signed=vehicle.tilts > 0,
        exchanges=exchanges,
        **options,
    )
    made.start()
    return made


def px4(**keys):
    return scenario(free_port(), 4.0, type="px4", **keys)


@pytest.mark.slow
def test_two_flights_of_px4_are_equal_in_every_bit_and_reach_their_height():
    flights = []
    for _ in range(2):
        flown = px4()
        double = firmware(flown)
        flights.append(tiltsim.simulate(flown))
        assert flights[-1].end.kind == "completed", flights[-1].end
    assert flights[0].samples.tobytes() == flights[1].samples.tobytes()
    # Inertial navigation finds its height, so that forces and rates are in its frames.
    assert flights[0]["z"][-1] == pytest.approx(HEIGHT, abs=0.05)
    assert double.readings[-1].abs_pressure < double.readings[0].abs_pressure


@pytest.mark.parametrize(
    ("options", "keys", "cause"),
    [
        ({"exchanges": 300}, {}, "the firmware's link broke: "),
        ({"exchanges": 300, "late": 0.6}, {"wait": 0.3}, "the link to the firmware is lost"),
        ({"exchanges": 300, "last": b"hello"}, {}, "invalid MAVLink prefix"),
        ({"shift": 4000}, {}, "outputs of 28000 us, after 24000 us"),
        ({"shift": -4000}, {"hold": 0.1}, "without lift-off"),  # each answers earlier readings
    ],
)
def test_a_wrong_answer_of_px4_ends_the_flight_with_its_cause(options, keys, cause):
    flown = px4(**keys)
    firmware(flown, **options)
    flight = tiltsim.simulate(flown)
    assert flight.end.kind == "failed"
    assert cause in flight.end.cause


@pytest.mark.parametrize("tilting", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_two_flights_are_equal_in_every_bit_and_reach_their_height(tilting):
    flights = []
    for repeat in (False, True):  # repeated outputs change nothing
        flown = scenario(free_port(), 4.0, tilting)
        double = firmware(flown, repeat=repeat)
        flights.append(tiltsim.simulate(flown))
        assert flights[-1].end.kind == "completed", flights[-1].end
    assert flights[0].samples.tobytes() == flights[1].samples.tobytes()
    assert flights[0]["z"][-1] == pytest.approx(HEIGHT, abs=0.05)
    # The readings are in north, east, down: at the height that the flight records in z up.
    last = double.readings[-1]
    assert last["position"][2] == pytest.approx(-flights[1]["z"][-1], abs=0.01)
    assert last["imu"]["accel_body"][2] == pytest.approx(-9.8, abs=0.3)


def test_the_accelerometer_is_the_specific_force():
    flown = scenario(free_port(), 1.0)
    double = firmware(flown)
    flight = tiltsim.simulate(flown)
    force = np.sum([flight[f"thrust_{i}"] for i in range(1, 5)], axis=0)
    mass = flown.vehicle.resolve().mass
    measured = np.array([-one["imu"]["accel_body"][2] for one in double.readings])
    moving = len(measured) - (len(flight) - 1)  # readings before belong to the hold
    # A reading is the mean since the last exchange; thrusts are held, and recorded after it.
    np.testing.assert_allclose(measured[moving + 1 :], force[1:-1] / mass, atol=1e-6)


def test_sticks_follow_simulated_time():
    flown = scenario(free_port(), 0.2, rc=[[0.0, 1500, 1000], [0.5, 1500, 1700]])
    double = firmware(flown)
    tiltsim.simulate(flown)
    seen = {reading["timestamp"]: reading["rc"]["rc_2"] for reading in double.readings}
    assert all((value == 1700) == (time >= 0.5) for time, value in seen.items())
    assert {*seen.values()} == {1000, 1700}


@pytest.mark.parametrize(
    ("options", "keys", "cause"),
    [
        ({"exchanges": 300}, {"wait": 0.3}, "the link to the firmware is lost"),
        (
            {
                "exchanges": 300,
                "last": struct.pack("<HHI16H", 18458, 400, 300, *16 * [1500]),
                "late": 0.6,
            },
            {"wait": 0.3},
            "the link to the firmware is lost",
        ),
        ({"exchanges": 300, "last": b"hello"}, {}, "not ArduPilot's, on port"),
        ({"exchanges": 0}, {"wait": 0.3}, "the link to the firmware is lost"),
    ],
)
def test_a_lost_link_and_a_wrong_message_end_the_flight_with_their_cause(options, keys, cause):
    flown = scenario(free_port(), 4.0, **keys)
    firmware(flown, **options)
    flight = tiltsim.simulate(flown)
    assert flight.end.kind == "failed"
    assert cause in flight.end.cause


def test_a_firmware_that_never_lifts_off_ends_the_flight():
    flown = scenario(free_port(), 1.0, hold=0.1)
    firmware(flown)
    assert "0.1 s of simulated time without lift-off" in tiltsim.simulate(flown).end.cause


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"autopilot": {"type": "px5", "rate": 250.0}}, "autopilot.type"),
        ({"autopilot.outputs": ["rotor_9"]}, "the vehicle has 4 rotors"),
        ({"autopilot.outputs": ["rotor_1", "rotor_1"]}, "twice"),
        ({"autopilot.outputs": ["motor_1"]}, 'write "rotor_1"'),
        ({"autopilot.outputs": ["rotor_1"]}, "rotor 2 needs one output"),
        ({"autopilot.outputs": ["along_1", "across_1"]}, "this rotor has no tilt"),
        ({"autopilot.rc": [[1.0, 1500], [0.5, 1500]]}, "times must increase"),
        ({"autopilot.port": 0}, "autopilot.port"),
        ({"controller": {"law": "pid"}}, "the autopilot is the controller"),
        ({"simulation.control_timestep": 0.01}, "the autopilot's rate makes it 0.004"),
        ({"simulation.plant": "rigid_body"}, "mujoco plant only"),
        ({"vehicle.max_rotor_speed": None}, "needs vehicle.max_rotor_speed"),
    ],
)
def test_mistakes_get_one_line(changes, message):
    with pytest.raises(tiltsim.InputError) as caught:
        Mixer(scenario(9002).replace(changes))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_port_in_use_is_refused():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        with pytest.raises(tiltsim.InputError, match="choose another port"):
            tiltsim.simulate(scenario(taken.getsockname()[1]))


def test_reversed_rotors_push_down():
    mixer = Mixer(scenario(9002))
    speeds = np.full(len(mixer.vehicle.spins), 300.0)
    up, down = (mixer.lift(tiltsim.Command(rotor_speeds=way * speeds)) for way in (1.0, -1.0))
    assert down == -up < 0.0


def test_the_frame_of_a_tilting_vehicle_gives_each_motion_alone():
    files = ardupilot_files(scenario(9002, tilting=True))
    rows = [
        [float(part) for part in line.split("(")[1].split(", ")[1:7]]
        for line in files["frame.lua"].splitlines()
        if "add_motor" in line
    ]
    given = Mixer(scenario(9002, tilting=True)).factors() @ np.array(rows)  # roll to right
    wrench = given[[3, 4, 5, 2, 0, 1]] * [[1.0], [-1.0], [-1.0], [1.0], [1.0], [-1.0]]
    scale = np.diag(wrench)
    assert (scale > 0.0).all()
    np.testing.assert_allclose(wrench, np.diag(scale), atol=1e-3 * scale.max())
    parameters = dict(line.split() for line in files["parameters.parm"].splitlines())
    assert parameters["FRAME_CLASS"] == "16"
    assert parameters["MOT_YAW_HEADROOM"] == "0"  # else pairs near zero keep their sign
    mixer = Mixer(scenario(9002, tilting=True))
    turning = scale[:3] / np.diag(np.reshape(mixer.vehicle.inertia, (3, 3)))  # rad/s^2 per unit
    for axis, acceleration, rate in zip(("RLL", "PIT", "YAW"), turning, (20, 20, 10), strict=True):
        gain = float(parameters[f"ATC_RAT_{axis}_P"])
        assert gain * acceleration == pytest.approx(rate, rel=1e-3)
    # At full throttle the first rotor has its full thrust.
    assert max(row[3] for row in rows) == 1.0
    with pytest.raises(tiltsim.InputError, match="do not give every force and torque"):
        ardupilot_files(scenario(9002))
