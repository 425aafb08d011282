"""Every law in closed loop: engines, restarts, disturbances, and the chapters' experiments."""

from __future__ import annotations

from math import atan

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

import tiltsim
from tests.laws.restarting import assert_restarts
from tests.refusals import refusal
from tiltsim.flight.reading import load_flight
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.models.cross import as_multirotor
from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.scenario.controller import laws_for
from tiltsim.scenario.loading import merge
from tiltsim.scenario.rotorcraft import MultirotorTable
from tiltsim.scenario.vehicle import VEHICLES
from tiltsim.simulation.simulate import make_plant
from tiltsim.studies.multirotor_analysis import balance_report
from tiltsim_controllers.analysis.singularity import (
    force_matrix,
    normalized_determinant,
    published_determinant,
    torque_matrix,
    world_up,
)
from tiltsim_controllers.analysis.torque_free import singularity_margin, torque_free_forces
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.vehicle.parameters import PRESETS

GUST = [{"type": "acceleration", "value": [0.7, -0.4, 0.2]}]
QUADROTOR = {"model": "quadrotor", "preset": "ar_drone_2_unrounded"}
CIRCLE = {"type": "circle", "radius": -1.0, "angular_frequency": -0.5, "position": [1.0, 0.0, 0.1]}
# Loops slow enough to be sampled at a few milliseconds; the published ones are not.
SLOW = {"position": [40.0, 600.0, 4000.0], "attitude": [40.0, 600.0, 4000.0]}
LAWS = {
    "yaw_position": {
        "vehicle": QUADROTOR,
        "initial": {"attitude": [0.4, -0.3, 0.2], "angular_velocity": [0.3, -0.2, 0.1]},
        "controller": {"law": "yaw_position"},
        "reference": CIRCLE,
    },
    "switching": {
        "vehicle": QUADROTOR,
        "initial": {"attitude": [0.5, -0.5, 0.1]},
        "controller": {"law": "switching"},
        "reference": {**CIRCLE, "roll": 0.05},
    },
    "quadrotor_attitude_altitude": {
        "vehicle": QUADROTOR,
        "initial": {"attitude": [0.5, -0.5, 0.1]},
        "controller": {"law": "quadrotor_attitude_altitude"},
        "reference": {"type": "attitude_altitude", "roll": 0.1, "altitude": 0.3},
    },
    "full_pose": {
        "initial": {"attitude": [0.1, -0.1, 0.1]},
        "controller": {"law": "full_pose", "max_tilt_rate": 20.0, "gains": SLOW},
        "gait": {"type": "fixed", "angles": [-0.1, 0.1, -0.2, 0.1]},
        "reference": {"type": "setpoint", "position": [0.1, 0.0, 0.0], "roll": 0.05},
    },
    "attitude_altitude": {
        "controller": {"decoupling": "exact", "gains": "exact"},
        "gait": {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0},
        "reference": {"type": "setpoint", "position": [0.1, 0.0, 0.0]},
    },
}

LAWS |= {
    "tilt_car_third_derivative": {
        "vehicle": {"model": "tilt_car"},
        "initial": {"rotor_speed": [90.0, 80.0], "attitude": [0.0, 0.0, 0.3]},
        "controller": {"law": "tilt_car_third_derivative", "restoring_rate": 0.5},
        "reference": {**CIRCLE, "position": [10.0, 0.0, 0.0], "radius": -10.0},
    },
    "tilt_car_fourth_derivative": {
        "vehicle": {"model": "tilt_car", "mass": 1.2},
        "initial": {"rotor_speed": 80.0, "velocity": [0.0, -9.0, 0.0]},
        "controller": {"law": "tilt_car_fourth_derivative", "decoupling": "published"},
        "reference": {**CIRCLE, "position": [10.0, 0.0, 0.0], "radius": -10.0},
    },
    "tilt_car_planned_direction": {
        "vehicle": {"model": "tilt_car"},
        "initial": {"position": [0.1, -0.2, 0.0]},
        "controller": {"law": "tilt_car_planned_direction"},
        "gait": {"type": "penguin_large", "period": 0.4},
        "reference": {"type": "line", "velocity": [0.5, 0.0, 0.0], "acceleration": [1.0, 0.0, 0.0]},
    },
}
LAWS["gait_feedforward"] = {
    "controller": {
        "decoupling": "exact",
        "decoupler": "exact",
        "gait_rate_feedforward": True,
        "gains": {
            "attitude": {"bandwidth": 20.0},
            "altitude": {"bandwidth": 8.0, "integral": 0.5},
            "position": {"bandwidth": 1.5, "integral": 0.5},
        },
    },
    "gait": {"type": "trot_continuous", "amplitude": 0.4, "period": 0.6},
    "reference": {"type": "circle", "radius": 0.5, "angular_frequency": 0.4},
}

each_law = pytest.mark.parametrize("law", LAWS)
on_both_plants = pytest.mark.parametrize("plant", ["mujoco", "thesis"])
continuous_and_held = pytest.mark.parametrize("control_timestep", [0.0, 0.003])


def scenario(law, simulation=None, **tables):
    simulation = {"duration": 0.42, **(simulation or {})}
    return tiltsim.parse_scenario({**LAWS[law], **tables, "simulation": simulation})


def fly(law, simulation=None, **tables):
    return tiltsim.simulate(scenario(law, simulation, **tables))


def test_every_law_is_here():
    assert set(LAWS) == set(LOOPS)


@each_law
@on_both_plants
@continuous_and_held
def test_a_saved_state_restarts_bit_identically(law, plant, control_timestep):
    simulation = {"plant": plant, "engine": "python", "control_timestep": control_timestep}
    assert_restarts(scenario(law, simulation), 40, 20)


@each_law
def test_observing_changes_nothing(law):
    plant = make_plant(assemble(scenario(law, {"engine": "python"})))
    before = plant.state
    assert plant.observe() == plant.observe()
    np.testing.assert_array_equal(plant.state, before)


@each_law
def test_the_table_has_the_columns_of_every_flight_and_the_laws_own(law):
    flight = fly(law, {"duration": 0.05})
    table = flight.to_arrow()
    loop = loop_of(flight.scenario)
    assert table.column_names == [*loop.kind.columns, *loop.further_units]
    for field in table.schema:
        assert field.metadata == {b"unit": flight.units[field.name].encode()}
    assert all(np.isfinite(column).all() for column in flight.columns.values())


# Ch. 2 has the gyroscopic torque, so the quadrotor's plants model the same; a switch falls into a
# step, not onto a moment. Ch. 3 leaves it out, and in MuJoCo the tiltrotor's pods follow servos.
# So does the tilt-car's hinge: behind a swing at once it lags, and with it the yaw.
AGREEMENT = {
    "switching": 5e-4,
    "full_pose": 4e-3,
    "attitude_altitude": 1e-3,
    "tilt_car_third_derivative": 1e-2,
    "tilt_car_fourth_derivative": 1e-2,
    "tilt_car_planned_direction": 2.1,
    "gait_feedforward": 5e-3,
}


@each_law
def test_plants_fly_nearly_the_same_flight(law):
    mujoco_flight, thesis_flight = (fly(law, {"plant": plant}) for plant in ("mujoco", "thesis"))
    for name in {"x", "y", "z", "roll", "pitch", "yaw"} & {*mujoco_flight.columns}:
        difference = np.abs(mujoco_flight[name] - thesis_flight[name]).max()
        assert difference < AGREEMENT.get(law, 1e-7), name


# --- what the samples hold ---------------------------------------------------------------------


def test_the_quadrotors_rotors_carry_what_its_law_asks_for():
    flight = fly("yaw_position")
    total = sum(flight[f"thrust_{rotor}"] for rotor in (1, 2, 3, 4))
    np.testing.assert_allclose(total, flight["extension_thrust"], rtol=1e-12)


def test_determinants_of_the_quadrotor():
    flight = fly("yaw_position")
    attitude = flight["roll"], flight["pitch"]
    vehicle = PRESETS["ar_drone_2_unrounded"]
    exact = normalized_determinant(*attitude, flight["extension_thrust"], vehicle)
    np.testing.assert_array_equal(flight["determinant"], exact)
    published = published_determinant(*attitude)
    np.testing.assert_array_equal(flight["published_determinant"], published)
    upright = [rotation_matrix((roll, pitch, 0.0))[2, 2] for roll, pitch in zip(*attitude)]
    np.testing.assert_allclose(np.sin(flight["singularity_margin"]), upright, rtol=1e-12)


def test_switching_records_which_law_flies_and_its_target():
    flight = fly("switching", {"duration": 1.0})
    inside = flight["attitude_zone"] == 1.0
    assert inside.any()
    assert not inside.all()
    assert set(flight["roll_ref"][inside]) == {0.05}
    np.testing.assert_array_equal(flight["roll_ref"][~inside], flight["roll"][~inside])
    metrics = flight.metrics()
    assert metrics["switches"] == 1.0
    assert metrics["first_switch_time"] == flight["time"][np.argmax(inside)]


def test_full_pose_holds_a_position_at_a_tilted_attitude():
    simulation = {"duration": 2.5, "timestep": 0.002, "engine": "python"}
    metrics = fly("full_pose", simulation).metrics()
    assert abs(metrics["final_position_error_x"]) < 1e-4
    assert abs(metrics["final_roll"] - 0.05) < 1e-4
    assert metrics["max_tilt_rate"] < 25.0


def test_the_margin_under_full_pose_counts_rotors_that_are_known_to_work():
    """By singular values, as of any multirotor."""
    changes = {"controller": {"failed_rotor": 2, "failure_known_from": 0.05}}
    flight = tiltsim.simulate(
        merge(LAWS["full_pose"], changes | {"simulation": {"duration": 0.1, "timestep": 0.002}})
    )
    tilts, vehicle = flight["tilt_angles"], flight.scenario.vehicle.resolve()
    known = flight["time"] >= 0.05
    works = np.where(known[:, np.newaxis], [1.0, 0.0, 1.0, 1.0], 1.0)[:, np.newaxis]
    forces = torque_free_forces(force_matrix(tilts) * works, torque_matrix(tilts, vehicle) * works)
    expected = singularity_margin(forces, world_up(flight["roll"], flight["pitch"]))
    np.testing.assert_allclose(np.abs(flight["singularity_margin"]), expected, atol=1e-9)
    assert ((flight["determinant"] == 0.0) == known).all()
    assert flight.metrics()["min_singularity_margin"] == 0.0


@pytest.mark.parametrize("law", ["full_pose", "attitude_altitude"])
def test_a_reference_of_attitude_and_altitude_frees_the_position_of_laws_without_a_say_in_it(law):
    """Six outputs hold x = y = 0; four let the vehicle drift at the speed that it has."""
    free = {"decoupler": "none", "decoupling": "exact", "gains": "exact"}
    flight = tiltsim.simulate(
        tiltsim.parse_scenario(
            {
                "simulation": {"duration": 3.0, "timestep": 0.002, "engine": "python"},
                "initial": {
                    **{"position": [0.3, -0.2, 0.1], "velocity": [0.0, 0.5, 0.0]},
                    "rotor_speed": 361.0,
                },
                "controller": {"law": law, **({"gains": SLOW} if law == "full_pose" else free)},
                "reference": {"type": "attitude_altitude"},
            }
        )
    )
    x, y = flight["x"][-1], flight["y"][-1]
    if law == "full_pose":
        assert max(abs(x), abs(y)) < 1e-6
    else:
        assert (x, y) == pytest.approx((0.3, -0.2 + 0.5 * 3.0), abs=1e-6)
    assert loop_of(flight.scenario).follows_position(flight.scenario) is (law == "full_pose")


# --- yaw ---------------------------------------------------------------------------------------

LIMITED = {"min_rotor_speed": 100.0, "max_rotor_speed": 600.0}
SLOW_YAW = {
    "attitude": {"bandwidth": 20.0},
    "yaw": {"bandwidth": 3.0},
    "altitude": {"bandwidth": 5.0},
    "position": {"bandwidth": 1.0},
}


def turned(step, duration, speed, vehicle=None, **controller):
    exact = {"decoupling": "exact", "decoupler": "exact", "gains": "exact"}
    return tiltsim.simulate(
        tiltsim.parse_scenario(
            {
                "simulation": {"duration": duration, "timestep": 0.002, "engine": "python"},
                "vehicle": vehicle or {},
                "initial": {"rotor_speed": speed},
                "controller": exact | controller,
                "reference": {"type": "setpoint", "yaw": step},
            }
        )
    )


def test_a_step_in_yaw_stops_a_rotor_where_its_torque_ends():
    """Not for an error of the law: for the acceleration that its gains ask for."""
    vehicle = PRESETS["ar_drone_2"]
    hover = vehicle.hover_rotor_speed
    most = 4.0 * vehicle.drag_coefficient * hover**2 / vehicle.inertia_zz
    assert most == pytest.approx(26.4, abs=0.05)
    loop = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-4000.0, -600.0, -40.0]])
    instants = np.linspace(0.0, 0.3, 301)
    demanded = max(abs((expm(loop * t) @ [-1.0, 0.0, 0.0])[2]) for t in instants)
    assert most / demanded == pytest.approx(0.39, abs=0.005)
    below, above = (turned(share * most / demanded, 0.1, hover) for share in (0.98, 1.02))
    assert below.end.kind == "completed"
    assert below.metrics()["min_rotor_speed"] < 0.3 * hover
    assert above.end.kind == "singular"
    assert "came to a stop" in above.end.cause
    assert turned(0.31, 0.1, 300.0).end.kind == "completed"
    assert turned(0.315, 0.1, 300.0).end.kind == "singular"
    assert turned(0.35, 0.1, 300.0).end.time == pytest.approx(0.022, abs=0.003)


@pytest.mark.parametrize(
    ("vehicle", "controller"),
    [(LIMITED, {"allocation": "prioritized"}), ({}, {"gains": SLOW_YAW})],
    ids=["prioritized", "slow yaw"],
)
def test_documented_laws_fly_a_large_step_in_yaw(vehicle, controller):
    flight = turned(3.0, 5.0, 300.0, vehicle, **controller)
    assert flight.end.kind == "completed"
    assert flight["yaw"][-1] == pytest.approx(3.0, abs=1e-3)
    assert flight["z"].min() > -0.5


# --- disturbances ------------------------------------------------------------------------------


@on_both_plants
def test_a_disturbance_accelerates_the_vehicle_from_the_first_moment(plant):
    simulation = {"plant": plant, "duration": 0.001, "engine": "python", "record_timestep": 0.001}
    calm, gusty = (
        fly("attitude_altitude", simulation, disturbance=gust) for gust in ([], GUST + GUST)
    )
    change = [gusty[name][-1] - calm[name][-1] for name in ("vx", "vy", "vz")]
    np.testing.assert_allclose(change, [0.0014, -0.0008, 0.0004], rtol=1e-3)


def test_plants_agree_on_a_gust():
    gait = {"type": "fixed", "angles": [-0.1, 0.1, -0.2, 0.1]}
    flights = [
        fly(
            "attitude_altitude",
            {"plant": plant, "duration": 2.0, "engine": "native"},
            disturbance=GUST,
            gait=gait,
        )
        for plant in ("mujoco", "thesis")
    ]
    for name in ("x", "y", "z", "roll", "pitch"):
        np.testing.assert_allclose(flights[0][name], flights[1][name], atol=1e-4)


def test_the_gust_scenarios_gait_is_the_balanced_one():
    gait = tiltsim.load_scenario("ch01_gust/hover#perfect_gait").gait
    rotors = as_multirotor(PRESETS["ar_drone_2"], tilting=True, reverses=False)
    desired = balance_report(rotors, (1.0, 0.0, 0.0))["angles"]
    np.testing.assert_allclose(gait.angles, desired, atol=1e-8)


# --- the chapters' experiments -----------------------------------------------------------------


def test_only_the_thesis_plant_knows_no_gyroscopic_torque_but_both_know_the_gust():
    perfect = {"simulation.plant": "thesis", "simulation.engine": "native"}
    flight = tiltsim.simulate(tiltsim.load_scenario("ch01_gust/hover#perfect_gait", perfect))
    assert abs(flight.metrics()["final_pitch"]) < 1e-3


def test_the_quadrotor_leans_into_the_gust():
    flight = tiltsim.simulate(tiltsim.load_scenario("ch01_gust/hover#quadrotor"))
    assert flight.metrics()["final_pitch"] == pytest.approx(-atan(1 / 9.8), abs=1e-6)


# --- mistakes ----------------------------------------------------------------------------------

MISTAKES = {
    "law of another vehicle": (
        {"vehicle": QUADROTOR},
        'controller.law = "attitude_altitude": controls the tiltrotor, and vehicle.model = '
        "'quadrotor'; choose yaw_position, switching, quadrotor_attitude_altitude",
    ),
    "unknown law": ({"controller": {"law": "mpc"}}, 'controller.law = "mpc": choose attitude'),
    "rotor inertia of a quadrotor": (
        {"vehicle": {**QUADROTOR, "rotor_inertia": 1e-5}, "controller": {"law": "geometric"}},
        "vehicle.rotor_inertia = 1e-05: not supported for the quadrotor",
    ),
    "key of another law": (
        {"vehicle": QUADROTOR, "controller": {"law": "yaw_position", "decoupler": "exact"}},
        'controller.decoupler = "exact": unknown key; only for law attitude_altitude, '
        "attitude_force; known: ",
    ),
    "unstable gains": (
        {"vehicle": QUADROTOR, "controller": {"law": "yaw_position", "gains": "ch02"}},
        "fails the Routh-Hurwitz criterion under the exact decoupling matrix: "
        "position [10.0, 20.0, 50.0, 500.0]",
    ),
    "gait of a quadrotor": (
        {**LAWS["yaw_position"], "gait": {"type": "fixed", "angles": [0.1, 0.0, 0.0, 0.0]}},
        "not supported for the quadrotor",
    ),
    "rotor speed of a quadrotor": (
        {**LAWS["yaw_position"], "initial": {"rotor_speed": 200.0}},
        "initial.rotor_speed = 200.0: not supported for the quadrotor",
    ),
    "moving gait under full pose": (
        {"controller": {"law": "full_pose"}, "gait": LAWS["attitude_altitude"]["gait"]},
        'gait.type = "trot_continuous": the full_pose law commands the tilts itself',
    ),
    "attitude for a position law": (
        {**LAWS["yaw_position"], "reference": {"type": "setpoint", "pitch": 0.1}},
        "reference.pitch = 0.1: roll and pitch are not outputs of the yaw_position law",
    ),
    "upside down for a law of Euler angles": (
        {"controller": {"law": "full_pose"}, "reference": {"type": "setpoint", "roll": 2.0}},
        "reference.roll = 2.0: the full_pose law cannot turn it over; must be below pi/2",
    ),
    "reference of another law": (
        {**LAWS["yaw_position"], "reference": {"type": "attitude_altitude"}},
        'reference.type = "attitude_altitude": the yaw_position law cannot track it',
    ),
    "feed-forward without a choice": (
        {**LAWS["yaw_position"], "reference": {**CIRCLE, "acceleration_feedforward": True}},
        "always includes all derivatives",
    ),
    "rotorcraft's key for a tilt-car": (
        {"vehicle": {"model": "tilt_car", "arm_length": 0.2}},
        "vehicle.arm_length = 0.2: unknown key; only for model tiltrotor, quadrotor; known: ",
    ),
    "tilt-car's key for a rotorcraft": (
        {"vehicle": {"model": "quadrotor", "top_inertia": 0.1}},
        "vehicle.top_inertia = 0.1: unknown key; only for model tilt_car; known: arm_length",
    ),
    "unknown vehicle": (
        {"vehicle": {"model": "boat"}},
        'vehicle.model = "boat": choose tiltrotor, quadrotor, multirotor, tilt_car',
    ),
    "law of a rotorcraft for a tilt-car": (
        {"vehicle": {"model": "tilt_car"}},
        "choose tilt_car_third_derivative, tilt_car_fourth_derivative, tilt_car_planned_direction",
    ),
    "a tilt-car's gait for a tiltrotor": (
        {"gait": {"type": "penguin_small"}},
        'gait.type = "penguin_small": is a gait of the tilt_car; this vehicle has four tilt angles',
    ),
    "a tiltrotor's gait for a tilt-car": (
        {**LAWS["tilt_car_planned_direction"], "gait": {"type": "fixed"}},
        "the tilt_car_planned_direction law needs one of penguin_small, penguin_large, rotating",
    ),
    "a gait for a law that moves the tilt": (
        {**LAWS["tilt_car_third_derivative"], "gait": {"type": "rotating", "rate": 1.0}},
        "the tilt_car_third_derivative law does not use a gait",
    ),
    "a tilt-car in the air": (
        {**LAWS["tilt_car_third_derivative"], "initial": {"position": [0.0, 0.0, 1.0]}},
        "initial.position = [0.0, 0.0, 1.0]: the tilt_car stays in its plane",
    ),
    "a tilt-car's reference in the air": (
        {
            **LAWS["tilt_car_third_derivative"],
            "reference": {"type": "setpoint", "position": [0.0, 0.0, 1.0]},
        },
        "reference.position = [0.0, 0.0, 1.0]: the tilt_car stays in its plane",
    ),
    "four speeds for two rotors": (
        {**LAWS["tilt_car_third_derivative"], "initial": {"rotor_speed": [1.0, 2.0, 3.0, 4.0]}},
        "the tilt_car has 2 rotors; give one value or one each",
    ),
    "two speeds for four rotors": (
        {"initial": {"rotor_speed": [100.0, 200.0]}},
        "the tiltrotor has 4 rotors; give one value or one each",
    ),
    "a tilt-car's yaw": (
        {**LAWS["tilt_car_third_derivative"], "reference": {"type": "setpoint", "yaw": 0.5}},
        "yaw is not an output of the tilt_car's laws",
    ),
    "no circle": (
        {"reference": {"type": "circle", "radius": 0.0, "angular_frequency": 1.0}},
        "reference.radius = 0.0: must not be 0",
    ),
    "unknown disturbance": (
        {"disturbance": [{"type": "gust", "value": [1.0, 0.0, 0.0]}]},
        'disturbance[0].type = "gust": did you mean air.gust? choose acceleration',
    ),
    "zone turned round": (
        {**LAWS["switching"], "controller": {"law": "switching", "zone": {"roll": [0.2, -0.2]}}},
        "controller.zone.roll = [0.2, -0.2]: the first must not exceed the second",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_clear_line(mistake):
    document, message = MISTAKES[mistake]
    assert message in refusal(tiltsim.parse_scenario, document)


@each_law
def test_a_scenario_written_out_reads_back(law):
    desired = scenario(law)
    assert tiltsim.parse_scenario(desired.model_dump(mode="json")) == desired


def test_a_new_law_on_the_command_line_empties_its_table():
    changed = tiltsim.load_scenario(
        "ch03_gaits/stabilization#gait_1",
        {"controller.tilt_weight": "published", "controller.law": "full_pose"},
    )
    assert changed.controller.tilt_weight == "published"
    assert changed.controller.gains == "ch03"


# --- law states --------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [law for law in LAWS if not law.startswith("tilt_car")])
@pytest.mark.parametrize(("start", "end"), [(-3.11, 3.13), (3.11, -3.13)])
def test_yaw_takes_the_short_way_past_half_a_revolution(law, start, end):
    """It takes 0.04 rad there and not a full turn, and then does not spin on for ever."""
    reference = {"type": "setpoint", "yaw": end}
    if law == "quadrotor_attitude_altitude":
        reference["type"] = "attitude_altitude"
    flight = fly(
        law,
        {"plant": "thesis", "engine": "python", "timestep": 0.002, "duration": 2.0},
        initial={"attitude": [0.0, 0.0, start]},
        reference=reference,
        gait={"type": "fixed"},
    )
    yaw = np.unwrap(flight["yaw"])
    assert flight.end.kind == "completed"
    assert np.abs(yaw - start).max() < 0.08
    assert yaw[-1] - start == pytest.approx(-0.0432 if start < 0.0 else 0.0432, abs=0.02)


@pytest.mark.parametrize("model", ["tiltrotor", "quadrotor"])
def test_law_states_integrate_their_controls_and_act_on_nothing(model):
    compiled = compile_model(
        RotorcraftSpec(model, PRESETS["ar_drone_2"], law_states=2), visuals=False
    )
    plain = compile_model(RotorcraftSpec(model, PRESETS["ar_drone_2"]), visuals=False)
    assert (compiled.na, compiled.nu) == (plain.na + 2, plain.nu + 2)
    data, bare = mujoco.MjData(compiled), mujoco.MjData(plain)
    for this, its in ((compiled, data), (plain, bare)):
        mujoco.mj_resetDataKeyframe(this, its, 0)
    np.testing.assert_array_equal(data.act[-2:], 0.0)
    data.actuator("law_1").ctrl[0], data.actuator("law_2").ctrl[0] = 5.0, -2.0
    mujoco.mj_step(compiled, data, 100)
    mujoco.mj_step(plain, bare, 100)
    np.testing.assert_allclose(data.act[-2:], [0.5, -0.2], rtol=1e-12)
    np.testing.assert_array_equal(data.qpos, bare.qpos)


def test_the_extension_starts_at_the_weight():
    plant = MujocoPlant(assemble(scenario("yaw_position")))
    vehicle = PRESETS["ar_drone_2_unrounded"]
    np.testing.assert_array_equal(plant.data.act[4:], [vehicle.mass * vehicle.gravity, 0.0])


@each_law
def test_a_flight_reads_back_with_the_laws_own_states(law, tmp_path):
    flight = fly(law, {"duration": 0.05})
    flight.save(tmp_path)
    again = load_flight(tmp_path)
    np.testing.assert_array_equal(again.samples, flight.samples)
    assert again.scenario == flight.scenario


def test_laws_for_all_rotorcraft_fly_a_new_kind_of_them(monkeypatch):
    """And laws of particular vehicles do not."""

    class Blimp(MultirotorTable):
        pass

    monkeypatch.setitem(VEHICLES, "blimp", Blimp)
    assert {"geometric", "lqr", "python", "numpy"} <= {*laws_for("blimp")}
    assert not {"attitude_altitude", "tilt_car_third_derivative"} & {*laws_for("blimp")}
    assert not {"geometric", "python"} & {*laws_for("tilt_car")}
