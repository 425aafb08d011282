"""The plant ``rigid_body``: MuJoCo's physics in equations, and how its solvers converge."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.laws.layers.test_on_equations import (
    LIMITS,
    MOTION,
    QUADROTOR,
    SLOW,
    STORM,
    TILTROTOR,
    TROT,
    WEAK,
    fly,
    furthest,
    scenario,
)
from tests.laws.test_laws import LAWS
from tests.laws.test_multirotor import TILTS, document
from tests.simulation.test_batch import GAITS
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import merge
from tiltsim.simulation.simulate import make_plant
from tiltsim.vehicles.rotorcraft import QW
from tiltsim_controllers.vehicle.body import body_of
from tiltsim_controllers.vehicle.cross import cross_table
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN
from tiltsim_controllers.vehicle.rotors import rotor_entries

VEHICLE = PRESETS["luukkonen"]
RIGID = {"simulation": {"plant": "rigid_body"}}
TURNING = {"initial": {"angular_velocity": [0.5, -0.4, 0.6]}}
FULL = (SLOW, LIMITS, WEAK, STORM)
MULTIROTORS = {
    "six tilting": ("tilt_hexarotor", {"gait": TILTS}),
    "six": ("hexarotor", {"vehicle": {"rotor_time_constant": 0.02}, "initial": TURNING["initial"]}),
    "eight": ("omni_octorotor", {"vehicle": {"max_rotor_speed": 600.0}}),
}


def multirotor(name, plant):
    file, tables = MULTIROTORS[name]
    return tiltsim.simulate(
        document(file, **{**tables, "simulation": {"plant": plant, "timestep": 0.002}})
    )


def largest_difference(one, other, names=MOTION):
    return furthest((one, other), names)


# --- MuJoCo ------------------------------------------------------------------------------------
# With one solver the plants differ by the inertia of MuJoCo's pods: 1e-13 kg m^2 on a hinge of
# 1e-6, so a pod answers to one ten-millionth of the body's angular acceleration.


@pytest.mark.parametrize(
    "changes",
    [(TILTROTOR, TROT, TURNING), (TILTROTOR, TROT, *FULL), (QUADROTOR, STORM)],
    ids=["turning", "limited", "quadrotor"],
)
def test_the_rigid_body_is_mujoco_without_its_pods(changes):
    mujoco, rigid = (fly(*changes, plant=plant) for plant in ("mujoco", "rigid_body"))
    assert rigid.end.kind == "completed"
    assert largest_difference(mujoco, rigid) < 1e-8
    assert max(np.ptp(rigid[name]) for name in MOTION) > 0.01
    thesis = fly(*changes, plant="thesis")
    assert largest_difference(thesis, rigid) > (1e-9 if changes[0] is QUADROTOR else 1e-5)


@pytest.mark.parametrize("name", MULTIROTORS)
def test_the_rigid_body_is_mujoco_with_any_number_of_rotors(name):
    mujoco, rigid = (multirotor(name, plant) for plant in ("mujoco", "rigid_body"))
    assert largest_difference(mujoco, rigid) < 1e-8
    assert max(np.ptp(rigid[name]) for name in MOTION) > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("gait", ["fixed", "trot_continuous", "two_color"])
def test_at_fine_steps_mujoco_is_nanometers_away(gait):
    plan = {"type": gait, **GAITS[gait]}
    fine = {"timestep": 0.00025, "duration": 0.5, "record_timestep": 0.02}
    mujoco, rigid = (
        fly(TILTROTOR, plant=plant, gait=plan, simulation=fine)
        for plant in ("mujoco", "rigid_body")
    )
    assert largest_difference(mujoco, rigid) < 1e-8


def test_a_pod_stops_where_its_servo_does():
    servo = {"natural_frequency": 25.0, "damping_ratio": 0.3, "max_angle": 0.11}
    stuck = {"fault": [{"type": "stuck_servo", "rotor": 1, "time": 0.0, "angle": 0.1}]}
    level = {"gait": {"angles": [0.0, 0.0, 0.0, 0.0]}, "vehicle": {"tilt_servo": servo}}
    often = {"simulation": {"record_timestep": 0.002}}
    flight = fly(TILTROTOR, level, stuck, often, plant="rigid_body")
    assert flight["alpha_1"].max() == 0.11
    assert flight["alpha_1"][-1] < 0.11


# --- solvers -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("solver", "order"), [("RK4", 4), ("ode3", 3)])
def test_half_the_step_leaves_the_error_of_the_order(solver, order):
    smooth = {"vehicle": {"rotor_time_constant": 0.05}, **TURNING}
    reference, *errors = (
        fly(
            TILTROTOR,
            smooth,
            plant="rigid_body",
            simulation={"integrator": solver, "timestep": step, "record_timestep": 0.02},
        )
        for step in (0.0005, 0.004, 0.002)
    )
    coarse, fine = (largest_difference(reference, flight) for flight in errors)
    assert 0.8 * 2.0**order < coarse / fine < 1.35 * 2.0**order


def test_solvers_keep_the_length_of_the_quaternion():
    plant = make_plant(assemble(scenario(TILTROTOR, TURNING, RIGID)))
    plant.advance(100)
    quaternion = plant.state[1 + QW :][:4]
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.slow
def test_engines_fly_the_same_flight():
    python, native = (
        fly(TILTROTOR, TROT, LIMITS, plant="rigid_body", simulation={"engine": engine})
        for engine in ("python", "native")
    )
    assert native.engine == "native"
    np.testing.assert_array_equal(python.samples, native.samples)


# --- the table of rotors -----------------------------------------------------------------------


@pytest.mark.parametrize("tilting", [True, False])
def test_a_cross_has_the_table_of_its_rotors(tilting):
    arms = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    rows = [
        rotor_entries(
            VEHICLE.arm_length * arm,
            (0.0, 0.0, 1.0),
            VEHICLE.thrust_coefficient,
            VEHICLE.drag_coefficient,
            spin,
            **({"tilt": tilt, "hinge_axis": arm} if tilting else {}),
        )
        for tilt, (arm, spin) in enumerate(zip(arms, SPIN, strict=True))
    ]
    assert cross_table(VEHICLE, tilting=tilting) == pytest.approx(np.ravel(rows), abs=1e-20)


def test_principal_moments_are_a_matrix():
    whole = body_of(VEHICLE.mass, np.diag(VEHICLE[1:4]), VEHICLE.gravity)
    for found, expected in zip(VEHICLE.body, whole, strict=True):
        assert found == pytest.approx(expected, rel=1e-15)


# --- mistakes ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (LAWS["tilt_car_third_derivative"], r"plant.*no tilt_car; use mujoco or thesis"),
        ({"vehicle": {"pod": {"mass": 0.01}}}, r"vehicle.pod.*has massless pods"),
        ({"simulation": {"integrator": "Euler"}}, r"integrator.*rigid_body plant: RK4, ode3"),
        ({"simulation": {"timestep": 0.005}}, r"timestep.*tilt servo at 300 rad/s"),
        ({"ground": {}}, r"plant.*no ground contact; use mujoco"),
    ],
)
def test_features_without_a_rigid_body_are_refused(tables, message):
    with pytest.raises(InputError, match=message):
        tiltsim.parse_scenario(merge(RIGID, tables))


def test_mujoco_has_no_ode3():
    with pytest.raises(InputError, match=r"integrator.*mujoco plant: RK4, implicitfast"):
        tiltsim.parse_scenario({"simulation": {"integrator": "ode3"}})
