"""The layer of real actuators and sensors between a law and its vehicle."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.laws.restarting import assert_restarts
from tiltsim.errors import InputError
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.scenario.loading import merge
from tiltsim.scenario.scenario import plan_flight
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.analysis.stability import is_hurwitz
from tiltsim_controllers.laws.gains import GAIN_SETS

ATTITUDE = (40.0, 600.0, 4000.0)  # of the gain set "exact"
BASE = {
    "simulation": {"duration": 0.6, "timestep": 0.002, "engine": "python"},
    "controller": {"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
    "gait": {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0},
    "initial": {"rotor_speed": 361.0, "attitude": [0.05, -0.03, 0.02]},
}
LATE = {"control_timestep": 0.004, "control_latency": 0.012}
EVERYTHING = {
    "vehicle": {
        "rotor_time_constant": 0.02,
        "tilt_servo": {"max_rate": 1.5},
        "min_rotor_speed": 200.0,
        "max_rotor_speed": 400.0,
    },
    "sensors": {
        **{"attitude_noise": 0.005, "body_rates_noise": 0.01, "position_noise": 0.01},
        **{"velocity_noise": 0.01, "position_bias": [0.1, 0.0, 0.0]},
    },
    "controller": {"allocation": "prioritized"},
    "fault": [
        {"type": "partial_thrust", "rotor": 1, "time": 0.2, "factor": 0.97},
        {"type": "stuck_servo", "rotor": 2, "time": 0.3},
    ],
}


def longest_lag(gains):
    """The time constant (s) of a lag in the input at which a third-order loop turns unstable.

    ``s^3 (T s + 1) + K1 s^2 + K2 s + K3`` is Hurwitz, by Routh, while
    ``T < (K1 K2 - K3) / K2^2``. ``gains`` are K1, K2 and K3.
    """
    k1, k2, k3 = gains
    return (k1 * k2 - k3) / (k2 * k2)


def delay_margin(gains):
    """The delay (s) of the input at which a third-order loop turns unstable, 0 if it is already.

    Where the open loop ``(K1 s^2 + K2 s + K3) / s^3`` has gain one, at up to three frequencies, a
    delay uses up the phase margin; the least delay counts. A command held for a period delays by
    half of it.
    """
    k1, k2, k3 = gains
    if not is_hurwitz((1.0, k1, k2, k3)):
        return 0.0
    squares = np.roots([1.0, -k1 * k1, 2.0 * k1 * k3 - k2 * k2, -k3 * k3])
    real = squares[np.abs(squares.imag) < 1e-9 * np.abs(squares)].real
    crossings = np.sqrt(real[real > 0.0])
    s = 1j * crossings
    phases = np.angle((k1 * s * s + k2 * s + k3) / s**3)
    return float((((np.pi + phases) % (2.0 * np.pi)) / crossings).min())


def scenario(*changes, **more):
    tables = BASE
    for change in (*changes, more):
        tables = merge(tables, change)
    return tiltsim.parse_scenario(tables)


def fly(*changes, **more):
    return tiltsim.simulate(scenario(*changes, **more))


def test_an_ideal_vehicle_flies_without_the_layer():
    assert loop_of(scenario()) is LOOPS["attitude_altitude"]
    assert (
        loop_of(scenario(vehicle={"rotor_time_constant": 0.02})) is not LOOPS["attitude_altitude"]
    )


@pytest.mark.parametrize("timing", [{}, {"control_timestep": 0.004}], ids=["continuous", "held"])
def test_the_layer_alone_changes_nothing(timing):
    never = [{"type": "rotor_loss", "rotor": 1, "time": 1e6}]
    plain, layered = fly(simulation=timing), fly(simulation=timing, fault=never)
    np.testing.assert_array_equal(plain.samples, layered.samples)


@pytest.mark.parametrize("timing", [{}, LATE], ids=["continuous", "late"])
def test_a_saved_state_restarts_bit_identically(timing):
    assert_restarts(scenario(EVERYTHING, simulation=timing), 101, 60)


def test_the_full_pose_law_flies_in_the_layer():
    gains = {"position": list(ATTITUDE), "attitude": list(ATTITUDE)}
    flight = tiltsim.simulate(
        tiltsim.parse_scenario(
            {
                "simulation": BASE["simulation"] | LATE,
                "initial": BASE["initial"],
                "vehicle": {"rotor_time_constant": 0.005},
                "controller": {"law": "full_pose", "gains": gains},
                "gait": {"type": "fixed", "angles": [-0.1, 0.1, -0.2, 0.1]},
            }
        )
    )
    assert flight.end.kind == "completed"
    assert abs(flight["roll"][-1]) < 0.01


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_full_pose_commands_no_pod_beyond_its_limit(plant):
    """At the servo's stop a pod stays below the same limit, however long the law turns it on."""
    flight = tiltsim.simulate(
        tiltsim.parse_scenario(
            {
                "simulation": BASE["simulation"] | {"timestep": 0.001, "plant": plant},
                "initial": {"position": [-3.0, 0.0, 0.0], "rotor_speed": 361.0},
                "vehicle": {"tilt_servo": {"max_angle": 0.3}},
                "controller": {
                    **{"law": "full_pose", "max_tilt_angle": 0.3, "max_tilt_rate": 10.0},
                    "gains": {"position": [15.0, 75.0, 125.0], "attitude": [40.0, 600.0, 4000.0]},
                },
            }
        )
    )
    assert flight["alpha_2"].max() == pytest.approx(0.3, abs=0.001)
    assert flight["tilt_command_2"].max() == pytest.approx(0.3, abs=0.02)


# --- rotors ------------------------------------------------------------------------------------


def test_rotors_follow_commanded_speeds_with_a_first_order_lag():
    lag = 0.03
    plant = make_plant(
        assemble(scenario(vehicle={"rotor_time_constant": lag}, simulation={"timestep": 0.0005}))
    )
    speeds, commanded = [], []
    for _ in range(200):
        plant.advance(1)
        speeds.append(plant.data.act[:4].copy())
        commanded.append(plant.data.act[4:8].copy())
    speeds, commanded = np.array(speeds), np.array(commanded)
    assert np.abs(commanded - speeds).max() > 1.0
    rates = (speeds[2:] - speeds[:-2]) / 0.001
    np.testing.assert_allclose(rates, (commanded - speeds)[1:-1] / lag, atol=0.5)


def test_the_longest_lag_is_where_routh_says():
    longest = longest_lag(ATTITUDE)
    assert longest == pytest.approx((40 * 600 - 4000) / 600**2)
    for factor, stable in ((0.999, True), (1.001, False)):
        assert is_hurwitz([factor * longest, 1.0, *ATTITUDE]) is stable


def test_at_the_delay_margin_a_pole_lies_on_the_imaginary_axis():
    margin = delay_margin(ATTITUDE)
    omega = np.linspace(10.0, 100.0, 100_001)
    s = 1j * omega
    characteristic = s**3 + np.polyval(ATTITUDE, s) * np.exp(-s * margin)
    assert (np.abs(characteristic) / omega**3).min() < 1e-4
    shorter = s**3 + np.polyval(ATTITUDE, s) * np.exp(-s * 0.9 * margin)
    assert (np.abs(shorter) / omega**3).min() > 1e-2


def test_the_delay_margin_is_the_least_of_several():
    """A weakly damped loop whose open loop has gain one near 1 rad/s, twice, and near 9.9."""
    gains = (10.0, 1.0, 9.99)
    margin = delay_margin(gains)
    assert margin < 0.11  # at 9.9 rad/s it would be 0.158
    omega = np.linspace(0.9, 1.1, 100_001)
    s = 1j * omega
    characteristic = s**3 + np.polyval(gains, s) * np.exp(-s * margin)
    assert (np.abs(characteristic) / omega**3).min() < 1e-4
    assert delay_margin((1.0, 10.0, 50.0)) == 0.0


def test_the_named_gains_are_those_assumed_here():
    assert GAIN_SETS["exact"].loops["roll"] == ATTITUDE


@pytest.mark.parametrize(("share", "survives"), [(0.9, True), (1.1, False)])
def test_flights_with_rotor_lag_end_where_routh_says(share, survives):
    flight = fly(
        simulation={"duration": 6.0},
        vehicle={"rotor_time_constant": share * longest_lag(ATTITUDE)},
        gait={"amplitude": 0.0},
        initial={"attitude": [1e-3, 0.0, 0.0]},
    )
    early, late = (np.abs(flight["p"][part]).max() for part in (slice(100, 300), slice(500, None)))
    assert bool(late < early) is survives


@pytest.mark.parametrize(
    ("plant", "timing"), [("thesis", {}), ("mujoco", {"control_timestep": 0.004})]
)
def test_a_lagging_rotor_leaves_its_limit_as_soon_as_one_without_lag(plant, timing):
    """Commands beyond the limit would wind up: an overshoot of 0.47 m, or divergence if held."""
    past = []
    for lag in ({}, {"rotor_time_constant": 0.02}):
        flight = fly(
            simulation={"duration": 5.4, "timestep": 0.002, "plant": plant, **timing},
            vehicle={"min_rotor_speed": 200.0, "max_rotor_speed": 390.0, **lag},
            gait={"amplitude": 0.0},
            initial={"position": [0.0, 0.0, -6.0]},
            reference={"type": "setpoint"},
        )
        assert max(np.abs(flight["rotor_speed_1"])) == pytest.approx(390.0)
        past.append(flight["z"].max())
    assert past[1] == pytest.approx(past[0], abs=0.02)


def fly_to_the_limits(plant, timestep, **simulation):
    """Onto a circle with lagging rotors that are commanded beyond either limit."""
    return tiltsim.simulate(
        tiltsim.parse_scenario(
            BASE
            | {
                "simulation": {"timestep": timestep, "plant": plant, **simulation},
                "initial": {"rotor_speed": 361.0},
                "vehicle": {
                    **{"min_rotor_speed": 330.0, "max_rotor_speed": 380.0},
                    "rotor_time_constant": 0.03,
                },
                "gait": {"type": "fixed", "angles": [-0.325, -0.325, 0.325, 0.325]},
                "reference": {"type": "circle", "radius": 2.0, "angular_frequency": 0.5},
            }
        )
    )


def distance(flight, other):
    """The largest distance (m) between two flights."""
    return np.linalg.norm([flight[axis] - other[axis] for axis in "xyz"], axis=0).max()


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_a_limited_command_hardly_depends_on_the_step(plant):
    """First order: 4 um a millisecond. Commands that pass their limit by a step: 1 to 5 mm."""
    short = {"duration": 0.48, "record_timestep": 0.04, "engine": "python"}
    fine = fly_to_the_limits(plant, 0.0005, **short)
    for step in (0.004, 0.002):
        assert distance(fly_to_the_limits(plant, step, **short), fine) < 0.01 * step


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_flights_at_the_limits_converge_at_first_order(plant):
    long = {"duration": 8.0, "record_timestep": 0.1, "engine": "native"}
    steps = [0.002 / 2**halving for halving in range(5)]
    flights = [fly_to_the_limits(plant, step, **long) for step in steps]
    for step, coarse, fine in zip(steps, flights, flights[1:], strict=False):
        assert distance(coarse, fine) < 0.6 * step
    assert distance(flights[1], flights[-1]) < 0.002


# --- servos ------------------------------------------------------------------------------------


def test_a_servo_turns_no_faster_than_it_can():
    flight = fly(
        vehicle={"tilt_servo": {"max_rate": 2.0}},
        fault=[{"type": "stuck_servo", "rotor": 1, "time": 0.1, "angle": 0.2}],
        simulation={"duration": 0.25, "record_timestep": 0.002},
        gait={"amplitude": 0.0},
    )
    alpha, rate, time = flight["alpha_1"], flight["alpha_rate_1"], flight["time"]
    assert rate.max() == pytest.approx(2.0, rel=1e-3)
    arrived = time[alpha > 0.19][0]
    lag = 2.0 / 300.0  # of the velocity loop, and of the position loop at the end
    assert arrived - 0.1 == pytest.approx(0.19 / 2.0, abs=2.0 * lag)


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_a_flight_begins_in_the_midst_of_its_gait(plant):
    """Pods that began at rest would fall behind by 1.3 / (5 e) rad; stiff ones, by 1.6 mrad."""
    flight = fly(
        simulation={"duration": 0.3, "plant": plant},
        vehicle={"tilt_servo": {"natural_frequency": 5.0}},
        gait={"type": "trot_continuous", "amplitude": 0.65, "period": 2.0},
    )
    for rotor in (1, 2, 3, 4):
        assert abs(flight[f"alpha_rate_{rotor}"][0]) == 1.3
        off = flight[f"alpha_{rotor}"] - flight[f"alpha_ref_{rotor}"]
        assert np.abs(off).max() < 1e-6


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_no_pod_begins_faster_than_its_servo(plant):
    flight = fly(
        simulation={"duration": 0.1, "plant": plant},
        vehicle={"tilt_servo": {"max_rate": 0.2}},
        gait={"type": "trot_continuous", "amplitude": 0.65, "period": 2.0},
    )
    rates = [flight[f"alpha_rate_{rotor}"] for rotor in (1, 2, 3, 4)]
    assert [rate[0] for rate in rates] == [0.2, 0.2, -0.2, -0.2]
    assert np.abs(rates).max() == pytest.approx(0.2, rel=1e-3)


# --- allocation --------------------------------------------------------------------------------


def test_allocation_from_a_lean_does_not_hang_on_a_last_bit():
    """From 0.27 s on one of two opposite rotors is at its limit, on a gait that is symmetric."""
    changes = {"simulation.duration": 0.6, "simulation.engine": "python"}
    address = "beyond/allocation#prioritized_from_a_lean"
    one, other = (
        tiltsim.simulate(
            tiltsim.load_scenario(address, {**changes, "initial.position": [x, 0.0, -20.0]})
        )
        for x in (2.0, 2.0 + 1e-12)
    )
    assert np.abs(one["r"]).max() > 0.1
    assert np.abs(one["r"] - other["r"]).max() < 1e-9


# --- latency -----------------------------------------------------------------------------------


def test_commands_take_effect_after_the_latency():
    late = scenario(simulation=LATE)
    plant = make_plant(assemble(late))
    controls = LOOPS["attitude_altitude"].controls
    setup = loop_of(late).setup(plan_flight(late), 0.0)
    requested, in_force = [], []
    for _ in range(30):
        data = plant.data
        state = data.qpos.tolist(), data.qvel.tolist(), data.act[:4].tolist()
        ctrl = controls(plant.time, *state, setup.parameters.inner, setup.knots)
        requested.append([*ctrl[:4], *ctrl[8:12]])
        plant.advance(1)
        in_force.append(plant.data.ctrl[-8:].copy())
        plant.advance(1)
    np.testing.assert_allclose(in_force[3:], requested[:-3], rtol=1e-9, atol=1e-9)
    assert np.abs(np.array(requested[3]) - requested[0])[4:].max() > 1.0


@pytest.mark.parametrize(("latency", "survives"), [(0.024, True), (0.032, False)])
def test_flights_with_latency_end_where_the_delay_margin_says(latency, survives):
    assert (latency + 0.002 < delay_margin(ATTITUDE)) is survives
    flight = fly(
        simulation={"duration": 4.0, "control_timestep": 0.004, "control_latency": latency},
        gait={"amplitude": 0.0},
        initial={"attitude": [1e-3, 0.0, 0.0]},
    )
    assert (flight.end.kind == "completed" and bool(abs(flight["p"][-1]) < 1e-3)) is survives


# --- sensors -----------------------------------------------------------------------------------


def test_a_bias_of_position_is_the_error_that_remains():
    flight = fly(
        simulation={"duration": 3.0, "timestep": 0.004},
        sensors={"position_bias": [0.2, -0.1, 0.05]},
        gait={"amplitude": 0.0},
        initial={"attitude": [0.0, 0.0, 0.0], "position": [-0.2, 0.1, -0.05]},
    )
    metrics = flight.metrics()
    errors = [metrics[f"final_position_error_{axis}"] for axis in "xyz"]
    np.testing.assert_allclose(errors, [0.2, -0.1, 0.05], atol=2e-3)


def test_noise_is_the_seeds():
    noise = {"sensors": {"attitude_noise": 0.01}}
    first, again, other = (fly(noise, simulation={"seed": seed}).samples for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-4


# --- faults ------------------------------------------------------------------------------------


def test_a_lost_rotor_makes_neither_thrust_nor_torque():
    flight = fly(
        simulation={"duration": 0.3},
        fault=[{"type": "rotor_loss", "rotor": 2, "time": 0.2}],
        gait={"amplitude": 0.0},
        initial={"attitude": [0.0, 0.0, 0.0]},
    )
    lost = flight["time"] >= 0.2
    assert (flight["thrust_2"][lost] == 0.0).all()
    assert (flight["thrust_2"][~lost] > 1.0).all()
    # The roll torque of rotor 4 alone: p' = -L K_f w_4 / I_xx.
    p, time, speed = flight["p"], flight["time"], flight["rotor_speed_4"]
    desired = -0.1785 * 8.048e-6 * speed[21] ** 2 / 2.24e-3
    assert (p[22] - p[21]) / (time[22] - time[21]) == pytest.approx(desired, rel=0.1)


# --- mistakes ----------------------------------------------------------------------------------

MISTAKES = {
    "latency without sampling": (
        {"simulation": {"control_latency": 0.01}},
        "control_latency.*must be a multiple of control_timestep",
    ),
    "broken latency": (
        {"simulation": {"control_timestep": 0.004, "control_latency": 0.006}},
        "control_latency.*must be 1 to 20 times control_timestep",
    ),
    "nothing to allocate": (
        {"controller": {"allocation": "prioritized"}},
        "allocation.*needs rotor limits",
    ),
    "the same rotor twice": (
        {
            "fault": [
                {"type": "rotor_loss", "rotor": 2, "time": 1.0},
                {"type": "partial_thrust", "rotor": 2, "time": 2.0, "factor": 0.5},
            ]
        },
        "fault.rotor.*more than one loss of thrust",
    ),
    "no such rotor": ({"fault": [{"type": "rotor_loss", "rotor": 5, "time": 1.0}]}, "rotor"),
    "no such fault": ({"fault": [{"type": "fire", "rotor": 1, "time": 1.0}]}, "type"),
    "misspelt": ({"sensors": {"atitude_noise": 0.1}}, "attitude_noise"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_refused_in_words(name):
    tables, words = MISTAKES[name]
    with pytest.raises(InputError, match=words):
        scenario(tables)


def test_the_quadrotor_has_none_of_this():
    with pytest.raises(InputError, match=r"sensors.*quadrotor"):
        tiltsim.parse_scenario(
            {
                "vehicle": {"model": "quadrotor"},
                "controller": {"law": "yaw_position"},
                "sensors": {"attitude_noise": 0.01},
            }
        )
