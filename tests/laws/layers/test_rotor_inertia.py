"""Rotors with spin inertia, on both plants."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tiltsim.engines.control import control_callback
from tiltsim.errors import InputError
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.plants.command import Command, check_command
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.plants.mujoco_plant import build_model
from tiltsim.resources import shipped_folder
from tiltsim.scenario.loading import merge
from tiltsim.simulation.simulate import make_plant
from tiltsim.vehicles.rotorcraft import Layout
from tiltsim_controllers.vehicle.craft import accelerations_within_limits
from tiltsim_controllers.vehicle.parameters import PRESETS

INERTIA = 2e-5  # kg m^2, of a rotor
TROT = {
    "simulation": {"duration": 0.3, "timestep": 0.001, "engine": "python"},
    "vehicle": {"rotor_inertia": INERTIA},
    "controller": {"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
    "gait": {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0},
    "initial": {"rotor_speed": 361.0, "attitude": [0.05, -0.03, 0.02]},
}
THESIS = {"simulation": {"plant": "thesis"}}
LIMITED = {"vehicle": {"rotor_time_constant": 0.02, "max_rotor_speed": 390.0}}
MOTION = ("x", "y", "z", "roll", "pitch", "yaw")
SPIN = np.array([-1.0, 1.0, -1.0, 1.0])


def scenario(*changes, **more):
    tables = TROT
    for change in (*changes, more):
        tables = merge(tables, change)
    return tiltsim.parse_scenario(tables)


def fly(*changes, **more):
    return tiltsim.simulate(scenario(*changes, **more))


def thrust_axes(tilts):
    """The four thrust axes in body axes, shape (4, 3)."""
    s, c = np.sin(tilts), np.cos(tilts)
    return np.array([[0, -s[0], c[0]], [s[1], 0, c[1]], [0, s[2], c[2]], [-s[3], 0, c[3]]])


def angular_momentum(plant):
    """Angular momentum of body, pods and rotors about the center of mass, world axes, (3,)."""
    model, data = plant.model, plant.data
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    axes = np.array([data.site(f"rotor_{i}").xmat.reshape(3, 3)[:, 2] for i in range(1, 5)])
    return data.body("vehicle").subtree_angmom + INERTIA * data.act[:4] @ axes


def furthest(one, other):
    return max(np.abs(one[name] - other[name]).max() for name in MOTION)


# --- physics -----------------------------------------------------------------------------------


def test_without_inertia_there_is_no_layer():
    for plant in ("mujoco", "thesis"):
        ideal = scenario(vehicle={"rotor_inertia": 0.0}, simulation={"plant": plant})
        assert loop_of(ideal) is LOOPS["attitude_altitude"]


def spinning_model(own, inertia):
    """The vehicle with bodies that really spin on its pods, instead of the layer's torques.

    Pod and rotor together have the inertia of a pod of ``own``, the model with the layer.
    """
    spec = mujoco.MjSpec.from_file(str(shipped_folder("mjcf") / "tiltrotor.xml"))
    for i in range(1, 5):
        pod = spec.body(f"pod_{i}")
        mass, moment = own.body(f"pod_{i}").mass[0], own.body(f"pod_{i}").inertia[0]
        pod.mass, pod.inertia = 0.5 * mass, [moment - inertia / 2.0] * 2 + [moment - inertia]
        rotor = pod.add_body(name=f"spin_{i}")
        rotor.mass, rotor.explicitinertial = 0.5 * mass, True
        rotor.inertia = [inertia / 2.0, inertia / 2.0, inertia]
        rotor.add_joint(name=f"spin_{i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    body = spec.body("vehicle")
    body.mass, body.inertia = own.body("vehicle").mass[0], own.body("vehicle").inertia
    model = spec.compile()
    model.actuator_gainprm[:4], model.actuator_biasprm[:4] = (
        own.actuator_gainprm[:4],
        own.actuator_biasprm[:4],
    )
    return model


def test_accelerations_include_the_spin_of_bodies():
    """MuJoCo's own dynamics of spinning bodies knows nothing of the layer's formulas."""
    rng = np.random.default_rng(4)
    assembly = assemble(scenario(vehicle={"pod": {"mass": 0.01, "inertia": 1e-4}}))
    own = build_model(assembly)
    real = spinning_model(own, INERTIA)
    data, other = mujoco.MjData(own), mujoco.MjData(real)
    spins = [real.joint(f"spin_{i}").dofadr[0] for i in range(1, 5)]
    tilts = [real.joint(f"tilt_{i}").dofadr[0] for i in range(1, 5)]
    same = [*range(6), *tilts]
    setup = assembly.setup
    for _ in range(10):
        data.qpos[:] = rng.normal(0.0, 0.5, own.nq)
        data.qvel[:] = rng.normal(0.0, 2.0, own.nv)
        data.act[:] = SPIN * rng.uniform(200.0, 400.0, 4)
        mujoco.mj_normalizeQuat(own, data.qpos)
        state = data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        data.ctrl[:] = assembly.loop.controls(0.0, *state, setup.parameters, setup.knots)
        mujoco.mj_forward(own, data)

        mujoco.mj_resetData(real, other)
        for i in range(1, 5):
            other.joint(f"tilt_{i}").qpos = data.joint(f"tilt_{i}").qpos
            other.joint(f"spin_{i}").qpos = rng.uniform(0.0, 6.0)
        other.qpos[:7], other.qvel[same], other.qvel[spins] = data.qpos[:7], data.qvel, data.act
        other.act[:], other.ctrl[:8] = data.act, data.ctrl[:8]
        # Motors that give the rotors their rates: linear in the torques about the spins.
        rates = np.empty((5, 4))
        for motor in range(5):
            other.qfrc_applied[:] = 0.0
            if motor:
                other.qfrc_applied[spins[motor - 1]] = 1e-4
            mujoco.mj_forward(real, other)
            rates[motor] = other.qacc[spins]
        torques = np.linalg.solve((rates[1:] - rates[0]).T, data.ctrl[8:12] - rates[0]) * 1e-4
        other.qfrc_applied[spins] = torques
        mujoco.mj_forward(real, other)
        np.testing.assert_allclose(other.qacc[same], data.qacc, rtol=1e-8, atol=1e-7)


@pytest.mark.parametrize("lag", [{}, {"rotor_time_constant": 0.02}], ids=["direct", "lagging"])
def test_angular_momentum_stays(lag):
    """Thrust off, gravity without a lever: body, pods and rotors keep what they have in all."""
    off = [{"type": "rotor_loss", "rotor": rotor, "time": 0.0} for rotor in (1, 2, 3, 4)]
    plant = make_plant(
        assemble(
            scenario(
                vehicle={"pod": {"mass": 0.005, "inertia": 1e-5}} | lag,
                initial={"angular_velocity": [0.8, -0.5, 0.6]},
                fault=off,
            )
        )
    )
    momenta, tilts, speeds = [], [], []
    for _ in range(100):
        momenta.append(angular_momentum(plant))
        tilts.append(plant.data.qpos[7:11].copy())
        speeds.append(plant.data.act[:4].copy())
        plant.advance(1)
    assert np.ptp(tilts, axis=0).min() > 0.1
    assert np.ptp(speeds, axis=0).min() > 10.0
    assert np.linalg.norm(momenta[0]) > 1e-3
    assert np.abs(np.array(momenta) - momenta[0]).max() < 1e-9


def test_a_rotor_at_its_limit_turns_nothing():
    """Demands beyond the limit move no rotor, and so no body."""
    for speed, demand, expected in (
        (390.0, 5.0, 0.0),
        (390.0, -5.0, -5.0),
        (391.0, 5.0, 0.0),
        (389.0, 5.0, 5.0),
        (200.0, -5.0, 0.0),
        (200.0, 5.0, 5.0),
        (201.0, -5.0, -5.0),
    ):
        assert accelerations_within_limits(1.0, speed, demand, 200.0, 390.0) == expected


def test_pods_that_jump_turn_the_body_at_once():
    """On the thesis's equations, by the momentum that the rotors' axes take with them."""
    vehicle, timestep, jump = PRESETS["ar_drone_2"], 1e-5, 500
    gait = {"type": "trot_instant", "amplitude": 0.4, "period": 2.0 * jump * timestep}
    plant = make_plant(assemble(scenario(THESIS, simulation={"timestep": timestep}, gait=gait)))
    plant.advance(jump - 2)
    before = np.array(plant.observe())
    plant.advance(4)
    after = np.array(plant.observe())
    carried = [seen[16:20] @ thrust_axes(seen[12:16]) for seen in (before, after)]
    turned = INERTIA * (carried[0] - carried[1]) / vehicle[1:4]
    assert np.abs(turned[:2]).min() > 2.0
    by_thrusts = 300.0 * 4 * timestep  # rad/s, at most
    np.testing.assert_allclose(after[9:12] - before[9:12], turned, atol=by_thrusts)


@pytest.mark.parametrize("plant", [{}, THESIS], ids=["mujoco", "thesis"])
def test_a_trot_turns_the_body_and_a_fixed_gait_does_not(plant):
    """By the momentum that the pods take with them, before the controller answers at 40 1/s."""
    hover = {
        "simulation": {"duration": 0.004, "record_timestep": 0.001},
        "controller": {"decoupler": "none"},
        "reference": {"type": "attitude_altitude"},
    }
    vehicle, turned = PRESETS["ar_drone_2"], {}
    initial = {"attitude": [0.0, 0.0, 0.0], "rotor_speed": vehicle.hover_rotor_speed}
    trot = {"type": "trot_continuous", "amplitude": 0.4, "period": 0.4}
    for gait in (trot, {"type": "fixed", "angles": [0.0] * 4}):
        with_inertia, without = (
            fly(plant, hover, gait=gait, initial=initial, vehicle={"rotor_inertia": inertia})
            for inertia in (INERTIA, 0.0)
        )
        turned[gait["type"]] = [with_inertia[rate][-1] - without[rate][-1] for rate in "pqr"]
        if gait is trot:
            tilts = np.stack([with_inertia[f"alpha_{i}"] for i in range(1, 5)], axis=-1)
            moved = SPIN @ (thrust_axes(tilts[-1]) - thrust_axes(tilts[0]))
    expected = -INERTIA * vehicle.hover_rotor_speed * moved / vehicle[1:4]
    assert np.abs(expected[:2]).min() > 0.05
    np.testing.assert_allclose(turned["trot_continuous"][:2], expected[:2], rtol=0.1)
    assert np.abs(turned["fixed"]).max() < 1e-9


def test_stiff_servos_approach_pods_that_follow_exactly():
    """The torques by tilt rates and rotor accelerations against the momentum formulation.

    The remainder is the load on the servo: 1.7e-6 at 1e4 rad/s, a fourth at twice the frequency.
    """
    short = {"duration": 0.04, "timestep": 4e-5, "record_timestep": 0.01}
    exact = fly(THESIS, simulation=short)
    stiff = fly(THESIS, simulation=short, vehicle={"tilt_servo": {"natural_frequency": 2e4}})
    assert furthest(exact, stiff) < 5e-7
    assert furthest(exact, fly(THESIS, simulation=short, vehicle={"rotor_inertia": 0.0})) > 1e-3


# --- restarts, commands, refusals --------------------------------------------------------------


def test_a_saved_state_restarts_bit_identically():
    for plant in ("mujoco", "thesis"):
        desired = scenario(simulation={"plant": plant})
        straight, restarted = make_plant(assemble(desired)), make_plant(assemble(desired))
        straight.advance(51)
        saved, seen = straight.state, straight.observe()
        straight.advance(20)
        restarted.state = saved
        assert restarted.observe() == seen
        restarted.advance(20)
        np.testing.assert_array_equal(restarted.state, straight.state)


@pytest.mark.parametrize("model", ["tiltrotor", "quadrotor"])
def test_commanded_speeds_take_their_momentum_from_the_body(model):
    tables = {
        "vehicle": {"model": model, "rotor_inertia": INERTIA},
        "controller": {"law": "python", "function": "unused.py:law"},
        "simulation": {"control_timestep": 0.004},
        "initial": {"angular_velocity": [0.8, -0.5, 0.6], "attitude": [0.3, -0.2, 1.0]},
    }
    if model == "tiltrotor":
        tables["gait"] = TROT["gait"]
    plant = CommandedPlant(assemble(tiltsim.parse_scenario(tables)))
    speeds = Command(rotor_speeds=[310.0, 340.0, 280.0, 420.0])
    before, rates = angular_momentum(plant), plant.data.qvel[3:6].copy()
    command = check_command(speeds, Layout(4, 4 * (model == "tiltrotor")))
    calls = []  # of the callback of a flight in another thread, as it were
    with control_callback(lambda *flight: calls.append(flight)):
        plant.apply(command)
    assert not calls
    assert np.abs(plant.data.qvel[3:6] - rates).max() > 0.5
    np.testing.assert_allclose(angular_momentum(plant), before, atol=1e-16)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (
            {"vehicle": {"model": "quadrotor"}, "controller": {"law": "yaw_position"}},
            "vehicle.rotor_inertia = 2e-05: not supported for the quadrotor",
        ),
        ({"vehicle": {"rotor_inertia": -1e-6}}, "vehicle.rotor_inertia = -1e-06"),
        ({"vehicle": {"rotor_inertia": 1.3e-3}}, "all rotors"),
    ],
)
def test_vehicles_without_such_rotors_are_refused(tables, message):
    tables = merge({"vehicle": {"rotor_inertia": INERTIA}}, tables)
    with pytest.raises(InputError, match=message):
        tiltsim.parse_scenario(tables)


def test_a_users_file_gets_the_same_rotors():
    """Rotors do not turn in a file: it has the inertia with which they tilt, the key adds spin."""
    file = {"mjcf": str(shipped_folder("mjcf") / "tiltrotor.xml")}
    short = {"duration": 0.1}
    own, shipped = fly(simulation=short, vehicle=file), fly(simulation=short)
    assert furthest(own, shipped) < 1e-9
    still = fly(simulation=short, vehicle=file | {"rotor_inertia": 0.0})
    assert furthest(own, still) > 1e-3


def test_the_feedforward_law_knows_the_inertia_on_request():
    fed_forward = {"controller": {"gait_rate_feedforward": True, "gains": "feedforward"}}
    known = {"controller": {"rotor_inertia_feedforward": True}}
    plain, knowing = (fly(THESIS, fed_forward, change) for change in ({}, known))
    assert 1e-6 < furthest(plain, knowing) < 0.2
    light = {"vehicle": {"rotor_inertia": 0.0}}
    plain, knowing = (fly(THESIS, fed_forward, light, change) for change in ({}, known))
    np.testing.assert_array_equal(plain.samples, knowing.samples)
    with pytest.raises(InputError, match=r"rotor_inertia_feedforward.*needs controller.gait_rate"):
        scenario(known)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gait", "stiff", "errors"),
    [
        ("continuous", True, (0.152, 0.129)),
        ("continuous", False, (0.145, 0.112)),
        ("instant", False, (0.219, 0.148)),
    ],
)
def test_gyroscopic_torque_of_spinning_rotors_deflects_their_pods(gait, stiff, errors):
    """Errors of ch. 4's circle, which an independent model also found; softer servos give way."""
    servo = {"vehicle.tilt_servo.natural_frequency": 3000.0, "simulation.timestep": 4e-4}
    found = []
    for inertia in (6e-6, 2.03e-5):
        changes = {"vehicle.rotor_inertia": inertia, **(servo if stiff else {})}
        circle = tiltsim.load_scenario(f"ch04_tracking/circle#{gait}_t1_modified", changes)
        found.append(tiltsim.simulate(circle).metrics()["sup_position_error_after_20s"])
    assert found == pytest.approx(errors, abs=1.2e-3)
