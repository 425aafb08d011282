"""Metrics of flights made by hand, whose numbers are known beforehand."""

from __future__ import annotations

import re
from dataclasses import replace
from math import asin, atan, cos, pi, sin
from pathlib import Path

import numpy as np
import pytest

import tiltsim
from tests.flights import SAMPLE_FIELDS, flight
from tiltsim.commands.files import scenario_schema
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.scenario.loading import load_scenario, parse_scenario
from tiltsim.scenario.metric_names import BOOLEAN_METRICS, METRICS
from tiltsim.vehicles.metrics import _contact_metrics, in_last_second, when_settled
from tiltsim.vehicles.rotorcraft import COLUMNS

R = 2.423e-7 / (0.1785 * 8.048e-6)  # K_m / (L K_f), ch. 3
HOVER = {f"rotor_speed_{i}": sign * 360.0 for i, sign in zip((1, 2, 3, 4), (-1, 1, -1, 1))}
METRICS_PAGE = Path(__file__).parents[2] / "docs" / "metrics.md"
COMPLETED = End("completed", 0.0)


def fly(scenario=None, *, times=None, end=COMPLETED, wall_time=2.0, **columns):
    """A flight whose samples hold these columns, and zero or hover elsewhere."""
    times = np.arange(0.0, 30.25, 0.25) if times is None else np.asarray(times, dtype=float)
    samples = np.zeros((len(times), len(SAMPLE_FIELDS)))
    for name, values in ({"time": times} | HOVER | columns).items():
        samples[:, SAMPLE_FIELDS.index(name)] = values
    return Flight.of_scenario(parse_scenario(scenario or {}), samples, end, "python", wall_time)


TIMES = np.arange(0.0, 30.25, 0.25)  # binary fractions, exact


def test_a_flight_at_rest_on_its_setpoint_has_these_metrics():
    metrics = fly().metrics()
    assert metrics == {
        **{f"final_position_error_{axis}": 0.0 for axis in "xyz"},
        "rms_position_error": 0.0,
        "max_position_error": 0.0,
        "sup_position_error_after_20s": 0.0,
        "least_position_error_after_20s": 0.0,
        **{"final_roll": 0.0, "final_pitch": 0.0, "final_yaw": 0.0},
        "final_attitude_error": 0.0,
        **{"max_abs_roll": 0.0, "max_abs_pitch": 0.0},
        **{"min_rotor_speed": 360.0, "max_rotor_speed": 360.0, "rms_rotor_acceleration": 0.0},
        "max_tilt_rate": 0.0,
        **{"altitude_overshoot": 0.0, "altitude_settling_time": 0.0},
        "min_singularity_margin": pytest.approx(pi / 2),
        "min_decoupling_condition": pytest.approx(R),
        "saturated_fraction": 0.0,
        "diverged": False,
        **{"duration": 30.0, "realtime_factor": 15.0},
    }


def test_a_final_yaw_of_half_a_revolution_is_not_the_mean_of_both_its_signs():
    yaw = np.where(np.arange(TIMES.size) % 2, 3.14, -3.14)
    metrics = fly(yaw=yaw).metrics()
    assert abs(metrics["final_yaw"]) == pytest.approx(pi, abs=2e-3)


def test_all_metrics_are_declared_and_in_this_order():
    metrics = fly().metrics()
    of_the_quadrotor = {"max_published_determinant", "min_published_determinant"}
    of_switching = {"switches", "first_switch_time"}
    of_circles = {"max_orbit_radius_after_20s", "min_orbit_radius_after_20s"}
    of_the_car = {"max_abs_error_x", "max_abs_error_y", "max_lyapunov", "final_input_split"}
    of_limits = {"first_saturation_time", "last_saturation_time"}
    of_multirotors = {"max_null_part"}
    of_the_supervisor = {"max_supervision"}
    others = of_the_quadrotor | of_switching | of_circles | of_the_car | of_limits | of_multirotors
    of_objects = {"peak_force", "time_in_contact", "rms_force_error", "max_cable_tension"}
    of_objects |= {"max_swing", "final_swing"}
    of_objects |= {"nees", "nees_in_band", "nis", "nis_low", "nis_high"}  # of an estimator
    of_objects |= {"minimum_separation", "companion_rms_position_error"}
    others |= of_the_supervisor | of_objects
    assert set(METRICS) - set(metrics) == others
    assert list(metrics) == [name for name in METRICS if name in metrics]


def test_forces_count_from_a_second_after_their_ramp_and_swings_in_the_last_second():
    time = np.linspace(0.0, 10.0, 101)
    commanded = np.clip(time, 0.0, 4.0)  # N; the last sample of the ramp is at 3.9 s
    error = np.where(time > 4.95, np.where(np.arange(101) % 2, 0.3, -0.1), 7.0)
    swing = np.where(time > 8.95, 0.05, 0.2)
    columns = {
        "time": time,
        "push_force_ref": commanded,
        "push_force": commanded + error,
        "cable_tension": np.where(time == 2.0, 3.0, 1.0),
        "sling_tension": np.where(time == 6.0, 5.0, 1.0),
        "swing_x": 0.6 * swing,
        "swing_y": -0.8 * swing,
    }
    found = _contact_metrics(columns, in_last_second(time, 0.1))
    counted = error[time > 4.95]
    assert found["rms_force_error"] == pytest.approx(np.sqrt(np.mean(counted**2)))
    assert found["max_cable_tension"] == 5.0
    assert found["max_swing"] == pytest.approx(0.2)
    assert found["final_swing"] == pytest.approx(0.05)


def test_orbits_are_measured_from_the_center_of_the_circle():
    circle = {"type": "circle", "position": [1.0, -2.0, 0.0], "radius": 5.0}
    scenario = {"reference": circle | {"angular_frequency": 0.1}}
    # An ellipse about the center after 20 s; earlier samples do not count.
    radius_x, radius_y = np.where(TIMES < 20.0, 99.0, 6.0), np.where(TIMES < 20.0, 0.1, 4.0)
    turn = 0.5 * pi * TIMES
    x, y = 1.0 + radius_x * np.cos(turn), -2.0 + radius_y * np.sin(turn)
    metrics = fly(scenario, x=x, y=y).metrics()
    assert metrics["max_orbit_radius_after_20s"] == pytest.approx(6.0)
    assert metrics["min_orbit_radius_after_20s"] == pytest.approx(4.0)
    x_ref, y_ref = 1.0 + 5.0 * np.cos(0.1 * TIMES), -2.0 + 5.0 * np.sin(0.1 * TIMES)
    errors = np.hypot(x_ref - x, y_ref - y)[TIMES >= 20.0]
    assert metrics["least_position_error_after_20s"] == pytest.approx(errors.min())
    assert metrics["sup_position_error_after_20s"] == pytest.approx(errors.max())


def test_metrics_are_plain_numbers_and_truth_values():
    assert {type(value) for value in fly().metrics().values()} == {float, bool}


def test_metrics_are_the_callers_own():
    flight = fly()
    flight.metrics().clear()
    assert flight.metrics()


def test_position_error_is_reference_minus_actual_over_the_last_second():
    scenario = {"reference": {"type": "setpoint", "position": [1.0, 2.0, 3.0]}}
    # Five samples lie in [29, 30]; the mean of the ramp over them is 29.5.
    far = np.where(TIMES < 29.0, 1e6, 4.0)
    metrics = fly(scenario, x=TIMES, y=far, z=far).metrics()
    assert metrics["final_position_error_x"] == 1.0 - 29.5
    assert metrics["final_position_error_y"] == 2.0 - 4.0
    assert metrics["final_position_error_z"] == 3.0 - 4.0


def test_position_error_follows_a_moving_reference():
    scenario = {"reference": {"type": "line", "velocity": [1.5, 1.5, 0.0]}}
    metrics = fly(scenario, x=1.5 * TIMES - 0.25, y=1.5 * TIMES).metrics()
    assert metrics["final_position_error_x"] == 0.25
    assert metrics["final_position_error_y"] == 0.0
    assert metrics["sup_position_error_after_20s"] == 0.25


def test_supremum_of_the_error_is_horizontal_and_counts_from_20_s_on():
    x = np.where(TIMES < 20.0, 100.0, 0.0)
    y = np.zeros_like(TIMES)
    x[TIMES == 20.0], y[TIMES == 20.0] = 3.0, -4.0
    x[TIMES == 25.0] = -4.5
    z = np.full_like(TIMES, 50.0)
    assert fly(x=x, y=y, z=z).metrics()["sup_position_error_after_20s"] == 5.0


def test_short_flights_have_no_settled_error():
    assert "sup_position_error_after_20s" not in fly(times=np.arange(0.0, 20.0, 0.25)).metrics()


def test_flights_without_a_position_loop_have_no_horizontal_error():
    scenario = {
        "reference": {"type": "attitude_altitude", "altitude": 2.0},
        "controller": {"decoupler": "none"},
    }
    metrics = fly(scenario, x=5.0).metrics()
    assert metrics["final_position_error_z"] == 2.0
    absent = {*("final_position_error_x", "final_position_error_y"), "sup_position_error_after_20s"}
    assert not absent & set(metrics)


def test_altitude_settles_when_it_comes_within_5_mm_for_good():
    z = np.where(TIMES < 3.0, -0.1, 0.004)
    z = np.where(TIMES == 5.0, 0.2, z)
    metrics = fly(z=z).metrics()
    assert metrics["altitude_overshoot"] == pytest.approx(0.2)
    assert metrics["altitude_settling_time"] == TIMES[np.flatnonzero(TIMES == 5.0)[0] + 1]
    assert "altitude_settling_time" not in fly(z=0.1).metrics()


def test_attitude_metrics():
    roll = np.where(TIMES == 5.0, -0.5, 0.1)
    pitch = np.where(TIMES == 6.0, 0.4, -0.2)
    metrics = fly(roll=roll, pitch=pitch, yaw=TIMES).metrics()
    assert metrics["final_roll"] == pytest.approx(0.1, rel=1e-15)
    assert metrics["final_pitch"] == pytest.approx(-0.2, rel=1e-15)
    assert metrics["final_yaw"] == 29.5
    assert metrics["max_abs_roll"] == 0.5
    assert metrics["max_abs_pitch"] == 0.4


def test_rotor_speeds_count_along_the_spin_and_are_negative_where_one_reversed():
    metrics = fly(
        rotor_speed_1=np.where(TIMES == 3.0, 20.0, -300.0),
        rotor_speed_4=np.where(TIMES == 4.0, 500.0, 310.0),
    ).metrics()
    assert metrics["min_rotor_speed"] == -20.0
    assert metrics["max_rotor_speed"] == 500.0


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
def test_tilt_rate_is_the_fastest_of_the_four_either_way(rotor):
    rate = np.where(TIMES == 7.0, -1.25, 0.5)
    assert fly(**{f"alpha_rate_{rotor}": rate}).metrics()["max_tilt_rate"] == 1.25


@pytest.mark.parametrize(
    ("roll", "pitch"), [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (0.5, 0.7), (2.0, 0.1), (pi, 0.0)]
)
def test_margin_of_the_untilted_vehicle_is_a_right_angle_minus_its_lean(roll, pitch):
    roll = np.where(TIMES == 2.0, roll, 0.0)
    pitch = np.where(TIMES == 2.0, pitch, 0.0)
    lowest = asin(min(cos(a) * cos(b) for a, b in zip(roll, pitch)))
    margin = fly(roll=roll, pitch=pitch).metrics()["min_singularity_margin"]
    assert margin == pytest.approx(lowest, abs=1e-12)


def test_margin_is_negative_under_the_horizon():
    assert fly(roll=2.0).metrics()["min_singularity_margin"] == pytest.approx(pi / 2 - 2.0)


def test_margin_of_a_tilted_gait_is_the_angle_from_its_force_to_the_horizon():
    # The trot at rho: force direction from ker tau by singular values, ch. 3, Eqs. (3) and (5).
    alpha = np.array([-0.65, -0.65, 0.65, 0.65])
    force, torque = matrices(alpha)
    n = force @ np.linalg.svd(torque)[2][3]
    expected = asin(abs(n[2]) / np.linalg.norm(n))
    margin = fly(**tilted(alpha)).metrics()["min_singularity_margin"]
    assert margin == pytest.approx(expected, abs=1e-12)


DELTA = atan(R)
BLUE = [
    pytest.param((a, b, 2 * DELTA - a, -2 * DELTA - b), id=name)
    for name, a, b in [
        *(("P", DELTA, -DELTA), ("untilted front", 0.0, 0.0)),
        *(("leaning", 0.3, 0.2), ("spread", -0.4, 0.5)),
    ]
]


@pytest.mark.parametrize("alpha", BLUE)
def test_margin_is_zero_where_the_torque_matrix_is_rank_deficient(alpha):
    """Blue gaits (ch. 6): opposite columns of tau cancel, so every attitude is singular."""
    metrics = fly({"gait": {"type": "fixed", "angles": alpha}}, **tilted(alpha)).metrics()
    assert metrics["min_singularity_margin"] == 0.0
    assert metrics["min_decoupling_condition"] == pytest.approx(0.0, abs=1e-15)


def matrices(alpha):
    """F / K_f and tau / (L K_f), ch. 3, Eqs. (3) and (5)."""
    (s1, s2, s3, s4), (c1, c2, c3, c4) = np.sin(alpha), np.cos(alpha)
    force = np.array([[0, s2, 0, -s4], [s1, 0, -s3, 0], [-c1, c2, -c3, c4]])
    torque = np.array(
        [
            [0, c2 - R * s2, 0, -c4 + R * s4],
            [c1 + R * s1, 0, -c3 - R * s3, 0],
            [s1 - R * c1, -s2 - R * c2, s3 - R * c3, -s4 - R * c4],
        ]
    )
    return force, torque


def tilted(alpha):
    return {f"alpha_{i}": angle for i, angle in enumerate(alpha, start=1)}


def test_decoupling_condition_is_the_worst_ratio_of_singular_values():
    alpha, roll, pitch = np.array([0.3, -0.5, 0.2, 0.7]), 0.4, -0.3
    force, torque = matrices(alpha)
    up = [-sin(pitch), sin(roll) * cos(pitch), cos(roll) * cos(pitch)]
    values = np.linalg.svd(np.vstack([torque, up @ force]), compute_uv=False)
    assert values[3] / values[0] < R  # worse than the untilted samples around it
    worst = {name: np.where(TIMES == 9.0, angle, 0.0) for name, angle in tilted(alpha).items()}
    lean = {"roll": np.where(TIMES == 9.0, roll, 0.0), "pitch": np.where(TIMES == 9.0, pitch, 0.0)}
    metrics = fly(**worst, **lean).metrics()
    assert metrics["min_decoupling_condition"] == pytest.approx(values[3] / values[0], rel=1e-12)


def test_saturation_is_measured_in_samples_with_a_rotor_at_its_limit():
    scenario = {
        "vehicle": {"min_rotor_speed": 100.0, "max_rotor_speed": 400.0},
        "simulation": {"duration": 1.0},
    }
    flight = fly(
        scenario,
        times=np.arange(10) / 8,
        rotor_speed_1=-np.array([400.0, 400.0, 399.0, 300, 300, 300, 300, 300, 300, 300]),
        rotor_speed_2=np.array([400.0, 300.0, 300, 300, 101, 100, 300, 300, 300, 300]),
    )
    metrics = flight.metrics()
    assert metrics["saturated_fraction"] == 0.3
    assert (metrics["first_saturation_time"], metrics["last_saturation_time"]) == (0.0, 5.0 / 8.0)


def test_rotors_without_limits_saturate_never():
    metrics = fly(rotor_speed_1=0.0, rotor_speed_2=9e4).metrics()
    assert metrics["saturated_fraction"] == 0.0
    assert not {"first_saturation_time", "last_saturation_time"} & set(metrics)


@pytest.mark.parametrize(
    ("kind", "diverged"),
    [("completed", False), ("interrupted", False), ("diverged", True), ("singular", True)],
)
def test_diverged_means_an_early_end(kind, diverged):
    assert fly(end=End(kind, 30.0, "why")).metrics()["diverged"] is diverged


def test_a_flight_of_one_sample_has_metrics():
    metrics = fly(times=[0.0], x=2.0, wall_time=0.0).metrics()
    assert metrics["final_position_error_x"] == -2.0
    assert metrics["duration"] == metrics["realtime_factor"] == 0.0


def test_thrust_is_the_square_of_the_speed_with_the_sign_of_the_spin():
    flight = fly(rotor_speed_1=-300.0, rotor_speed_2=-100.0)
    assert flight["thrust_1"][0] == pytest.approx(8.048e-6 * 300**2, rel=1e-15)
    assert flight["thrust_2"][0] == pytest.approx(-8.048e-6 * 100**2, rel=1e-15)


def test_columns_come_in_the_order_of_the_file_and_of_one_length():
    flight = fly()
    assert list(flight.columns) == list(COLUMNS)
    assert {column.shape for column in flight.columns.values()} == {(len(TIMES),)}


def test_reference_columns_hold_the_references_of_the_controller():
    scenario = {
        "reference": {"type": "setpoint", "position": [1.0, 2.0, 3.0], "yaw": 0.0},
        "controller": {"decoupler": "conventional"},
        "gait": {"type": "trot_instant", "amplitude": 0.3, "period": 2.0},
    }
    flight = fly(scenario, x=0.5, vy=-0.25)
    # Ch. 4, Eqs. (7), (8) and (28) with unit gains: X'' = 0.5, Y'' = 2 + 0.25.
    np.testing.assert_allclose(flight["roll_ref"], -2.25 / 9.8, rtol=1e-14)
    np.testing.assert_allclose(flight["pitch_ref"], 0.5 / 9.8, rtol=1e-14)
    for name, value in [("x_ref", 1.0), ("y_ref", 2.0), ("z_ref", 3.0), ("yaw_ref", 0.0)]:
        assert (flight[name] == value).all()
    expected = np.where(TIMES % 2.0 <= 1.0, 0.3, -0.3)
    np.testing.assert_array_equal(flight["alpha_ref_4"], expected)
    np.testing.assert_array_equal(flight["alpha_ref_1"], -expected)


def test_the_final_attitude_error_is_the_largest_of_the_last_second():
    ends = TIMES >= 29.0
    pitch = np.where(ends, 0.0, 0.4)  # earlier errors do not count
    roll = np.where(TIMES == 29.25, -0.03, 0.01)
    assert fly(roll=roll, pitch=pitch).metrics()["final_attitude_error"] == pytest.approx(0.03)


def test_a_whole_turn_of_yaw_is_no_error():
    metrics = fly(yaw=np.full(len(TIMES), 2.0 * pi + 0.02)).metrics()
    assert metrics["final_attitude_error"] == pytest.approx(0.02)


@pytest.mark.skipif(not METRICS_PAGE.is_file(), reason="the docs are not part of a distribution")
def test_the_page_on_metrics_names_all_of_them_with_their_units():
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \| .+ \|$", METRICS_PAGE.read_text("utf-8"), re.M)
    units = {name: METRICS[name].unit or "-" for name in METRICS}
    units |= dict.fromkeys(BOOLEAN_METRICS, "true or false")
    assert dict(rows) == units
    assert len(rows) == len(METRICS)


def test_editors_complete_the_metrics_of_expectations():
    metric = scenario_schema()["$defs"]["Expectation"]["properties"]["metric"]
    own, companions = metric["anyOf"]
    assert own["enum"] == list(METRICS)
    assert re.match(companions["pattern"], "wing.duration")


def test_units_belong_to_the_metrics():
    names = "final_position_error_x", "max_rotor_speed", "duration", "switches", "diverged"
    assert [METRICS[name].unit for name in names] == ["m", "rad/s", "s", "", ""]


@pytest.mark.parametrize(
    ("kind", "diverged"),
    [("completed", False), ("interrupted", False), ("diverged", True), ("singular", True)],
)
def test_diverged_means_the_same_for_the_tilt_car(kind, diverged):
    ended = replace(flight("tilt_car"), end=End(kind, 1.2, "of a test"))
    assert ended.metrics()["diverged"] is diverged


@pytest.mark.parametrize("timestep", [0.0005, 0.001, 0.002, 0.004])
def test_spans_count_steps_and_not_their_sums(timestep):
    steps = round(20.0 / timestep)
    summed = np.cumsum(np.full(steps, timestep))  # as MuJoCo adds them up
    for times in (np.arange(1, steps + 1) * timestep, summed):
        assert in_last_second(times, timestep).sum() == round(1.0 / timestep) + 1
        assert list(np.flatnonzero(when_settled(times, timestep))) == [steps - 1]
    metrics = fly({"simulation": {"timestep": 0.0005}}, times=[0.0, 10.0, summed[-1]], x=2.0)
    assert metrics.metrics()["sup_position_error_after_20s"] == 2.0


def test_position_errors_are_distances_in_space_over_the_whole_flight():
    scenario = {"reference": {"type": "setpoint", "position": [1.0, 2.0, 3.0]}}
    x = np.where(TIMES < 15.0, 3.0, 1.0)
    y, z = np.where(TIMES < 15.0, -1.0, 2.0), np.where(TIMES < 15.0, 9.0, 3.0)
    metrics = fly(scenario, x=x, y=y, z=z).metrics()
    assert metrics["max_position_error"] == 7.0  # of 2, 3 and 6
    assert metrics["rms_position_error"] == pytest.approx(np.sqrt(60 * 49.0 / 121), rel=1e-15)


def test_without_a_position_loop_the_position_error_is_of_altitude():
    scenario = {
        "reference": {"type": "attitude_altitude", "altitude": 2.0},
        "controller": {"decoupler": "none"},
    }
    metrics = fly(scenario, x=5.0, z=0.5).metrics()
    assert metrics["max_position_error"] == metrics["rms_position_error"] == 1.5


@pytest.mark.parametrize("vehicle", ["tilt_car", "trot", "free"])
def test_every_flight_has_position_errors(vehicle):
    metrics = flight(vehicle).metrics()
    assert 0.0 <= metrics["rms_position_error"] <= metrics["max_position_error"]


@pytest.mark.parametrize("law", ["geometric", "pid", "indi", "lqr"])
def test_a_law_that_leans_as_it_needs_has_no_attitude_error(law):
    """Its lean on a circle used to count as an error: no column has its desired attitude."""
    circle = {"type": "circle", "radius": 2.0, "angular_frequency": 1.0}
    scenario = {"controller": {"law": law}, "reference": circle}
    scenario["simulation"] = {"duration": 0.1, "engine": "python"}
    metrics = tiltsim.simulate(scenario).metrics()
    assert "final_attitude_error" not in metrics
    assert "final_roll" in metrics


def test_a_law_with_a_desired_attitude_is_compared_with_it():
    """Parallel rotors lean on a circle, as the law requires."""
    changes = {"simulation.duration": 3.0, "simulation.engine": "native"}
    metrics = tiltsim.simulate(load_scenario("fleet/hexarotor#circle", changes)).metrics()
    assert metrics["max_abs_roll"] > 0.05
    assert metrics["final_attitude_error"] < 0.01
