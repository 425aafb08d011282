"""Feeding back the angular acceleration of the plant instead of the law's model."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.laws.layers.test_any_rotors import TILTS
from tests.laws.layers.test_on_equations import (
    LATE,
    SENSORS,
    SLOW,
    STORM,
    TILTROTOR,
    TROT,
    WEAK,
    WRONG,
    scenario,
)
from tests.simulation.test_batch import three_ways
from tiltsim.engines.control import control_callback
from tiltsim.equations.actuator_level import actuator_plant
from tiltsim.errors import InputError
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.laws.layers.instruments import plant_acceleration_of
from tiltsim.laws.layers.layer import read_actuators
from tiltsim.models.rotor_table import hover_speeds
from tiltsim.plants.plant import initial_state
from tiltsim.resources import shipped_folder
from tiltsim.scenario.time_steps import _reaction_gains
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.analysis.singularity import hover_rotor_speeds
from tiltsim_controllers.code.arrays import as_arrays
from tiltsim_controllers.vehicle.parameters import SPIN

MEASURED = {"controller": {"angular_acceleration": "measured"}}
THESIS = {"simulation": {"plant": "thesis"}}
HEAVY = {"vehicle": {"pod": {"mass": 0.02, "inertia": 2e-5}}}
SPINNING = {"initial": {"angular_velocity": [1.5, -0.8, 2.0]}}
LIMITED = {"vehicle": {"min_rotor_speed": 300.0, "max_rotor_speed": 380.0}}
FEEDFORWARD = {"controller": {"gait_rate_feedforward": True, "gains": "feedforward"}}
FILE = str(shipped_folder("mjcf") / "tiltrotor.xml")
EVERYTHING = (TILTROTOR, TROT, SPINNING, STORM, LATE, SENSORS, SLOW, WEAK, WRONG, LIMITED)


HEAVY_ROTORS = {"vehicle": {"rotor_inertia": 1e-5}}


def hexarotor(folder, inertial, rotor_4=""):
    """Six tilting arms with other pods than the shipped ones, and where a rotor is in its pod."""
    for name in ("scene.xml", "tilt_hexarotor.xml"):
        text = (shipped_folder("mjcf") / name).read_text()
        text = text.replace('name="rotor_4"', f'name="rotor_4" {rotor_4}')
        (folder / name).write_text(text.replace(LIGHT_POD, inertial))
    vehicle = {"model": "multirotor", "mjcf": str(folder / "tilt_hexarotor.xml")}
    controller = {"law": "attitude_force", "allow_unstable": True}
    return {"vehicle": vehicle, "controller": controller, "gait": TILTS}


LIGHT_POD = '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-13 1e-13 1e-13"/>'
HEAVY_POD = '<inertial pos="0 0 0" mass="0.02" diaginertia="2e-5 2e-5 2e-5"/>'
BENT_POD = '<inertial pos="0 0 0.001" mass="0.02" diaginertia="2e-5 2e-5 2e-5"/>'
ASIDE = 'pos="0.003 0.01 0" axisangle="0 1 0 0.3"'
MASS = {"model_error": {"mass": 1.05, "inertia": [1.05, 1.02, 1.0]}}
SIX = {"simulation": {"timestep": 0.002, "engine": "python", "duration": 0.2}}
FINE = {"simulation": {"timestep": 0.0005}}


@pytest.mark.parametrize(
    "changes",
    [
        (TILTROTOR, TROT, SPINNING, HEAVY),
        (*EVERYTHING, HEAVY),
        (*EVERYTHING, HEAVY_ROTORS, HEAVY),
        (SIX, (HEAVY_POD,), SPINNING, STORM, SLOW, WEAK, MASS),
        (SIX, (HEAVY_POD, ASIDE), FINE, SPINNING, STORM, SLOW, MASS, HEAVY_ROTORS),
    ],
)
def test_the_measurement_is_the_acceleration_that_mujoco_integrates(changes, tmp_path):
    tables = [hexarotor(tmp_path, *this) if isinstance(this, tuple) else this for this in changes]
    plant = make_plant(assemble(scenario(*tables, MEASURED)))
    loop, parameters = plant._loop, plant._setup.parameters
    _, wrench = read_actuators(loop)
    acceleration_of = plant_acceleration_of(loop)
    data, largest = plant.data, 0.0
    for _ in range(20):
        plant.advance(3)
        with control_callback(plant.callback):
            mujoco.mj_forward(plant.model, data)
        state, ctrl = (data.qpos.tolist(), data.qvel.tolist()), data.ctrl.tolist()
        measured = acceleration_of(*state, ctrl, wrench(ctrl), parameters.layer)[3:]
        np.testing.assert_allclose(measured, data.qacc[3:6], rtol=1e-9, atol=1e-9)
        largest = max(largest, *np.abs(measured))
    assert largest > 5.0


def test_the_measurement_is_the_acceleration_that_the_equations_integrate():
    desired = scenario(*EVERYTHING, MEASURED, THESIS)
    assembly = assemble(desired)
    plant, loop = make_plant(assembly), assembly.loop
    plant.advance(60)
    end = 1 + len(initial_state(assembly))
    state, setup = plant.state[1:end], as_arrays(assembly.setup)
    inputs = loop.equations.inputs(plant.time, state, setup.parameters, setup.knots)
    rates = loop.equations.rates(
        plant.time, state, inputs, setup.parameters, setup.knots, (0.0,) * 3
    )
    body, (layer, inner) = actuator_plant(loop), setup.parameters.inner[1:]
    qpos, qvel, act = body.qpos(state), body.qvel(state), state[body.motion :]
    unmeasured = loop.within.within
    ctrl = unmeasured.controls(
        plant.time, qpos, np.hstack([qvel, np.zeros(3)]), act, inner, setup.knots
    )
    loads = read_actuators(unmeasured)[1](ctrl)
    seen = plant_acceleration_of(loop)(qpos, qvel, ctrl, loads, layer)[3:]
    np.testing.assert_allclose(seen, rates[15:18], rtol=1e-12)


def test_on_the_ideal_thesis_plant_it_is_the_model_s():
    assert loop_of(scenario(TILTROTOR, MEASURED, THESIS)) is LOOPS["attitude_altitude"]


@pytest.mark.parametrize("changes", [(), (FEEDFORWARD,)], ids=["published", "feedforward"])
def test_a_right_model_without_gyroscopic_torque_is_as_good_as_a_measurement(changes):
    """A layer that does nothing makes even the thesis plant measure."""
    never = {"fault": [{"type": "rotor_loss", "rotor": 1, "time": 1e6}]}
    desired = (TILTROTOR, TROT, SPINNING, THESIS, *changes, never)
    known, measured = (tiltsim.simulate(scenario(*desired, setting)) for setting in ({}, MEASURED))
    assert loop_of(measured.scenario) is not loop_of(known.scenario)
    np.testing.assert_allclose(known.samples, measured.samples, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_the_measured_law_flies_equally_three_ways():
    """Inside every other layer, and on the equations: `tests/simulation/test_batch.py`."""
    engine = {"simulation": {"engine": "native", "duration": 0.2}}
    flights = [
        (TILTROTOR, TROT, SPINNING, MEASURED),
        (TILTROTOR, TROT, STORM, FEEDFORWARD, MEASURED),
    ]
    rows = three_ways([scenario(*flight, engine) for flight in flights])
    assert {row.end.kind for row in rows} == {"completed"}


@pytest.mark.parametrize(
    "changes", [{"ground": {}}, {"vehicle": {"mjcf": FILE}}, {"vehicle": {"rotor_inertia": 1e-5}}]
)
def test_unsupported_uses_of_the_measurement_are_refused(changes):
    (table,) = changes
    with pytest.raises(InputError, match=f'{table}.*not supported with .* = "measured"'):
        scenario(TILTROTOR, MEASURED, changes)


def test_pods_out_of_balance_are_refused_in_mujoco(tmp_path):
    tables = hexarotor(tmp_path, BENT_POD)
    with pytest.raises(InputError, match="whose mass or inertia moves with its pods"):
        scenario(SIX, tables, MEASURED)
    scenario(SIX, hexarotor(tmp_path, HEAVY_POD), MEASURED)


# --- the reaction of the rotors, fed back ------------------------------------------------------

LAG = 0.02  # s
LAGGING = {
    "simulation": {"duration": 0.2, "timestep": 0.001, "engine": "python"},
    "vehicle": {"rotor_time_constant": LAG, "rotor_inertia": 1e-4},
    "controller": {"angular_acceleration": "measured", "decoupler": "conventional"},
    "gait": {"type": "fixed", "angles": [0.0, 0.0, 0.0, 0.0]},
    "initial": {"rotor_speed": 361.0, "attitude": [0.01, 0.02, 0.03]},
}
EXACT = {"controller": {"decoupling": "exact", "gains": "exact"}}
UNSTABLE = {"controller": {"allow_unstable": True}}
HELD = {"simulation": {"control_timestep": 0.002}}
LATER = {"simulation": {"control_timestep": 0.002, "control_latency": 0.004}}
EULER = {"simulation": {"integrator": "Euler"}}
WALK = {"gait": {"type": "walk", "amplitude": 0.4, "period": 2.0}}
TWISTED = {"gait": {"type": "fixed", "angles": [0.65, -0.65, 0.65, -0.65]}}


def poles_of_hover(desired):
    """Poles of the closed loop in MuJoCo, linearized numerically about a level hover."""
    plant = make_plant(assemble(desired))
    model, data = plant.model, plant.data
    vehicle = desired.vehicle.resolve()
    angles = desired.gait.plan(vehicle).angles(0.0).tolist()
    if desired.vehicle.model == "multirotor":
        signed = hover_speeds(vehicle, angles, (-np.inf, np.inf))
    else:
        signed = np.multiply(SPIN, hover_rotor_speeds((*angles,), vehicle))
    data.qpos[3:7], data.qvel[:] = (1.0, 0.0, 0.0, 0.0), 0.0
    rotors = len(signed)
    data.act[:rotors] = data.act[-rotors:] = signed  # speeds, and their commands
    hover, n = np.concatenate([data.qvel, data.qvel, data.act]), model.nv
    pose = data.qpos.copy()

    def rates(state):
        data.qpos[:], data.qvel[:], data.act[:] = pose, state[n : 2 * n], state[2 * n :]
        mujoco.mj_integratePos(model, data.qpos, state[:n], 1.0)
        with control_callback(plant.callback):
            mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot])

    steps = 1e-5 * np.eye(len(hover))
    return np.linalg.eigvals([(rates(hover + h) - rates(hover - h)) / 2e-5 for h in steps])


def gains_of_reaction(desired):
    return _reaction_gains(desired, desired.controller)[0]


@pytest.mark.parametrize("form", [{}, EXACT], ids=["published", "exact"])
def test_untilted_it_makes_a_fourth_order_loop_of_yaw(form):
    """``T s^4 + s^3 + (N + K_rot s) (K1 s^2 + K2 s + K3) = 0``, the law's factor N is 2 varpi."""
    desired = scenario(LAGGING, form, UNSTABLE)
    vehicle, gains = desired.vehicle.resolve(), desired.controller.resolve_gains()
    per_torque = 1.0 / vehicle.drag_coefficient
    if form:
        per_torque /= 2.0 * vehicle.hover_rotor_speed
    reaction = desired.vehicle.rotor_inertia * per_torque
    factor = 2.0 * vehicle.hover_rotor_speed * vehicle.drag_coefficient * per_torque
    loop = np.polymul([reaction, factor], gains.loops["yaw"])
    poles = poles_of_hover(desired)
    for expected in np.roots(np.polyadd([LAG, 1.0, 0.0, 0.0, 0.0], loop)):
        assert np.abs(poles - expected).min() < 1e-5 * abs(expected)
    assert gains_of_reaction(desired).max() == pytest.approx(
        gains.attitude_1[2] * reaction, rel=1e-12
    )


@pytest.mark.parametrize("form", [{}, EXACT], ids=["published", "exact"])
@pytest.mark.parametrize("angles", [[-0.65, -0.65, 0.65, 0.65], [0.3, 0.1, 0.0, -0.2]])
def test_the_measurement_moves_the_pole_of_the_lag(form, angles):
    desired = scenario(LAGGING, form, UNSTABLE, gait={"type": "fixed", "angles": angles})
    fastest = -(1.0 + gains_of_reaction(desired).max()) / LAG
    assert poles_of_hover(desired).real.min() == pytest.approx(fastest, rel=0.02)


@pytest.mark.parametrize("norm", ["speed", "thrust"])
def test_the_measurement_moves_the_pole_of_the_lag_of_six_rotors(norm):
    """Canted, they push in all directions; a short lag leaves the law's own poles far behind."""
    law, lag = {"law": "attitude_force", "dimension": 3, "norm": norm}, 5e-4
    file = str(shipped_folder("mjcf") / "cant_hexarotor.xml")
    desired = scenario(
        {"simulation": {**LAGGING["simulation"], "timestep": 1e-4}, "controller": law},
        {"vehicle": {"rotor_time_constant": lag, "rotor_inertia": 3e-3}},
        {"vehicle": {"model": "multirotor", "mjcf": file}},
        MEASURED,
        UNSTABLE,
    )
    moved = -(1.0 + gains_of_reaction(desired).max()) / lag
    assert moved < -30_000.0
    assert poles_of_hover(desired).real.min() == pytest.approx(moved, rel=0.01)


def test_at_some_tilts_it_is_unstable():
    desired = scenario(LAGGING, TWISTED, UNSTABLE)
    unstable = -(1.0 + gains_of_reaction(desired).min()) / LAG
    assert poles_of_hover(desired).real.max() == pytest.approx(unstable, rel=0.02)


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ((), "a pole at 2.069e.04 rad/s, too fast for simulation.timestep = 0.001"),
        ((EXACT, HELD), "too fast for simulation.control_timestep = 0.002"),
        ((EXACT, LATER), "too fast for simulation.control_timestep = 0.002"),
        ((EULER,), "too fast for simulation.timestep = 0.001"),
        ((THESIS,), "too fast for simulation.timestep = 0.001"),
        ((WALK,), "instability at any time step, at tilt angles of the gait"),
        ((TWISTED,), "instability at any time step"),
    ],
)
def test_rotors_too_heavy_for_the_step_are_refused(changes, cause):
    with pytest.raises(InputError, match=cause) as caught:
        scenario(LAGGING, *changes)
    line = str(caught.value)
    assert "\n" not in line
    largest = float(re.search("at most (.*) kg m\\^2", line)[1])
    scenario(LAGGING, *changes, vehicle={"rotor_inertia": 0.995 * largest})
    with pytest.raises(InputError, match=r"vehicle\.rotor_inertia"):
        scenario(LAGGING, *changes, vehicle={"rotor_inertia": 1.01 * largest})


@pytest.mark.parametrize(
    "changes", [(), (HELD,), pytest.param((EXACT, LATER), marks=pytest.mark.slow)]
)
def test_the_largest_inertia_is_the_one_that_flies(changes):
    """RK4 is stable up to 2.78, the check allows 2.6; held values are exact."""
    with pytest.raises(InputError) as caught:
        scenario(LAGGING, *changes)
    largest = float(re.search("at most (.*) kg", str(caught.value))[1])
    for inertia, flies in ((0.97 * largest, True), (1.1 * largest, False)):
        heavy = {"rotor_inertia": inertia}
        flight = tiltsim.simulate(scenario(LAGGING, *changes, UNSTABLE, vehicle=heavy))
        swings = np.abs(np.diff(flight["rotor_speed_1"], 2))[-3:]
        assert (swings.max() < 5.0) == flies


def test_a_lag_too_short_for_the_integrator_is_refused():
    for changes, shortest in (
        ((), 0.001 / 2.6),
        ((THESIS,), 0.001 / 2.45),
        ((EULER,), 0.001 / 1.9),
    ):
        lag = {"rotor_time_constant": 1.01 * shortest, "rotor_inertia": 0.0}
        scenario(LAGGING, *changes, vehicle=lag)
        lag["rotor_time_constant"] = 0.99 * shortest
        with pytest.raises(InputError, match=r"simulation\.timestep = 0\.001.*too long for"):
            scenario(LAGGING, *changes, vehicle=lag)
