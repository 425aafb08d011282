"""Layers around vehicles of six and eight rotors: on both plants, both engines, and as for four."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.laws.assembling import assemble
from tiltsim.models.vehicle_parts import VehiclePose
from tiltsim.plants.command import Command, check_command
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.plants.mujoco_plant import build_model
from tiltsim.simulation.simulate import make_plant
from tiltsim.studies.multirotor_analysis import fleet_file
from tiltsim.vehicles.rotorcraft import Layout

INERTIA = 3e-5  # kg m^2, of a rotor
STORM = {
    "drag": {"linear": [0.2, 0.3, 0.1], "area": [0.01, 0.01, 0.02]},
    "wind": [3.0, 0.0, 0.2],
    "gust": {"velocity": [2.0, 0.0, 0.0], "rise": 0.05, "start": 0.05},
    "ground_effect": {"rotor_radius": 0.12, "height": -0.15},
}
TILTS = {
    "type": "waypoints",
    "angles": [[0.2, -0.1, 0.3, -0.2, 0.1, 0.0], [0.4, -0.3, 0.0, 0.1, -0.2, 0.3]],
    "period": 0.4,
}
LAG = {"rotor_time_constant": 0.02, "max_rotor_speed": 900.0}
MOTION = ("position", "attitude")


def scenario(name, vehicle=None, simulation=None, **tables):
    tables.setdefault("controller", {"law": "attitude_force"})
    tables["vehicle"] = {"model": "multirotor", "mjcf": str(fleet_file(name)), **(vehicle or {})}
    timing = {"duration": 0.1, "engine": "python", "record_timestep": 0.02}
    return tiltsim.parse_scenario({**tables, "simulation": {**timing, **(simulation or {})}})


def fly(*arguments, **tables):
    flight = tiltsim.simulate(scenario(*arguments, **tables))
    assert flight.end.kind == "completed", flight.end
    return flight


def furthest(one, other, names=MOTION):
    return max(np.abs(one[name] - other[name]).max() for name in names)


def test_the_tiltrotor_flies_in_air_near_the_ground_as_a_multirotor_does():
    """The drag, the places of the rotors and the ground effect on each, by tables."""
    tables = {
        "air": {**STORM, "wind": [3.0, 1.0, 0.2]},
        "gait": {"type": "fixed", "angles": [-0.2, -0.2, 0.2, 0.2]},
        "initial": {"attitude": [0.1, 0.05, 0.0], "rotor_speed": 361.0},
    }
    law = {"gait_rate_feedforward": True, "decoupling": "exact", "decoupler": "exact"}
    general = fly(
        "tiltrotor",
        controller={
            "law": "attitude_force", "gains": "feedforward", "attitude_error": "euler_angles"
        },
        **tables,
    )  # fmt: skip
    simulation = general.scenario.simulation.model_dump()
    special = tiltsim.simulate(
        {"controller": {**law, "gains": "feedforward"}, "simulation": simulation, **tables}
    )
    assert furthest(general, special) < 1e-9
    assert np.ptp(special["z"]) > 1e-3


def test_plants_agree_to_the_order_of_their_solvers():
    """Lag, limits, air, ground and heavy rotors; pitching alone there is no gyroscopic torque."""
    tables = {"air": STORM, "initial": {"attitude": [0.0, -0.05, 0.0]}}
    vehicle = {**LAG, "rotor_inertia": INERTIA}
    coarse, fine = (
        [
            fly("hexarotor", vehicle, {"plant": plant, "timestep": step}, **tables)
            for plant in ("mujoco", "thesis")
        ]
        for step in (0.004, 0.002)
    )
    assert furthest(*fine) < 2e-7
    assert 6.0 < furthest(*coarse) / furthest(*fine) < 11.0  # of third order
    assert np.ptp(fine[0]["pitch"]) > 0.01


def angular_momentum(plant, rotors):
    """Angular momentum of body, pods and rotors about the center of mass, world axes, (3,)."""
    model, data = plant.model, plant.data
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    sites = [data.site(f"rotor_{i}").xmat.reshape(3, 3)[:, 2] for i in range(1, rotors + 1)]
    return data.body("vehicle").subtree_angmom + INERTIA * data.act[:rotors] @ np.array(sites)


def test_angular_momentum_stays():
    """Thrust off: body, pods and rotors keep what they have in all, to RK4's fourth order."""
    off = [{"type": "rotor_loss", "rotor": rotor, "time": 0.0} for rotor in range(1, 7)]
    tables = {"initial": {"angular_velocity": [0.8, -0.5, 0.6]}, "gait": TILTS, "fault": off}
    vehicle, drifts = {"rotor_inertia": INERTIA, "rotor_time_constant": 0.02}, []
    for step in (0.001, 0.0005):
        desired = scenario("tilt_hexarotor", vehicle, {"timestep": step}, **tables)
        plant = make_plant(assemble(desired))
        momentum = angular_momentum(plant, 6)
        plant.advance(round(0.01 / step))
        drifts.append(np.abs(angular_momentum(plant, 6) - momentum).max())
    assert drifts[1] < 5e-9
    assert drifts[0] > 10.0 * drifts[1]


ERROR = {"mass": 1.05, "inertia": [1.1, 1.05, 1.0], "thrust_coefficient": 0.95}


def test_a_model_error_is_in_the_plant_and_not_in_the_law():
    """On both plants; the inertia with its products, the pods' part included."""
    plain, wrong = (scenario("tilt_heptarotor", model_error=error) for error in ({}, ERROR))
    assembly = assemble(wrong)
    assert assembly.setup.parameters.law == assemble(plain).setup.parameters.law
    known, model = plain.vehicle.resolve(), build_model(assembly)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    whole = VehiclePose(model, data).moments(range(1, model.nbody))
    scale = np.sqrt(ERROR["inertia"])
    desired = np.reshape(known.inertia, (3, 3)) * np.outer(scale, scale)
    assert whole.mass == pytest.approx(1.05 * known.mass, rel=1e-12)
    np.testing.assert_allclose(whole.inertia, desired, rtol=1e-9, atol=1e-12)
    gears = model.actuator_gear[[model.actuator(f"thrust_{i}").id for i in range(1, 8)], 2]
    np.testing.assert_allclose(gears, 0.95 * np.array(known.thrust_coefficients), rtol=1e-12)

    flights = [
        fly("hexarotor", {}, {"plant": plant}, model_error=ERROR) for plant in ("mujoco", "thesis")
    ]
    assert furthest(*flights) < 1e-6
    assert np.abs(flights[0]["z"][-1]) > 1e-5  # it is heavier, and weaker


@pytest.mark.parametrize("name", ["tilt_hexarotor", "omni_octorotor"])
def test_commanded_speeds_take_their_momentum_from_the_body(name):
    controller = {"law": "python", "function": "unused.py:law"}
    initial = {"angular_velocity": [0.8, -0.5, 0.6], "attitude": [0.3, -0.2, 1.0]}
    tables = {"gait": TILTS} if name == "tilt_hexarotor" else {}
    vehicle = {"rotor_inertia": INERTIA}
    plant = CommandedPlant(
        assemble(scenario(name, vehicle, controller=controller, initial=initial, **tables))
    )
    rotors = plant.layout.rotors
    before, rates = angular_momentum(plant, rotors), plant.data.qvel[3:6].copy()
    speeds = Command(rotor_speeds=[310.0, 340.0, 280.0, 420.0, *[300.0] * (rotors - 4)])
    plant.apply(check_command(speeds, Layout(rotors, 0)))
    assert np.abs(plant.data.qvel[3:6] - rates).max() > 0.05
    np.testing.assert_allclose(angular_momentum(plant, rotors), before, atol=1e-15)


def test_stiff_servos_approach_pods_that_follow_exactly():
    """The torques by tilt rates and rotor accelerations against the momentum formulation."""
    short = {"plant": "thesis", "duration": 0.008, "timestep": 4e-5, "record_timestep": 0.004}
    heavy = {"rotor_inertia": INERTIA}
    exact = fly("tilt_hexarotor", heavy, short, gait=TILTS)
    servo = {"natural_frequency": 2e4}
    stiff = fly("tilt_hexarotor", {**heavy, "tilt_servo": servo}, short, gait=TILTS)
    light = fly("tilt_hexarotor", {}, short, gait=TILTS)
    assert furthest(exact, stiff) < 1e-2 * furthest(exact, light)
    assert furthest(exact, light) > 1e-6


# --- a supervisor, the measured angular acceleration, and allocation within limits -------------

SWINGS = {"type": "trot_continuous", "amplitude": 0.9, "period": 0.8}
HOLD = {"supervisor": {"strategy": "hold", "min_margin": 1.3}}
SCALE = {"supervisor": {"strategy": "scale", "min_margin": 1.3}}
MEASURED = {"angular_acceleration": "measured"}
PRIORITIZED = {"allocation": "prioritized"}
NARROW = {"min_rotor_speed": 345.0, "max_rotor_speed": 372.0}
WEAK = [{"type": "partial_thrust", "rotor": 1, "time": 0.02, "factor": 0.95}]
"""Unknown to the law: measurements differ from its model."""


@pytest.mark.parametrize(
    ("plant", "layer"),
    [
        ("mujoco", HOLD),
        ("thesis", HOLD | MEASURED),
        pytest.param("rigid_body", SCALE, marks=pytest.mark.slow),
        pytest.param("mujoco", MEASURED, marks=pytest.mark.slow),
        pytest.param("rigid_body", PRIORITIZED | SCALE, marks=pytest.mark.slow),
    ],
)
def test_with_further_parts_the_tiltrotor_flies_as_a_multirotor_does(plant, layer):
    tables = {
        "gait": SWINGS,
        "fault": WEAK,
        "initial": {"attitude": [0.1, 0.05, 0.0], "rotor_speed": 361.0},
    }
    law = {"gait_rate_feedforward": True, "decoupling": "exact", "decoupler": "exact"}
    limits = NARROW if "allocation" in layer else {}
    general = fly(
        "tiltrotor",
        limits,
        simulation={"plant": plant, "timestep": 0.002},
        controller={
            **{"law": "attitude_force", "gains": "feedforward", "attitude_error": "euler_angles"},
            **layer,
        },
        **tables,
    )
    simulation = general.scenario.simulation.model_dump()
    special = tiltsim.simulate(
        {
            **{"controller": {**law, "gains": "feedforward", **layer}, "vehicle": limits},
            **{"simulation": simulation, **tables},
        }
    )
    names = (*MOTION, "tilt_angles", "reference_tilt_angles", "reference_attitude")
    assert furthest(general, special, names) < 1e-9
    if "supervisor" in layer:
        assert 0.2 < special["supervision"].max() <= 1.0
        np.testing.assert_allclose(general["supervision"], special["supervision"], atol=1e-9)
    if limits:
        speeds = np.abs(special["rotor_speeds"])
        assert 345.0 - 1e-9 <= speeds.min() < 346.0
        assert 371.0 < speeds.max() <= 372.0 + 1e-9


def test_six_arms_hold_a_gait_that_would_push_aside_before_the_vehicle_leans():
    """At a level attitude the tilts after 0.3 s have a margin of 1.4 rad, against 1.5 requested."""
    aside = (0.4 * np.sin(np.pi / 6.0 + np.pi / 3.0 * np.arange(6))).tolist()
    times = [0.0, *np.arange(0.2, 0.41, 0.01).tolist()]
    rows = [[time, *(aside if time > 0.305 else [0.0] * 6)] for time in times]
    held = fly(
        "tilt_hexarotor",
        simulation={"duration": 0.6, "timestep": 0.002},
        controller={
            "law": "attitude_force",
            "dimension": 1,
            "supervisor": {"strategy": "hold", "min_margin": 1.5, "horizon": 0.2},
        },
        gait={"type": "table", "rows": rows},
    )
    clock = held["time"] - held["supervisor_state"]
    assert 0.1 <= clock[-1] < 0.15
    assert held["supervision"][-1] == pytest.approx(1.0, abs=1e-3)
    assert held["supervision"].max() < 1.2
    assert np.abs(held["alpha_ref_2"]).max() < 1e-3


@pytest.mark.parametrize("strategy", ["scale", "hold"])
def test_once_a_rotor_is_known_to_be_lost_the_others_are_watched(strategy):
    """Level and untilted, five of the six arms have a determinant of 2.309 instead of 4."""
    aside = (0.4 * np.sin(np.pi / 6.0 + np.pi / 3.0 * np.arange(6))).tolist()
    limits = {"strategy": strategy, "min_margin": 0.0, "min_determinant": 2.305}
    flight = fly(
        "tilt_hexarotor",
        simulation={"timestep": 0.002, "record_timestep": 0.01},
        controller={
            **{"law": "attitude_force", "dimension": 1, "supervisor": limits},
            **{"failed_rotor": 1, "failure_known_from": 0.05},
        },
        gait={"type": "waypoints", "angles": [[0.0] * 6, aside], "period": 0.5},
    )
    known = flight["time"] > 0.06
    assert not flight["supervision"][flight["time"] < 0.045].any()
    assert flight["supervision"][known].min() > 0.05, flight["supervision"]
    assert np.isfinite(flight["supervision"]).all()


@pytest.mark.parametrize(
    ("name", "strategy", "message"),
    [
        ("tilt_hexarotor", "return_to_red", "only the tiltrotor has red gaits"),
        ("tilt_hexarotor", "scale", "the vehicle has 1 of the 3 components of force at tilt"),
        ("hexarotor", "hold", "vehicle.mjcf has no tilts"),
    ],
)
def test_supervision_without_purpose_is_refused(name, strategy, message):
    controller = {"law": "attitude_force", "supervisor": {"strategy": strategy}}
    gait = {"gait": TILTS} if strategy == "scale" else {}
    line = refusal(scenario, name, controller=controller, **gait)
    assert f'controller.supervisor.strategy = "{strategy}": {message}' in line


def test_scaling_to_angles_with_too_little_force_without_the_lost_rotor_is_refused(tmp_path):
    """Untilted all but one of six rotors are parallel, and that one is lost."""
    text = fleet_file("tilt_hexarotor").read_text()
    text = text.replace("scene.xml", str(fleet_file("scene")))
    inclined = 'name="rotor_6" class="vehicle" axisangle="1 0 0 0.3"'
    vehicle = tmp_path / "inclined.xml"
    vehicle.write_text(text.replace('name="rotor_6" class="vehicle"', inclined))
    law = {"law": "attitude_force", "dimension": 2, "supervisor": {"strategy": "scale"}}
    tables = {"vehicle": {"mjcf": str(vehicle)}, "gait": TILTS}
    scenario("tilt_hexarotor", controller=law, **tables)
    line = refusal(scenario, "tilt_hexarotor", controller={**law, "failed_rotor": 6}, **tables)
    assert line.endswith(
        'strategy = "scale": the vehicle has 1 of the 2 components of force at tilt angles '
        "(0, 0, 0, 0, 0, 0) rad, without rotor 6; choose hold, or set controller.dimension = 1"
    )
