"""The tilt-car in MuJoCo and on the thesis's equations: its physics, its drift, its limit cycle."""

from __future__ import annotations

import json
from functools import cache
from math import pi

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.controllers.tilt_car.lean import lean_after, lean_of, restored_lean
from tests.flights import flight as screen_flight
from tiltsim.cli import main
from tiltsim.resources import shipped_folder
from tiltsim.vehicles.tilt_car import TiltCarSpec, compile_tilt_car
from tiltsim.views.figures.plot import plot
from tiltsim.views.replay import thrust_sites, visible_model
from tiltsim.views.rerun.recording import save_recording
from tiltsim.views.rerun.scene import ground_height
from tiltsim_controllers.tilt_car.cycles import Swing, limit_cycle, lyapunov, lyapunov_bound, orbit
from tiltsim_controllers.tilt_car.laws import PLANNED_GAINS
from tiltsim_controllers.tilt_car.vehicle import THESIS_CAR, acceleration, counter_yaw_per_tilt

CIRCLE = {"type": "circle", "position": [10.0, 0.0, 0.0], "radius": -10.0, "angular_frequency": 1.0}
PLANTS = ("mujoco", "thesis")
on_both_plants = pytest.mark.parametrize("plant", PLANTS)


@cache
def fly(address, plant="mujoco", duration=None, **overrides):
    keys = {"simulation.plant": plant, "simulation.engine": "native"}
    keys |= {key.replace("__", "."): value for key, value in overrides.items()}
    if duration is not None:
        keys["simulation.duration"] = duration
    return tiltsim.simulate(tiltsim.load_scenario(address, keys))


# --- the model ---------------------------------------------------------------------------------


def test_the_file_holds_what_compile_tilt_car_makes_of_the_thesis_car():
    plain = mujoco.MjModel.from_xml_path(str(shipped_folder("mjcf") / "tilt_car.xml"))
    model = compile_tilt_car(TiltCarSpec(THESIS_CAR))
    for name in ("body_mass", "body_inertia", "actuator_gear", "actuator_gainprm", "key_act"):
        np.testing.assert_allclose(getattr(plain, name), getattr(model, name), rtol=1e-12)
    np.testing.assert_allclose(plain.actuator_biasprm, model.actuator_biasprm, rtol=1e-12)
    np.testing.assert_allclose(plain.site_pos, model.site_pos, atol=1e-12)
    assert plain.actuator_actrange.tolist() == model.actuator_actrange.tolist()


def test_mass_and_inertia_are_the_cars():
    car = THESIS_CAR._replace(mass=3.0, top_inertia=0.004, bottom_inertia=0.002)
    model = compile_tilt_car(TiltCarSpec(car))
    assert model.body_subtreemass[1] == pytest.approx(3.0)
    assert model.body("vehicle").inertia[2] == pytest.approx(0.002)
    assert model.body("top").inertia[2] == pytest.approx(0.004)


def test_thrusts_pass_through_the_axis_at_the_half_angle():
    car = THESIS_CAR._replace(half_angle=0.4)
    model = compile_tilt_car(TiltCarSpec(car))
    data = mujoco.MjData(model)
    data.qpos[2:] = 0.3, 0.9
    data.ctrl[:3] = 0.9, 8000.0, 3000.0  # the servo is at its commanded angle
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(
        data.qacc[:2], acceleration(1.2, np.array([8000.0, 3000.0]), car), rtol=1e-12
    )
    # No torque about the axis: neither disc turns for the thrusts.
    np.testing.assert_allclose(data.qfrc_actuator[2:], 0.0, atol=1e-12)
    for site in thrust_sites(model):
        line, place = data.site_xmat[site].reshape(3, 3)[:, 2], data.site_xpos[site]
        assert abs(line[2]) < 1e-12
        assert abs(np.cross(line, place - data.xpos[1])[2]) < 1e-12


# --- the yaw answers the tilt ------------------------------------------------------------------


@pytest.mark.parametrize(("bottom", "share"), [(0.001, 1 / 2), (0.002, 1 / 3), (0.0005, 2 / 3)])
def test_the_bottom_disc_turns_back_by_angular_momentum_alone(bottom, share):
    # The published factor, I_T / I_B = 1/2, is there for I_B = I_T + I_bottom alone.
    car = THESIS_CAR._replace(bottom_inertia=bottom)
    assert counter_yaw_per_tilt(car) == pytest.approx(share)
    model = compile_tilt_car(TiltCarSpec(car))
    data = mujoco.MjData(model)
    data.ctrl[:3] = 1.5, 5000.0, 9000.0
    for _ in range(40):
        mujoco.mj_step(model, data)
        np.testing.assert_allclose(data.qpos[2], -share * data.qpos[3], atol=1e-12)
        momentum = car.top_inertia * (data.qvel[2] + data.qvel[3]) + bottom * data.qvel[2]
        assert abs(momentum) < 1e-14
    assert data.qpos[3] > 1.0


def test_the_servo_is_as_fast_on_the_free_car_as_it_says():
    model = compile_tilt_car(TiltCarSpec(THESIS_CAR, timestep=2e-5))
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    mujoco.mj_step(model, data, 500)
    x = 300.0 * 0.01  # critically damped, after 10 ms
    assert data.qpos[3] == pytest.approx(1.0 - (1.0 + x) * np.exp(-x), rel=1e-9)


@on_both_plants
def test_yaw_and_tilt_of_a_whole_flight(plant):
    flight = fly("ch10_state_drift/third_derivative#ten_seconds", plant)
    np.testing.assert_allclose(flight["yaw"], -0.5 * flight["alpha"], atol=1e-10)
    np.testing.assert_allclose(flight["direction"], 0.5 * flight["alpha"], atol=1e-10)


# --- state drift -------------------------------------------------------------------------------


@on_both_plants
def test_the_lean_drifts_as_the_closed_form_says(plant):
    flight = fly("ch10_state_drift/third_derivative#two_thousand_seconds", plant, 100.0)
    lean = lean_of(flight["rotor_speed_1"] ** 2, flight["rotor_speed_2"] ** 2, THESIS_CAR)
    path = orbit(-10.0, 1.0)
    begin = int(np.searchsorted(flight["time"], 20.0))
    for sample in (begin + 500, -1):
        time = flight["time"][sample] - flight["time"][begin]
        desired = lean_after(float(time), float(lean[begin]), path, THESIS_CAR)
        assert lean[sample] == pytest.approx(desired, rel=1e-4)
    assert flight.metrics()["sup_position_error_after_20s"] < 1e-6


def test_plants_drift_alike():
    split = [
        fly("ch10_state_drift/third_derivative#two_thousand_seconds", plant, 100.0).metrics()[
            "final_input_split"
        ]
        for plant in PLANTS
    ]
    assert split[0] == pytest.approx(split[1], rel=0.01)


@on_both_plants
def test_restoring_ends_the_drift_and_leaves_the_error_alone(plant):
    address = "ch10_state_drift/third_derivative#two_thousand_seconds"
    without, restored = (
        fly(address, plant, 100.0, **rate) for rate in ({}, {"controller__restoring_rate": 1.0})
    )
    settled = without["time"] > 20.0
    lean = lean_of(restored["rotor_speed_1"] ** 2, restored["rotor_speed_2"] ** 2, THESIS_CAR)
    desired = restored_lean(orbit(10.0, 1.0), THESIS_CAR, 1.0)
    np.testing.assert_allclose(lean[settled], desired, rtol=1e-2)
    assert abs(without["input_split"][-1]) > 50.0 * abs(restored["input_split"][-1])
    for axis in "xy":
        np.testing.assert_allclose(restored[axis], without[axis], atol=2e-4)


# --- the penguin -------------------------------------------------------------------------------


def at_half_periods(flight):
    half = flight["time"][1:]
    at = 1 + np.flatnonzero(np.abs(half - np.round(half)) < 1e-6)
    return at[flight["time"][at] >= 20.0]


def cycle(flight):
    """(e_y, e_y') at the half periods from 20 s on, all as if at the start of the same half."""
    at = at_half_periods(flight)
    sign = np.where(np.round(flight["time"][at]) % 2 == 0, -1.0, 1.0)
    error = (flight["y_ref"] - flight["y"])[at] * sign
    rate = (flight["vy_ref"] - flight["vy"])[at] * sign
    return error, rate


def test_the_limit_cycle_on_the_thesis_plant_is_the_maps_fixed_point():
    flight = fly("ch11_penguin/straight_line#large", "thesis")
    swing = Swing(pi / 6, 1.0, PLANNED_GAINS["ch11"])
    fixed = limit_cycle(swing)
    error, rate = cycle(flight)
    np.testing.assert_allclose(error, fixed[0], rtol=1e-5)
    np.testing.assert_allclose(rate, fixed[1], rtol=1e-5)
    np.testing.assert_allclose(error, 0.195, rtol=0.01)
    np.testing.assert_allclose(rate, 0.748, rtol=0.01)
    candidate = flight["lyapunov"][at_half_periods(flight)]
    np.testing.assert_allclose(candidate, lyapunov(swing, fixed), rtol=1e-5)
    np.testing.assert_allclose(candidate, 0.622, rtol=0.01)
    assert flight.metrics()["saturated_fraction"] == pytest.approx(0.72, abs=0.012)
    assert np.abs(flight["x_ref"] - flight["x"]).max() < 1e-6


def test_mujocos_servo_moves_the_limit_cycle_a_little():
    flight = fly("ch11_penguin/straight_line#large", "mujoco")
    fixed = limit_cycle(Swing(pi / 6, 1.0, PLANNED_GAINS["ch11"]))
    error, rate = cycle(flight)
    np.testing.assert_allclose(error, fixed[0], rtol=0.03)
    np.testing.assert_allclose(rate, fixed[1], rtol=0.01)
    assert np.ptp(error) < 1e-3
    faster = fly(
        "ch11_penguin/straight_line#large",
        "mujoco",
        22.0,
        vehicle__tilt_servo__natural_frequency=1200.0,
    )
    closer, _ = cycle(faster)
    assert np.abs(closer - fixed[0]).max() < 0.5 * np.abs(error - fixed[0]).max()


@on_both_plants
def test_proposition_7_bounds_every_flight(plant):
    bound = lyapunov_bound(Swing(pi / 6, 1.0, PLANNED_GAINS["ch11"]), 21)
    flight = fly("ch11_penguin/straight_line#large", plant)
    assert flight.metrics()["max_lyapunov"] < bound.critical < bound.published


@on_both_plants
def test_small_swings_keep_the_errors_at_zero(plant):
    flight = fly("ch11_penguin/straight_line#small", plant)
    assert flight.metrics()["saturated_fraction"] == 0.0
    for axis in "xy":
        assert flight.metrics()[f"max_abs_error_{axis}"] < 1e-6
    assert set(flight["switch_1"]) == set(flight["switch_2"]) == {1.0}


def test_the_switch_matrix_is_logged():
    flight = fly("ch11_penguin/straight_line#large", "thesis")
    for rotor in (1, 2):
        np.testing.assert_array_equal(
            flight[f"switch_{rotor}"] == 1.0, flight[f"thrust_{rotor}"] > 0
        )
        square = flight[f"rotor_speed_{rotor}"] ** 2
        np.testing.assert_allclose(square, np.maximum(flight[f"wanted_square_{rotor}"], 0.0))
    swing = np.sign(flight["alpha_ref"])
    assert set(flight["switch_1"][swing < 0]) == {1.0}  # S_10 or S_11, Lemma 4
    assert set(flight["switch_2"][swing > 0]) == {1.0}


@on_both_plants
def test_the_thrusts_follow_the_planned_direction(plant):
    flight = fly("ch10_state_drift/planned_direction", plant)
    desired = flight["time"]  # psi + alpha = t, Eq. (18)
    np.testing.assert_allclose(flight["direction"], desired, atol=1e-6)
    gait = flight.scenario.gait.plan(THESIS_CAR)
    assert gait.angles(3.0)[0] == pytest.approx(6.0)


@on_both_plants
def test_the_fourth_derivative_fails_for_want_of_anti_windup(plant):
    failure = fly("ch10_state_drift/fourth_derivative#failure", plant)
    guarded = fly("ch10_state_drift/fourth_derivative#anti_windup", plant)
    assert failure["law_speed_2"].min() < -1.0
    assert failure["rotor_speed_2"].min() == 0.0
    assert guarded["law_speed_2"].min() >= 0.0
    stop = int(np.argmax(failure["rotor_speed_2"] == 0.0))
    assert 25.0 < failure["time"][stop] < 32.0
    error = np.hypot(failure["x_ref"] - failure["x"], failure["y_ref"] - failure["y"])
    assert error[stop] < 1e-3 < 1.0 < error[-1]


def test_with_the_exact_tilt_column_no_rotor_stops():
    """Eq. (27) lacks 1 - I_T / I_B; with it the inputs also drift, at less than half the pace."""
    failure, exact = (
        fly(f"ch10_state_drift/fourth_derivative#{name}", "thesis") for name in ("failure", "exact")
    )
    assert failure["rotor_speed_2"].min() == 0.0 < 50.0 < exact["rotor_speed_2"].min()
    before = (failure["time"] > 10.0) & (failure["time"] < 25.0)
    drifts = [abs(np.ptp(flight["input_split"][before])) for flight in (failure, exact)]
    assert 0.0 < drifts[1] < 0.5 * drifts[0]


# --- on screen, and from the command line ------------------------------------------------------


def test_the_page_has_the_chapters_panels():
    figure = plot(screen_flight("tilt_car"))
    figure.canvas.draw()
    titles = {axes.get_title(loc="left") for axes in figure.axes}
    assert titles == {
        "Position error",
        "Inputs squared",
        "Direction",
        "Lyapunov candidate, ½ ė² + ½ K e², along y",
        "Plan view",
        "Error along y and its rate",
    }


def test_the_recording_has_both_thrusts_and_the_cars_series(tmp_path):
    import rerun.chunk

    this = screen_flight("tilt_car")
    path = tmp_path / "car.rrd"
    save_recording([this], path)
    chunks = list(rerun.chunk.RrdReader(path).stream())
    entities = {str(chunk.entity_path) for chunk in chunks}
    assert {"/world/vehicle/top/thrust_1", "/world/vehicle/top/thrust_2"} <= entities
    assert {"/direction", "/inputs", "/lyapunov"} <= entities
    assert not any(entity.startswith("/plane") for entity in entities)
    assert ground_height(visible_model(this.assembly)) == pytest.approx(-0.0125)


def test_run_check_and_plot_from_the_command_line(tmp_path, capsys):
    name = "ch10_state_drift/planned_direction"
    out = tmp_path / "car"
    assert main(["run", name, "--out", str(out)]) == 0
    metrics = json.loads((out / "metrics.json").read_text())
    assert {"max_abs_error_x", "max_abs_error_y", "max_lyapunov", "final_input_split"} <= {*metrics}
    assert "final_roll" not in metrics
    assert main(["plot", str(out)]) == 0
    assert (out / "flight.png").stat().st_size > 20_000
    assert main(["gait", name]) == 2
    assert "does not have a gait of four tilt angles" in capsys.readouterr().err
