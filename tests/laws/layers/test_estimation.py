"""Laws on the estimate of an error-state filter: consistency, engines, refusals."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import tiltsim
from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.laws.layers import estimation
from tiltsim.laws.layers.estimation import Fusion
from tiltsim.laws.layers.instruments import instruments_of
from tiltsim.views.figures.panels import errors_of
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.scalar import chi_square_quantile

IMU = {"gyro_noise_density": 2.5e-4, "accelerometer_noise_density": 2e-3}
MOCAP = {"rate": 50.0, "position_noise": 0.004, "attitude_noise": 0.01}
GPS = {"rate": 10.0, "position_noise": 0.3, "velocity_noise": 0.05, "delay": 0.06}
INSTRUMENTS = {
    "mocap": {"imu": IMU, "mocap": MOCAP},
    "late": {"imu": {**IMU, "delay": 0.01}, "mocap": {**MOCAP, "delay": 0.03, "dropout": 0.2}},
    "gps": {
        "imu": {**IMU, "position": [0.05, 0.0, 0.02], "orientation": [0.1, 0.2, 0.3]},
        "gps": GPS,
        "barometer": {"rate": 25.0, "noise": 0.05},
        "magnetometer": {"rate": 25.0, "noise": 0.01},
    },
}


def scenario(sensors, model="quadrotor", **changes):
    whole = {
        "vehicle": {"model": model},
        "controller": {"law": "geometric", "estimator": "ekf"},
        "reference": {"type": "setpoint", "position": [0.3, -0.2, 0.5], "yaw": 0.3},
        "sensors": sensors,
        "simulation": {"duration": 1.0, "timestep": 0.002, "control_timestep": 0.01},
    }
    return tiltsim.load_scenario(tiltsim.parse_scenario(whole), changes)


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_both_engines_agree_in_every_bit(name):
    """For three readings of the slowest instrument."""
    short = {"simulation.duration": 0.32}
    python, native = (
        tiltsim.simulate(scenario(INSTRUMENTS[name], **short, **{"simulation.engine": engine}))
        for engine in ("python", "native")
    )
    np.testing.assert_array_equal(python.samples, native.samples)


@pytest.mark.parametrize("plant", ["rigid_body", "thesis"])
def test_equations_fly_it_as_mujoco_does(plant):
    flown = [
        tiltsim.simulate(scenario(INSTRUMENTS["mocap"], **{"simulation.plant": each}))
        for each in ("mujoco", plant)
    ]
    one, other = (flight["estimate_z"] for flight in flown)
    np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_errors_stay_within_four_deviations(name):
    flight = tiltsim.simulate(scenario(INSTRUMENTS[name], **{"simulation.duration": 4.0}))
    for axis in "xyz":
        # The filter's point is the IMU, a few centimeters away, at the same velocity in hover.
        error = flight[axis] - flight[f"estimate_{axis}"]
        assert np.all(np.abs(error) < 4.5 * flight[f"deviation_{axis}"])
    metrics = flight.metrics()
    assert 0.5 < metrics["nees"] < 1.6
    assert 0.8 < metrics["nis"] < 1.2


@pytest.mark.slow
def test_a_delay_is_fused_at_the_time_of_the_measurement():
    """Moving at 1 m/s, a reading that is 30 ms old and taken for a new one would be 30 mm off."""
    sensors = {"imu": IMU, "mocap": {**MOCAP, "delay": 0.03, "position_noise": 1e-3}}
    moving = {
        "reference.type": "line",
        "reference.velocity": [1.0, 0.0, 0.0],
        "initial.velocity": [1.0, 0.0, 0.0],
        "simulation.duration": 4.0,
    }
    flight = tiltsim.simulate(scenario(sensors, **moving))
    late = flight["time"] > 2.0
    assert np.abs(flight["x"] - flight["estimate_x"])[late].max() < 5e-3
    assert flight["vx"][late].min() > 0.9


def test_the_filter_starts_at_the_truth_with_errors_of_its_covariance():
    flights = [
        tiltsim.simulate(
            scenario(INSTRUMENTS["late"], **{"simulation.seed": seed, "simulation.duration": 0.01})
        )
        for seed in range(60)
    ]
    errors = np.array([flight["estimate_x"][0] for flight in flights])
    assert len(np.unique(errors)) == 60
    assert 0.035 < errors.std() < 0.065
    assert flights[0]["deviation_x"][0] == pytest.approx(0.05)


def test_outliers_are_refused():
    """Readings beyond the gate leave the estimate, which goes on by the IMU."""
    sensors = {"imu": IMU, "mocap": {**MOCAP, "position_bias": [5.0, 0.0, 0.0]}}
    flight = tiltsim.simulate(scenario(sensors))
    assert np.abs(flight["x"] - flight["estimate_x"]).max() < 0.5
    assert flight["innovation_mocap_position_x"].max() > 50.0


@pytest.mark.slow
def test_ten_times_the_noise_worsens_the_flight():
    def rms(factor):
        noisy = {
            name: {key: value * factor if "noise" in key else value for key, value in keys.items()}
            for name, keys in INSTRUMENTS["mocap"].items()
        }
        flight = tiltsim.simulate(scenario(noisy, **{"simulation.duration": 6.0}))
        late = flight["time"] > 3.0
        return float(np.sqrt(np.mean((flight["x_ref"] - flight["x"])[late] ** 2)))

    assert rms(10.0) > 3.0 * rms(1.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sensors": {"mocap": MOCAP}}, r"controller.estimator = .ekf.: needs \[sensors.imu\]"),
        ({"sensors": {"imu": IMU}}, r"and \[sensors.mocap\] or \[sensors.gps\]"),
        (
            {
                "sensors": {**INSTRUMENTS["mocap"], "position_noise": 0.1},
                "model": "tiltrotor",
                "simulation.control_timestep": 0.002,
                "simulation.timestep": 0.001,
            },
            "remove noise and bias",
        ),
        ({"controller.estimator": "ukf"}, "estimator"),
        ({"controller.estimator": {"gate": 2.0}}, "estimator.gate"),
    ],
)
def test_refusals_name_the_key(changes, words):
    with pytest.raises(InputError, match=words):
        scenario(changes.pop("sensors", INSTRUMENTS["mocap"]), **changes)


OWN = """
import tiltsim
from tiltsim import xp


def fly(observed):
    \"\"\"Altitude by an alpha-beta filter of a barometer, upright by the true attitude.\"\"\"
    height, climb = observed.discrete
    force = observed.readings[2]
    reading, new = observed.readings[7], observed.readings[8]
    step, weight = 0.01, observed.vehicle.gravity
    ahead = height + step * climb
    error = new * (reading - ahead)
    height, climb = ahead + 0.2 * error, climb + step * (force - weight) + 0.5 * error
    lift = weight + 4.0 * (observed.reference.position[2] - height) - 4.0 * climb
    roll, pitch, _ = observed.attitude
    torque = -xp.array([0.3 * roll, 0.3 * pitch, 0.0]) - 0.08 * observed.body_rates
    even = observed.vehicle.mass * lift * xp.array([0.25, 0.25, 0.25, 0.25])
    turn = observed.torque.T @ torque
    return tiltsim.Command(thrusts=even + 5.0 * turn, discrete=xp.array([height, climb]))
"""


def test_a_custom_law_estimates_from_the_readings(tmp_path):
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    flown = []
    for engine in ("python", "native"):
        flight = tiltsim.simulate(
            {
                "vehicle": {"model": "quadrotor"},
                "controller": {
                    "law": "numpy",
                    "function": str(tmp_path / "own.py:fly"),
                    "discrete_states": {"state_height": "m", "state_climb": "m/s"},
                },
                "reference": {"type": "setpoint", "position": [0.0, 0.0, 0.4]},
                "sensors": {"imu": IMU, "barometer": {"rate": 50.0, "noise": 0.01}},
                "simulation": {"duration": 5.0, "control_timestep": 0.01, "engine": engine},
            }
        )
        flown.append(flight)
    assert np.abs(flown[0]["z"][-100:] - 0.4).max() < 0.1
    assert np.abs(flown[0]["z"] - flown[0]["state_height"])[-100:].max() < 0.05
    np.testing.assert_array_equal(flown[0].samples, flown[1].samples)


def test_lines_are_as_long_as_the_longest_delay():
    fusion = Fusion(instruments_of(scenario(INSTRUMENTS["late"])))
    assert (fusion.waits(fusion.imu), fusion.imu.late) == (2, 1)
    assert fusion.waits(fusion.correctors[0]) == 0
    fusion = Fusion(instruments_of(scenario(INSTRUMENTS["gps"])))
    assert [fusion.waits(each) for each in fusion.correctors] == [0, 6, 6]


@pytest.mark.parametrize("degrees", [9, 450, 1e5])
def test_quantiles_of_the_chi_square_distribution(degrees):
    for share in (0.025, 0.975, 0.9999):
        expected = chi2.ppf(share, degrees)
        assert chi_square_quantile(share, degrees) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("degrees", [1, 3])
def test_gates_of_few_components(degrees):
    for share in (0.99, 0.9999):
        expected = chi2.ppf(share, degrees)
        assert chi_square_quantile(share, degrees) == pytest.approx(expected, rel=0.05)


@pytest.mark.slow
def test_fifty_seeds_are_consistent():
    """Averages over 50 flights are within the 95 % bands of their chi-square distributions."""
    base, signs = tiltsim.load_scenario("beyond/estimator"), np.random.default_rng(1)
    several = []
    for seed in range(50):
        draw = signs.choice([-1.0, 1.0], size=6)
        changes = {
            "simulation.plant": "rigid_body",  # flies many side by side
            "simulation.timestep": 0.002,
            "simulation.seed": seed,
            "simulation.duration": 8.0,
            "sensors.imu.gyro_bias": (0.01 * draw[:3]).tolist(),
            "sensors.imu.accelerometer_bias": (0.1 * draw[3:]).tolist(),
        }
        several.append(base.replace(changes))
    flights = [row.flight for row in tiltsim.fly(several, keep_samples=True)]
    nees = np.mean([flight["nees"][::100] for flight in flights], axis=0)
    low, high = chi2.ppf([0.025, 0.975], 50 * 9) / 50
    assert len(nees) == 9
    assert np.all((low < nees) & (nees < high))
    count = sum(flight["nis_count"][-1] for flight in flights)
    nis = sum(flight["nis"][-1] for flight in flights)
    low, high = chi2.ppf([0.025, 0.975], count)
    assert low < nis < high


@pytest.mark.slow
@pytest.mark.parametrize("name", INSTRUMENTS)
def test_a_native_sample_takes_less_than_fifteen_microseconds(name):
    """The filter alone with all readings due, the fastest of five runs."""
    assembly = assemble(scenario(INSTRUMENTS[name]))
    fusion = Fusion(instruments_of(assembly.scenario))
    own = assembly.setup.parameters
    while type(own.layer).__name__ != "Estimation":
        own = own.inner
    start = estimation._start(assembly, own.layer, fusion)
    readings = np.ones(fusion.readings)
    first = fusion.imu.first
    readings[first : first + 6] = [0.1, 0.2, 9.8, 0.01, 0.02, 0.03]

    @traceable
    def sample(time, state, parameters, knots):
        first = state[: fusion.readings]
        after = state[fusion.readings :]
        _, present, rates = estimation._filtered(time, first, after, fusion, parameters)
        return xp.hstack([present.position, present.covariance[:1], rates])

    rows = 20_000
    width = 4 + len(start)
    states = np.tile(np.hstack([readings, start]), (rows, 1))
    setup, time, times = ControlSetup(own.layer), np.full(rows, 10.0), []
    for _ in range(5):
        begin = perf_counter()
        evaluate_over_samples(sample, width, time, states, setup)
        times.append(perf_counter() - begin)
    assert min(times) / rows < 15e-6


def test_the_tube_of_the_attitude_turns_about_world_axes():
    flight = tiltsim.simulate(scenario(INSTRUMENTS["mocap"]))
    errors, deviation = errors_of(flight, "attitude")
    true, estimated = (
        Rotation.from_euler("ZYX", np.stack([flight[f"{start}{a}"] for a in angles], axis=-1))
        for angles in [("yaw", "pitch", "roll")]
        for start in ("", "estimate_")
    )
    np.testing.assert_allclose(errors, (true * estimated.inv()).as_rotvec(), atol=1e-5)
    assert np.all(np.abs(errors) < 4.5 * deviation)
