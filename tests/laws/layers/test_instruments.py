"""Instruments: true values, errors, delays and losses of their readings."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.control import control_callback
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.instruments import ImuTable
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.code.arrays import traceable
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.vehicle import instruments

STEP = 0.01
PLACE = [0.04, -0.02, 0.03]


def scenario(sensors, **tables):
    whole = {
        "vehicle": {"model": "quadrotor"},
        "controller": {"law": "geometric"},
        "reference": {"type": "setpoint", "position": [0.3, -0.2, 0.5], "yaw": 0.3},
        "initial": {"angular_velocity": [0.3, -0.2, 0.5]},
        "sensors": sensors,
        "simulation": {},
    }
    whole |= tables
    whole["simulation"] = {"duration": 1.0, "control_timestep": STEP} | whole["simulation"]
    return tiltsim.parse_scenario(whole)


def fly(sensors, **tables):
    return tiltsim.simulate(scenario(sensors, **tables))


def vectors(flight, *stems):
    return [np.stack([flight[f"{stem}_{axis}"] for axis in "xyz"], axis=-1) for stem in stems]


def test_at_rest_the_imu_reads_gravity_and_no_rates():
    speed = float(np.sqrt(0.429 * 9.8 / (4.0 * 8.048e-6)))
    flight = fly({"imu": {}}, initial={"rotor_speed": speed}, reference={"type": "setpoint"})
    force, rates = vectors(flight, "imu_acceleration", "imu_rate")
    weight = flight.assembly.scenario.true_vehicle.gravity
    np.testing.assert_allclose(force, np.tile([0.0, 0.0, weight], (len(flight), 1)), atol=1e-3)
    speeds = np.stack([flight[f"rotor_speed_{i}"] for i in range(1, 5)])
    vehicle = flight.assembly.scenario.true_vehicle
    expected = vehicle.thrust_coefficient * (speeds**2).sum(axis=0) / vehicle.mass
    np.testing.assert_allclose(force[:, 2], expected, rtol=1e-9)
    np.testing.assert_allclose(rates, 0.0, atol=1e-9)


@pytest.mark.parametrize("plant", ["mujoco", "rigid_body", "thesis"])
def test_a_displaced_imu_reads_the_specific_force_of_its_place(plant):
    flight = fly({"imu": {"position": PLACE}}, simulation={"plant": plant})
    vehicle = flight.assembly.scenario.true_vehicle
    force, rates = vectors(flight, "imu_acceleration", "imu_rate")
    omega = np.stack([flight[name] for name in ("p", "q", "r")], axis=-1)
    squares = np.stack([flight[f"rotor_speed_{i}"] ** 2 for i in range(1, 5)])
    thrust, drag = vehicle.thrust_coefficient, vehicle.drag_coefficient
    arm = thrust * vehicle.arm_length
    torque = np.stack(
        [
            arm * (squares[1] - squares[3]),
            arm * (squares[2] - squares[0]),
            drag * (squares[0] - squares[1] + squares[2] - squares[3]),
        ],
        axis=-1,
    )
    inertia = np.array(vehicle.moments)
    turning = (torque - np.cross(omega, inertia * omega)) / inertia
    expected = np.cross(turning, PLACE) + np.cross(omega, np.cross(omega, PLACE))
    expected[:, 2] += thrust * squares.sum(axis=0) / vehicle.mass
    assert np.abs(expected[:, :2]).max() > 0.1
    np.testing.assert_allclose(force, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(rates, omega, rtol=1e-12)


def test_on_the_thesis_s_circle_the_imu_agrees_with_mujoco():
    name = "ch04_tracking/circle#continuous_t2_modified"
    changes = {"sensors.imu.position": PLACE, "simulation.control_timestep": 0.002}
    circle = tiltsim.load_scenario(name, changes)
    plant = make_plant(assemble(circle))
    vehicle, reading, motion = plant.model.body("vehicle").id, [], np.zeros(6)
    for _ in range(40):
        plant.advance(10)
        state = plant.state  # with the number of evaluations
        with control_callback(plant.callback):
            mujoco.mj_forward(plant.model, plant.data)
        mujoco.mj_rnePostConstraint(plant.model, plant.data)
        kind = mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectAcceleration(plant.model, plant.data, kind, vehicle, motion, 1)
        turning, force = motion[:3], motion[3:]
        omega = plant.data.qvel[3:6]
        expected = force + np.cross(turning, PLACE) + np.cross(omega, np.cross(omega, PLACE))
        sample, names = plant.observe(), plant._loop.sample_fields[1:]
        seen = [sample[names.index(f"imu_acceleration_{axis}")] for axis in "xyz"]
        reading.append(np.abs(expected - seen).max())
        plant.state = state
    assert max(reading) < 1e-9


def test_places_away_from_the_center_of_mass_move_with_the_body():
    place = {"position": PLACE}
    flight = fly({"mocap": place, "gps": place, "barometer": place})
    attitude = np.stack([flight[name] for name in ("roll", "pitch", "yaw")], axis=-1)
    omega = np.stack([flight[name] for name in "pqr"], axis=-1)
    turned = [rotation_matrix(row) for row in attitude]
    arms = np.array([rotation @ PLACE for rotation in turned])
    around = np.array(
        [rotation @ np.cross(rate, PLACE) for rotation, rate in zip(turned, omega, strict=True)]
    )
    center = np.stack([flight[axis] for axis in "xyz"], axis=-1)
    velocity = np.stack([flight[name] for name in ("vx", "vy", "vz")], axis=-1)
    mocap, gps, moving = vectors(flight, "mocap", "gps", "gps_velocity")
    np.testing.assert_allclose(mocap, center + arms, atol=1e-12)
    np.testing.assert_allclose(gps, center + arms, atol=1e-12)
    np.testing.assert_allclose(moving, velocity + around, atol=1e-12)
    np.testing.assert_allclose(flight["barometer_altitude"], mocap[:, 2], atol=1e-14)


def test_a_disturbance_that_accelerates_is_felt():
    push = [{"type": "acceleration", "value": [1.5, 0.0, 0.0]}]
    calm, pushed = fly({"imu": {}}), fly({"imu": {}}, disturbance=push)
    first = [vectors(each, "imu_acceleration")[0][0] for each in (calm, pushed)]
    np.testing.assert_allclose(first[1] - first[0], [1.5, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("rate", "delay"), [(100.0, 0.0), (50.0, 0.03), (20.0, 0.12), (40.0, 0.01)]
)
def test_a_reading_shows_the_state_of_its_time_after_its_delay(rate, delay):
    flight = fly({"mocap": {"rate": rate, "delay": delay}})
    number = np.floor((flight["time"] - delay) * rate + 1e-6)
    # A reading is taken at the first control step at or after its time.
    taken = np.ceil(number / rate / STEP - 1e-6).astype(int)
    arrived = number >= 0
    assert arrived.sum() > 80
    for axis in "xyz":
        expected = flight[axis][taken[arrived]]
        np.testing.assert_allclose(flight[f"mocap_{axis}"][arrived], expected, atol=1e-14)
        assert not flight[f"mocap_{axis}"][~arrived].any()
    new = np.diff(np.maximum(number, -1.0), prepend=-1.0) > 0
    np.testing.assert_array_equal(flight["mocap_new"], new)


def test_lost_readings_leave_the_last_one():
    flight = fly({"gps": {"dropout": 0.3}}, simulation={"duration": 6.0})
    new, x = flight["gps_new"] > 0.0, flight["gps_x"]
    assert 0.25 < 1.0 - new.mean() < 0.35
    np.testing.assert_allclose(x[new], flight["x"][new], atol=1e-14)
    lost = np.flatnonzero(~new[1:]) + 1
    np.testing.assert_allclose(x[lost], x[lost - 1], rtol=1e-14)


def test_readings_are_multiples_of_the_resolution():
    flight = fly({"barometer": {"resolution": 0.02}, "rotor_speed": {"resolution": 4.0}})
    for name, truth, step in (("barometer_altitude", "z", 0.02), ("rotor_speed_measured_2", "", 4)):
        read = flight[name]
        np.testing.assert_allclose(read / step, np.round(read / step), atol=1e-9)
        true = flight[truth or "rotor_speed_2"]
        assert 0.25 * step < np.abs(read - true).max() <= 0.5 * step + 1e-12


def test_errors_are_in_the_axes_of_the_imu_and_readings_in_the_body_s():
    bias = [0.5, 0.0, 0.0]
    ideal = fly({"imu": {}})
    turned = fly({"imu": {"accelerometer_bias": bias, "orientation": [0.0, 0.0, np.pi / 2]}})
    difference = vectors(turned, "imu_acceleration")[0] - vectors(ideal, "imu_acceleration")[0]
    np.testing.assert_allclose(difference, np.tile([0.0, 0.5, 0.0], (len(ideal), 1)), atol=1e-12)


def test_a_turned_magnetometer_errs_in_its_own_axes():
    bias = {"bias": [0.1, 0.0, 0.0]}
    ideal, turned = (
        fly({"magnetometer": keys}) for keys in ({}, bias | {"orientation": [0.0, 0.0, np.pi / 2]})
    )
    difference = vectors(turned, "magnetometer")[0] - vectors(ideal, "magnetometer")[0]
    np.testing.assert_allclose(difference, np.tile([0.0, 0.1, 0.0], (len(ideal), 1)), atol=1e-12)


def test_the_field_points_north_and_down_in_body_axes():
    flight = fly({"magnetometer": {"inclination": 0.6}})
    for row in (0, 30, 90):
        attitude = np.array([flight[name][row] for name in ("roll", "pitch", "yaw")])
        expected = rotation_matrix(attitude).T @ [np.cos(0.6), 0.0, -np.sin(0.6)]
        seen = [flight[f"magnetometer_{axis}"][row] for axis in "xyz"]
        np.testing.assert_allclose(seen, expected, atol=1e-12)


def test_a_bias_walks_from_reading_to_reading():
    flight = fly({"imu": {"gyro_random_walk": 0.1}}, simulation={"duration": 8.0})
    bias = vectors(flight, "imu_rate")[0] - np.stack([flight[n] for n in "pqr"], axis=-1)
    steps = np.diff(bias, axis=0)
    assert steps.std() == pytest.approx(0.1 * np.sqrt(STEP), rel=0.05)
    assert abs(np.corrcoef(steps[1:, 0], steps[:-1, 0])[0, 1]) < 0.1


NOISY = {
    "imu": {"preset": "mpu_6050", "gyro_random_walk": 1e-3, "position": PLACE},
    "mocap": {"rate": 50.0, "delay": 0.03, "attitude_noise": 0.01, "dropout": 0.1},
    "gps": {"rate": 10.0, "delay": 0.2, "position_random_walk": 0.1},
    "barometer": {"noise": 0.1},
    "magnetometer": {"noise": 0.01},
    "rotor_speed": {"noise": 2.0},
}


@pytest.mark.parametrize("plant", ["mujoco", "rigid_body"])
def test_readings_are_equal_on_both_engines_and_the_flight_is_the_one_without(plant):
    flights = [
        fly(NOISY, simulation={"plant": plant, "engine": engine, "duration": 0.5})
        for engine in ("python", "native")
    ]
    np.testing.assert_array_equal(flights[0].samples, flights[1].samples)
    alone = fly({}, simulation={"plant": plant, "duration": 0.5})
    for name in alone.units:
        np.testing.assert_array_equal(flights[0][name], alone[name], err_msg=name)
    other = fly(NOISY, simulation={"plant": plant, "duration": 0.5, "seed": 1})
    assert (other["barometer_altitude"] != flights[0]["barometer_altitude"]).all()


def test_a_preset_fills_in_what_is_not_given():
    table = ImuTable(preset="bmi088", gyro_noise_density=0.1)
    assert table.gyro_noise_density == 0.1
    assert table.accelerometer_noise_density == pytest.approx(190e-6 * 9.80665)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"sensors": {"imu": {}}, "simulation": {"control_timestep": 0.0}}, "control_timestep"),
        ({"sensors": {"gps": {"rate": 200.0}}}, "sensors.gps.rate = 200.0: at most 100"),
        ({"sensors": {"gps": {"delay": 2.0}}}, "sensors.gps.delay = 2.0: at most 64 readings"),
        ({"sensors": {"gps": {"dropout": 1.0}}}, "sensors.gps.dropout"),
        ({"sensors": {"imu": {"preset": "best"}}}, "sensors.imu.preset"),
        ({"sensors": {"imu": {"colour": 1}}}, "sensors.imu.colour"),
        ({"sensors": {"mocap": {}}, "ground": {"height": -1.0}}, "sensors.mocap = {}: does not"),
        ({"sensors": {"gps": {"resolution": 1e-320}}}, "or at least 1e-12"),
        (
            {"sensors": {"imu": {}}, "controller": {"law": "python", "function": "a.py:f"}},
            "observes the state, not readings; choose",
        ),
        (
            {"sensors": {}, "controller": {"law": "pid", "estimator": {"gat": 1.0}}},
            "estimator.gat = 1.0: unknown key; did you mean gate? known: gate, initial_attitude, "
            "initial_position, initial_velocity, type",
        ),
        (
            {"sensors": {}, "controller": {"law": "pid", "estimator": {"gate": -1.0}}},
            "controller.estimator.gate = -1.0: must be greater than 0.5",
        ),
    ],
)
def test_bad_keys_are_refused_in_one_line(tables, message):
    with pytest.raises(InputError) as error:
        scenario(**tables)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert "also wrong" not in str(error.value)


def read_an_hour(own, rate, *, first):
    """Draws of an instrument for an hour, shape (readings, 3)."""
    numbers = np.arange(3600.0 * rate)

    @traceable
    def row(number, _values, p, _knots):
        if first is None:
            return instruments.reading(p, np.zeros(6), number)
        return p.walk * instruments.draws(p, number, first, 6)

    none = np.zeros((len(numbers), 1))
    return evaluate_over_samples(row, 6, numbers, none, ControlSetup(own))


def allan_deviation(values, rate, span):
    """The overlapping Allan deviation over a span (s), the root mean square of all axes."""
    size = int(span * rate)
    angle = np.cumsum(np.vstack([np.zeros(values.shape[1]), values]), axis=0) / rate
    second = angle[2 * size :] - 2.0 * angle[size:-size] + angle[: -2 * size]
    return float(np.sqrt(0.5 * np.mean(second**2))) / span


@pytest.mark.slow
def test_the_allan_deviation_of_an_hour_has_the_densities():
    rate, table = (
        100.0,
        ImuTable(
            preset="bmi088",
            accelerometer_resolution=0.0,
            gyro_resolution=0.0,
            accelerometer_random_walk=3e-4,
            gyro_random_walk=2e-5,
        ),
    )
    errors = table.errors(rate, 0)
    ideal = {"delay": 0.0, "dropout": 0.0, "place": (0.0,) * 3, "axes": (0.0,) * 9}
    own = instruments.instrument_record(6)(
        seed=3.0, channel=1000.0, period=1.0 / rate, **ideal, **errors._asdict()
    )
    white = read_an_hour(own, rate, first=None)
    walked = np.cumsum(read_an_hour(own, rate, first=32.0), axis=0)
    for axes, density, walk in (
        (slice(0, 3), table.accelerometer_noise_density, table.accelerometer_random_walk),
        (slice(3, 6), table.gyro_noise_density, table.gyro_random_walk),
    ):
        for span in (0.1, 1.0, 10.0):
            found = allan_deviation(white[:, axes], rate, span)
            assert found == pytest.approx(density / np.sqrt(span), rel=0.05)
        for span in (1.0, 5.0):
            found = allan_deviation(walked[:, axes], rate, span)
            assert found == pytest.approx(walk * np.sqrt(span / 3.0), rel=0.05)
