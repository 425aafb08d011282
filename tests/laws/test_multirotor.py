"""Multirotors in closed loops: as cases of each other, on both plants, level, limited, refused."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.laws.rotor_loop import torque_free_columns
from tiltsim.models.rotor_table import hover_speeds
from tiltsim.resources import shipped_folder
from tiltsim.scenario.loading import merge
from tiltsim.simulation.simulate import make_plant
from tiltsim.vehicles.rotorcraft import Layout
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    hover_direction,
    singularity_margin,
    torque_free_forces,
)
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.vehicle.rotors import force_and_torque

TILTS = {"type": "waypoints", "angles": [[0.2, -0.2] * 3, [0.3, -0.3] * 3], "period": 2.0}
CIRCLE = {"type": "circle", "radius": 1.0, "angular_frequency": 0.5}
ON_CIRCLE = {"position": [1.0, 0.0, 0.0], "velocity": [0.0, 0.5, 0.0]}


def mjcf(name):
    return str(shipped_folder("mjcf") / f"{name}.xml")


def document(name, vehicle=None, **tables):
    """A scenario of a shipped vehicle as a multirotor."""
    tables.setdefault("controller", {"law": "attitude_force"})
    tables["simulation"] = {"duration": 0.1, "engine": "python", **tables.get("simulation", {})}
    vehicle = {"model": "multirotor", "mjcf": mjcf(name), **(vehicle or {})}
    tables["initial"] = {**ON_CIRCLE, **tables.get("initial", {})}
    return {"vehicle": vehicle, "reference": CIRCLE, **tables}


def fly(name, vehicle=None, **tables):
    flight = tiltsim.simulate(document(name, vehicle, **tables))
    assert flight.end.kind == "completed", flight.end
    return flight


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_the_tiltrotor_is_a_multirotor(plant):
    simulation = {"duration": 0.1, "engine": "python", "plant": plant}
    gait = {"type": "trot_continuous", "amplitude": 0.3, "period": 2.0}
    shared = {"reference": CIRCLE, "gait": gait, "initial": ON_CIRCLE}
    law = {"gait_rate_feedforward": True, "decoupling": "exact", "decoupler": "exact"}
    special = tiltsim.simulate(
        {"controller": {**law, "gains": "feedforward"}, "simulation": simulation, **shared}
    )
    general = fly(
        "tiltrotor",
        controller={
            "law": "attitude_force",
            "gains": "feedforward",
            "attitude_error": "euler_angles",
        },
        initial={"rotor_speed": 300.0},
        simulation=simulation,
        gait=gait,
    )
    for name in ("position", "attitude", "tilt_angles", "reference_attitude"):
        assert np.abs(general[name] - special[name]).max() < 1e-9, name
    assert np.abs(general["rotor_speeds"] - special["rotor_speeds"]).max() < 1e-6
    assert np.abs(general["singularity_margin"] - special["singularity_margin"]).max() < 1e-9
    assert set(special.metrics()) <= set(general.metrics())
    condition = special.metrics()["min_decoupling_condition"]
    assert general.metrics()["min_decoupling_condition"] == pytest.approx(condition, rel=1e-9)


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_full_pose_of_the_tiltrotor_equals_a_multirotors(plant):
    shared = {
        "controller": {"law": "full_pose", "max_tilt_rate": 3.0, "max_tilt_angle": 0.01},
        "initial": {"position": [0.1, 0.0, 0.0], "velocity": [0.0] * 3, "rotor_speed": 300.0},
        "reference": {"type": "setpoint", "yaw": 0.2},
    }
    simulation = {"duration": 0.02, "timestep": 0.0005, "engine": "python", "plant": plant}
    special = tiltsim.simulate({"simulation": simulation, **shared})
    general = fly("tiltrotor", simulation=simulation, **shared)
    for name in ("position", "attitude", "tilt_angles", "singularity_margin"):
        np.testing.assert_allclose(general[name], special[name], rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(general["alpha_ref_1"], general["tilt_command_1"])
    assert np.abs(general["tilt_command_1"]).max() == pytest.approx(0.01, abs=2e-3)


def test_plants_agree_but_for_the_gyroscopic_torque():
    flights = [
        fly("tilt_hexarotor", gait=TILTS, simulation={"plant": plant})
        for plant in ("mujoco", "thesis")
    ]
    assert np.abs(flights[0]["position"] - flights[1]["position"]).max() < 1e-6
    assert flights[0]["tilt_angles"].shape[1] == 6
    assert np.abs(flights[0]["tilt_angles"] - flights[0]["reference_tilt_angles"]).max() < 2e-3


def test_full_force_stays_level_in_a_side_wind():
    wind = [{"type": "acceleration", "value": [0.0, 1.0, 0.0]}]
    flight = fly("cant_hexarotor", disturbance=wind)
    assert np.abs(flight["attitude"]).max() < 1e-6
    leaning = fly(
        "cant_hexarotor", disturbance=wind, controller={"law": "attitude_force", "dimension": 1}
    )
    assert np.abs(leaning["attitude"]).max() > 1e-3
    both = [{"type": "acceleration", "value": [0.5, 1.0, 0.0]}]
    forward = fly(
        "cant_hexarotor", disturbance=both, controller={"law": "attitude_force", "dimension": 2}
    )
    assert np.abs(forward["pitch"]).max() < 1e-6
    assert np.abs(forward["roll"]).max() > 1e-3


BEYOND_THE_SIDE: dict[str, dict[str, object]] = {
    "controller": {"law": "attitude_force", "dimension": 1, "decoupler": "none"},
    "reference": {"type": "attitude_altitude", "roll": 1.5},
    "initial": {"position": [0.0] * 3, "attitude": [1.2, 0.0, 0.0], "angular_velocity": [6, 0, 0]},
}
"""It rolls past a quarter turn, where vertical rotors have no lift left."""


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
@pytest.mark.parametrize("name", ["hexarotor", "tilt_heptarotor"])
def test_a_flight_past_a_singular_attitude_ends_there(name, plant):
    tables = {**BEYOND_THE_SIDE, "simulation": {"plant": plant}}
    flight = tiltsim.simulate(document(name, **tables))
    assert flight.end.kind == "singular"
    assert "decoupling matrix became singular at roll = 1.57 rad, pitch = " in flight.end.cause
    margin = np.pi / 2.0 - flight["roll"]
    np.testing.assert_allclose(flight["singularity_margin"], margin, atol=1e-6)
    assert flight["singularity_margin"][-1] < 0.0 < flight["singularity_margin"][-2]


PENTAROTOR = {"mjcf": str(Path(__file__).with_name("pentarotor.xml"))}
WITHOUT_ONE: dict[str, dict[str, object]] = {
    "controller": {
        **{"law": "attitude_force", "dimension": 1, "decoupler": "none", "norm": "thrust"},
        **{"failed_rotor": 5, "failure_known_from": 0.01},
    },
    "reference": {"type": "attitude_altitude", "roll": 1.4},
    "initial": {
        "position": [0.0] * 3,
        "attitude": [1.22, 0.0, 0.0],
        "angular_velocity": [10, 0, 0],
    },
    "simulation": {"timestep": 0.002, "record_timestep": 0.002},
}
"""It rolls past where four of its five rotors have no lift left, which the five would have."""


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_without_a_rotor_a_flight_ends_where_the_others_are_singular(plant):
    tables = merge(WITHOUT_ONE, {"simulation": {"plant": plant}})
    flight = tiltsim.simulate(document("pentarotor", PENTAROTOR, **tables))
    assert flight.end.kind == "singular"
    assert flight.end.cause.startswith("the decoupling matrix became singular at roll = 1.38 rad")
    assert flight.end.cause.endswith(" rad, without rotor 5")
    force, torque = force_and_torque(flight.scenario.vehicle.resolve().table, ())
    works = [1.0, 1.0, 1.0, 1.0, 0.0]
    side = hover_direction(torque_free_forces(force * works, torque * works))
    along = world_up(flight["roll"], flight["pitch"]) @ side
    assert along[-1] < 0.0 < along[:-1].min()
    known = flight["time"] >= 0.01
    margin = flight["singularity_margin"]
    np.testing.assert_allclose(margin[known], np.arcsin(along[known]), atol=1e-9)
    assert margin[~known].min() > margin[known].max() + 0.3
    condition = flight["decoupling_condition"]
    assert condition[-1] < 0.1 * condition[~known].min()


def test_margins_of_flights_that_lose_rotors_at_other_times_equal_single_flights():
    vehicle = tiltsim.load_scenario(document("pentarotor", PENTAROTOR)).vehicle.resolve()
    time, roll = np.linspace(0.0, 1.0, 9), np.linspace(1.2, 1.5, 9)
    failures = [Failure(5.0, 0.5), Failure(), Failure(4.0, 0.25), Failure(5.0, 0.75)]

    def margin(failure, flights=1):
        samples = {"time": np.tile(time, flights), "roll": np.tile(roll, flights)}
        samples["pitch"] = np.zeros(9 * flights)
        columns = torque_free_columns(Layout(5, 0), vehicle.table, samples, 1, failure)
        return columns["singularity_margin"]

    alone = [margin(failure) for failure in failures]
    of_samples = Failure(*(np.repeat(field, 9) for field in zip(*failures, strict=True)))
    np.testing.assert_array_equal(margin(of_samples, 4), np.concatenate(alone))
    force, torque = force_and_torque(vehicle.table, ())
    for failure, values in zip(failures, alone, strict=True):
        works, known = np.arange(1.0, 6.0) != failure.rotor, time >= failure.known_from
        along = world_up(roll, 0.0 * roll) @ hover_direction(
            torque_free_forces(force * works, torque * works)
        )
        np.testing.assert_allclose(values[known], np.arcsin(along[known]), atol=1e-9)
        assert (values[~known] > 0.5).all()  # of all rotors, which have two directions


def test_the_margin_under_full_pose_counts_rotors_that_are_known_to_work():
    flight = fly(
        "tilt_hexarotor",
        controller={"law": "full_pose", "failed_rotor": 2, "failure_known_from": 0.1},
        gait={"type": "fixed", "angles": [0.2, -0.2] * 3},
        initial={"attitude": [0.2, -0.1, 0.0]},
        simulation={"duration": 0.2, "timestep": 0.002},
    )
    force, torque = force_and_torque(flight.scenario.vehicle.resolve().table, flight["tilt_angles"])
    up = world_up(flight["roll"], flight["pitch"])
    everyone = np.ones(6)
    others = np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    known, margin = flight["time"] >= 0.1, flight["singularity_margin"]
    for rows, works in ((~known, everyone), (known, others)):
        expected = singularity_margin(torque_free_forces(force * works, torque * works), up)
        np.testing.assert_allclose(np.abs(margin[rows]), expected[rows], atol=1e-9)
    assert margin[known].max() < margin[~known].min() - 0.01


@pytest.mark.parametrize("aware", [True, False])
def test_seven_of_eight_rotors_hold_the_pose_if_the_controller_knows(aware):
    controller = {"law": "attitude_force", "norm": "thrust"}
    if aware:
        controller |= {"failed_rotor": 3, "failure_known_from": 0.02}
    flight = fly(
        "omni_octorotor",
        controller=controller,
        fault=[{"type": "rotor_loss", "rotor": 3, "time": 0.02}],
        simulation={"duration": 0.5, "timestep": 0.004},
    )
    moved = np.abs(flight["attitude"][flight["time"] > 0.4]).max()
    assert moved < 0.05 if aware else moved > 0.2


def test_rotors_keep_within_their_limits():
    flight = fly("hexarotor", {"min_rotor_speed": 530.0, "max_rotor_speed": 545.0})
    speeds = flight["rotor_speeds"] * flight.scenario.any_rotorcraft.spins
    assert speeds.min() >= 530.0 - 1e-9
    assert speeds.max() <= 545.0 + 1e-9
    assert flight.metrics()["saturated_fraction"] > 0.0


WEAK = {"min_rotor_speed": 0.0, "max_rotor_speed": 585.0}  # 8 % above hover
PRIORITIZED = {"law": "attitude_force", "allocation": "prioritized"}
CLIMB = {
    "reference": {"type": "setpoint", "position": [1.0, 0.5, 20.0], "yaw": 0.3},
    "initial": {"position": [0.0] * 3, "velocity": [0.0] * 3, "attitude": [0.2, -0.2, 0.0]},
}


def test_prioritized_allocation_keeps_the_attitude_where_inversion_stops_a_rotor():
    simulation = {"duration": 0.5, "timestep": 0.004}
    flight = fly("hexarotor", WEAK, controller=PRIORITIZED, simulation=simulation, **CLIMB)
    assert np.abs(flight["attitude"][:, :2]).max() < 0.25
    inverting = tiltsim.simulate(document("hexarotor", WEAK, simulation=simulation, **CLIMB))
    assert inverting.end.kind == "singular"


ACTUATORS = {
    "vehicle": {
        "rotor_time_constant": 0.02,
        "max_rotor_speed": 900.0,
        "tilt_servo": {"natural_frequency": 50.0, "max_rate": 2.0},
    },
    "simulation": {"control_timestep": 0.004, "control_latency": 0.008},
    "sensors": {"position_noise": 0.01},
    "fault": [
        {"type": "stuck_servo", "rotor": 2, "time": 0.02},
        {"type": "partial_thrust", "rotor": 6, "time": 0.05, "factor": 0.9},
    ],
    "gait": TILTS,
}


def test_actuators_sensors_and_faults_act_on_each_rotor():
    flight = fly("tilt_hexarotor", **ACTUATORS)
    held = flight["alpha_ref_2"][flight["time"] == 0.02]
    assert flight["alpha_2"][-1] == pytest.approx(held[0], abs=1e-3)
    assert abs(flight["alpha_2"][-1] - flight["alpha_ref_2"][-1]) > 5e-3
    factors = np.where(flight["time"] >= 0.05, 0.9, 1.0)
    assert flight["thrust_factor_6"].tolist() == factors.tolist()
    assert set(flight["thrust_factor_1"]) == {1.0}


HEAVY = {"rotor_inertia": 1e-5}
EVERYTHING = {
    **ACTUATORS,
    "vehicle": {**ACTUATORS["vehicle"], **HEAVY},
    "model_error": {"mass": 1.05, "thrust_coefficient": 0.97},
    "air": {
        **{"drag": {"linear": [0.2, 0.3, 0.1]}, "wind": [3.0, 1.0, 0.0]},
        **{"turbulence": {"wind_at_6m": 3.0}, "ground_effect": {"height": -0.15}},
    },
}


PUSH = (0.4 * np.sin(np.pi / 6.0 + np.pi / 3.0 * np.arange(6))).tolist()
ASIDE = {"type": "waypoints", "angles": [[0.0] * 6, PUSH], "period": 1.0}
HELD = {
    **{"law": "attitude_force", "dimension": 1, "angular_acceleration": "measured"},
    "supervisor": {"strategy": "hold", "min_margin": 1.5},
}
"""It pushes aside, which a level vehicle holds until it leans."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "tables"),
    [
        ("pentarotor", {"vehicle": PENTAROTOR, **WITHOUT_ONE}),
        ("hexarotor", {"vehicle": WEAK, "controller": PRIORITIZED, **CLIMB}),
        ("tilt_hexarotor", {"vehicle": HEAVY, "gait": TILTS, "simulation": {"plant": "thesis"}}),
        ("tilt_hexarotor", {**EVERYTHING, "controller": HELD, "gait": ASIDE}),
        ("tilt_hexarotor", {"controller": {"law": "full_pose", "failed_rotor": 2}}),
    ],
)
def test_engines_fly_the_same_bit_for_bit(name, tables):
    engines = [{**tables.get("simulation", {}), "engine": name} for name in ("python", "native")]
    flown = [
        tiltsim.simulate(document(name, **{**tables, "simulation": simulation}))
        for simulation in engines
    ]
    assert flown[0].end == flown[1].end
    for column, values in flown[0].columns.items():
        np.testing.assert_array_equal(values, flown[1][column], err_msg=column)


@pytest.mark.slow
def test_native_code_notices_at_which_sample_the_others_are_singular():
    """It checks all samples but the last."""
    tables = merge(WITHOUT_ONE, {"simulation": {"engine": "native"}})
    assembly = assemble(tiltsim.load_scenario(document("pentarotor", PENTAROTOR, **tables)))
    for samples, ends in ((8, False), (9, True)):
        assert (len(make_plant(assembly).record(samples, 1)) < samples) == ends


@pytest.mark.parametrize(
    "name", ["hexarotor", "tilt_heptarotor", "omni_octorotor", "cant_quadrotor"]
)
def test_initial_rotor_speeds_hover(name):
    vehicle = tiltsim.load_scenario(document(name)).vehicle.resolve()
    tilts = tuple(0.1 * (-1.0) ** i for i in range(vehicle.tilts))
    speeds = np.array(hover_speeds(vehicle, tilts, (-np.inf, np.inf)))
    force, torque = force_and_torque(vehicle.table, tilts)
    inputs = speeds * np.abs(speeds)
    assert np.abs(torque @ inputs).max() < 1e-12 * vehicle.mass
    assert np.linalg.norm(force @ inputs) == pytest.approx(vehicle.mass * vehicle.gravity)


def test_initial_rotor_speeds_within_limits_are_the_evenest():
    vehicle = tiltsim.load_scenario(document("tilt_heptarotor")).vehicle.resolve()
    free = np.abs(hover_speeds(vehicle, (0.0,) * 7, (-np.inf, np.inf)))
    limited = np.abs(hover_speeds(vehicle, (0.0,) * 7, (0.0, 0.999 * free.max())))
    assert limited.max() < 0.995 * free.max()
    assert np.linalg.norm(free**2) < np.linalg.norm(limited**2)


def test_a_controller_of_lift_starts_with_all_rotors_along_their_spins():
    vehicle = tiltsim.load_scenario(document("tilt_heptarotor")).vehicle.resolve()
    sway = tuple(0.1 * np.sin(2.0 * np.pi * np.arange(7) / 7.0))
    limits = -np.inf, np.inf
    assert min(np.multiply(hover_speeds(vehicle, sway, limits), vehicle.spins)) < -300.0
    speeds = np.array(hover_speeds(vehicle, sway, limits, 1))
    assert min(speeds * vehicle.spins) > 300.0
    force, torque = force_and_torque(vehicle.table, sway)
    inputs = speeds * np.abs(speeds)
    assert np.abs(torque @ inputs).max() < 1e-12 * vehicle.mass
    assert np.linalg.norm(force @ inputs) == pytest.approx(vehicle.mass * vehicle.gravity)
    forces = torque_free_forces(force, torque)
    assert forces.dimension == 3
    assert abs((force @ inputs)[0]) > 1e-3  # it leans
    # Least norm: nothing of them in the null space of torque and lift.
    rows = np.vstack([torque, force[2]])
    np.testing.assert_allclose(np.linalg.pinv(rows) @ rows @ inputs, inputs, rtol=1e-9)


HEXAROTOR = {"model": "multirotor", "mjcf": mjcf("hexarotor")}


@pytest.mark.parametrize(
    ("tables", "message"),
    {
        "no file": ({"vehicle": {"model": "multirotor"}}, "vehicle.mjcf: missing, and required"),
        "a law of others": (
            {"controller": {"law": "attitude_altitude"}},
            "choose full_pose, attitude_force",
        ),
        "too much force": (
            {"controller": {"law": "attitude_force", "dimension": 3}},
            "controller.dimension = 3: the vehicle has 1 only, as its rotors are placed",
        ),
        "more force than as published": (
            {
                "vehicle": {"model": "multirotor", "mjcf": mjcf("omni_octorotor")},
                "controller": {"law": "attitude_force", "decoupling": "published"},
            },
            "the vehicle has 3; controller.decoupling = 'published' needs 1",
        ),
        "allocation without limits": (
            {"controller": {"law": "attitude_force", "allocation": "prioritized"}},
            'controller.allocation = "prioritized": needs rotor limits: vehicle.min_rotor_speed',
        ),
        "full pose of vertical rotors": (
            {"controller": {"law": "full_pose"}},
            'controller.law = "full_pose": at the initial tilt angles the inputs move 4 of six',
        ),
        "a failed rotor that is not there": (
            {"controller": {"law": "full_pose", "failed_rotor": 7}},
            "controller.failed_rotor = 7: the vehicle has 6 rotors",
        ),
        "a rotor that the others cannot replace": (
            {
                "vehicle": {"model": "multirotor", "mjcf": mjcf("cant_quadrotor")},
                "controller": {"law": "attitude_force", "failed_rotor": 2},
            },
            "controller.failed_rotor = 2: the others are singular at every attitude",
        ),
        "tilts of fixed rotors": (
            {"gait": {"type": "fixed", "angles": [0.1] * 6}},
            "has 6 tilt angles; the vehicle has 0",
        ),
        "servos of fixed rotors": (
            {"vehicle": {**HEXAROTOR, "tilt_servo": {"max_rate": 1.0}}},
            "vehicle.mjcf has no tilts; remove it",
        ),
        "a servo that is not there": (
            {"fault": [{"type": "stuck_servo", "rotor": 2, "time": 0.1}]},
            "fault.rotor = 2: is fixed and has no servo",
        ),
        "a rotor that is not there": (
            {"fault": [{"type": "rotor_loss", "rotor": 7, "time": 0.1}]},
            "fault.rotor = 7: the vehicle has 6 rotors",
        ),
        "speeds of other rotors": (
            {"initial": {"rotor_speed": [500.0] * 4}},
            "the multirotor has 6 rotors; give one value or one each",
        ),
        "a pose without side force": (
            {"reference": {"type": "setpoint", "roll": 0.2}},
            "reference.roll = 0.2: roll and pitch are no outputs: a vehicle that controls 1 of 3",
        ),
        "rotors heavier than the vehicle": (
            {"vehicle": {**HEXAROTOR, "rotor_inertia": 0.02}},
            "vehicle.rotor_inertia = 0.02: must be below 0.0133333",
        ),
        "no hover within the limits": (
            {"vehicle": {**HEXAROTOR, "max_rotor_speed": 400.0}},
            "initial.rotor_speed",
        ),
    }.values(),
)
def test_a_mistake_is_one_clear_line(tables, message):
    assert message in refusal(tiltsim.simulate, {**document("hexarotor"), **tables})


def test_a_gait_through_angles_of_less_force_says_where():
    gait = {"type": "waypoints", "angles": [[0.2, -0.2] * 3, [-0.2, 0.2] * 3], "period": 2.0}
    controller = {"law": "attitude_force", "dimension": 3}
    with pytest.raises(InputError, match=r"has 1 only, at tilt angles \(0, 0, 0, 0, 0, 0\) rad"):
        tiltsim.load_scenario(document("tilt_hexarotor", gait=gait, controller=controller))
    assert tiltsim.load_scenario(document("tilt_hexarotor", gait=gait))


@pytest.mark.parametrize("name", ["tilt_hexarotor", "hexarotor"])
def test_stepwise_simulation_observes_and_commands_each_rotor(name):
    simulation = tiltsim.Simulation(document(name, sensors={"position_noise": 0.1}))
    exact = tiltsim.Simulation(document(name))
    for one in (simulation, exact):
        one.step(5)
    seen, command = simulation.observation(), simulation.command()
    rotors, tilts = 6, 6 * (name == "tilt_hexarotor")
    assert seen.rotor_speeds.shape == command.rotor_accelerations.shape == (rotors,)
    assert seen.tilt_angles.shape == seen.reference.tilt_angles.shape == (tilts,)
    assert np.size(command.tilt_angles) == tilts or command.tilt_angles is None
    noisy, clean = command.rotor_accelerations, exact.command().rotor_accelerations
    assert np.abs(noisy - clean).max() > 1.0


def test_a_custom_gait_has_an_angle_for_each_tilt():
    own = document("tilt_hexarotor")
    flight = tiltsim.simulate(own, gait=lambda time: [0.1 + 0.1 * time, -0.1] * 3)
    assert flight["alpha_ref_5"][-1] == pytest.approx(0.11)
    with pytest.raises(InputError, match="has 4 tilt angles; the vehicle has 6"):
        tiltsim.simulate(own, gait=lambda time: [0.1] * 4)


CHAPTER_4 = {
    "law": "attitude_force",
    "decoupling": "published",
    "attitude_error": "euler_angles",
    "gains": "ch04",
    "leave_out": [
        "gait_rates",
        "attitude_rates",
        "reference_derivatives",
        "euler_rates",
        "gyroscopic_torque",
        "integral_action",
    ],
    # Ch. 4 has no limits.
    "max_acceleration": 1e6,
    "max_angular_acceleration": 1e6,
}
"""The controller of ch. 4 as one of multirotors."""


@pytest.mark.slow
def test_the_28_tracking_flights_of_chapter_4_are_flights_of_a_multirotor():
    """Their first second, with jumps of the instant gaits; their full length differs by 4e-13 m."""
    gaits = (
        "fixed",
        *(f"{kind}_t{period}" for kind in ("instant", "continuous") for period in "123"),
    )
    changes = {"simulation.duration": 1.1, "simulation.engine": "native"}
    for reference, gait, decoupler in product(
        ("line", "circle"), gaits, ("conventional", "modified")
    ):
        address = f"ch04_tracking/{reference}#{gait}_{decoupler}"
        scenario = tiltsim.load_scenario(address, changes)
        tables = {
            name: getattr(scenario, name).model_dump()
            for name in ("gait", "reference", "simulation")
        }
        general = document(
            "tiltrotor",
            controller={**CHAPTER_4, "decoupler": decoupler},
            initial={**scenario.initial.model_dump(), "rotor_speed": 300.0},
            **tables,
        )
        flights = tiltsim.simulate(scenario), tiltsim.simulate({**general, **tables})
        assert flights[0].end == flights[1].end, address
        apart = np.abs(flights[0]["position"] - flights[1]["position"]).max()
        assert apart < 1e-9, address
        assert np.abs(flights[0]["attitude"] - flights[1]["attitude"]).max() < 1e-9, address
