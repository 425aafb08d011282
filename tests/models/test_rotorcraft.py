"""The compiled models against the thesis's equations and closed forms of mechanics."""

from __future__ import annotations

from functools import lru_cache, partial
from math import cos, inf, sin

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tests.thesis import force_matrix, torque_matrix
from tiltsim.errors import InputError
from tiltsim.models.parts import Pod, RotorLimits, TiltServo
from tiltsim.models.rotorcraft import RotorcraftSpec, _compose, compile_model
from tiltsim.resources import shipped_folder
from tiltsim.scenario.loading import parse_scenario
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, Vehicle

AR_DRONE = PRESETS["ar_drone_2"]
LUUKKONEN = PRESETS["luukkonen"]
BIG = Vehicle(
    mass=6.3,
    inertia_xx=0.11,
    inertia_yy=0.07,
    inertia_zz=0.16,
    arm_length=0.62,
    thrust_coefficient=2.1e-4,
    drag_coefficient=5.3e-6,
    gravity=3.7,
)
BUILDS = [
    (AR_DRONE, Pod()),
    (AR_DRONE, Pod(mass=0.012, inertia=2e-5)),
    (LUUKKONEN, Pod()),
    (LUUKKONEN, Pod(mass=0.03, inertia=8e-5)),
    (BIG, Pod(mass=0.03, inertia=5e-4)),
]
MJCF_FILES = sorted(shipped_folder("mjcf").glob("*.xml"))

tilt_angles = st.tuples(*[st.floats(-np.pi, np.pi)] * 4).map(np.array)
attitudes = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)


def compile_of(*parameters, visuals=True, **options):
    return compile_model(RotorcraftSpec(*parameters, **options), visuals=visuals)


compiled = lru_cache(compile_of)  # shared by the tests, which must not change it


def placed(model, *, alpha=(0.0, 0.0, 0.0, 0.0), attitude=(1.0, 0.0, 0.0, 0.0)):
    """Data of a tiltrotor at rest with these tilt angles, its servos relaxed."""
    data = mujoco.MjData(model)
    data.qpos[3:7] = attitude
    data.qpos[7:11] = alpha
    data.ctrl[:4] = alpha
    mujoco.mj_forward(model, data)
    return data


def body_rotation(data):
    return data.body("vehicle").xmat.reshape(3, 3)


@pytest.mark.parametrize("path", MJCF_FILES, ids=lambda path: path.stem)
def test_file_is_complete_and_runs_with_control_noise(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    trim = data.ctrl.copy()
    noise = np.random.default_rng(0)
    while data.time < 1.0:
        data.ctrl = trim * noise.normal(1.0, 0.1, model.nu) + noise.normal(0.0, 0.1, model.nu)
        mujoco.mj_step(model, data)
    assert not any(warning.number for warning in data.warning)
    assert np.isfinite(data.qpos).all()
    assert np.isfinite(data.sensordata).all()


def test_files_are_there():
    assert {"scene", "tiltrotor", "quadrotor"} <= {path.stem for path in MJCF_FILES}


@pytest.mark.parametrize("path", MJCF_FILES, ids=lambda path: path.stem)
def test_every_element_of_the_file_is_named_and_nothing_collides(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    for kind in ("body", "jnt", "geom", "site", "cam", "light", "actuator", "sensor", "key", "mat"):
        addresses = getattr(model, f"name_{kind}adr")
        unnamed = [i for i, address in enumerate(addresses) if model.names[address] == 0]
        assert not unnamed, f"{kind} {unnamed} of {path.name}"
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()


@pytest.mark.parametrize("name", ["tiltrotor", "quadrotor"])
def test_file_holds_what_compile_model_makes_of_chapter_3(name):
    of_file = mujoco.MjModel.from_xml_path(str(shipped_folder("mjcf") / f"{name}.xml"))
    ours = compiled(name, AR_DRONE)
    for field in (
        *("body_mass", "body_inertia", "body_ipos", "body_pos", "body_quat"),
        *("jnt_axis", "jnt_range", "dof_armature", "dof_damping"),
        *("actuator_gear", "actuator_gainprm", "actuator_biasprm", "actuator_dyntype"),
        *("actuator_actlimited", "actuator_ctrllimited", "key_qpos", "key_act", "key_ctrl"),
        *("geom_pos", "geom_size", "geom_rgba", "site_pos", "cam_pos"),
    ):
        np.testing.assert_allclose(
            getattr(ours, field), getattr(of_file, field), rtol=1e-14, atol=0.0, err_msg=field
        )
    for option in ("timestep", "integrator", "gravity"):
        np.testing.assert_array_equal(getattr(ours.opt, option), getattr(of_file.opt, option))


@pytest.mark.parametrize(("name", "tilts"), [("tiltrotor", 4), ("quadrotor", 0)])
def test_actuators_stand_in_the_promised_order(name, tilts):
    model = compiled(name, LUUKKONEN)
    names = [model.actuator(i).name for i in range(model.nu)]
    expected = [f"{kind}_{i}" for kind in ("tilt", "thrust", "rotor_speed") for i in range(1, 5)]
    assert names == expected[4 - tilts :]
    assert (model.nq, model.na) == (7 + tilts, 4)


# -------------------------------------------------------------------------- mass and inertia


@pytest.mark.parametrize(("vehicle", "pod"), BUILDS)
@given(alpha=tilt_angles, attitude=attitudes)
@settings(max_examples=15, deadline=None)
def test_mass_and_inertia_are_the_vehicles_at_any_tilt(vehicle, pod, alpha, attitude):
    model = compiled("tiltrotor", vehicle, pod=pod)
    data = placed(model, alpha=alpha, attitude=attitude)
    mass = model.body_mass.sum()
    centre = model.body_mass @ data.xipos / mass
    inertia = np.zeros((3, 3))
    for body in range(model.nbody):
        axes = data.ximat[body].reshape(3, 3)
        arm = data.xipos[body] - centre
        inertia += axes @ np.diag(model.body_inertia[body]) @ axes.T
        inertia += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    in_body_axes = body_rotation(data).T @ inertia @ body_rotation(data)
    assert mass == pytest.approx(vehicle.mass, rel=1e-12)
    assert np.abs(centre - data.body("vehicle").xpos).max() < 1e-15
    expected = np.diag(vehicle[1:4])
    assert np.abs(in_body_axes - expected).max() < 1e-12 * expected.max()


def test_quadrotor_has_the_vehicles_mass_and_inertia():
    model = compiled("quadrotor", LUUKKONEN)
    assert model.body_mass.sum() == LUUKKONEN.mass
    np.testing.assert_array_equal(model.body("vehicle").inertia, LUUKKONEN[1:4])


def test_too_heavy_pods_are_refused_with_the_numbers():
    with pytest.raises(ValueError, match=r"vehicle.mass = 0.429.*mass=0.11"):
        compile_of("tiltrotor", AR_DRONE, pod=Pod(mass=0.11))
    with pytest.raises(ValueError, match=r"0.00224.*inertia=0.0006"):
        compile_of("tiltrotor", AR_DRONE, pod=Pod(inertia=6e-4))


# ------------------------------------------------------------------------ forces and torques


@pytest.mark.parametrize(("vehicle", "pod"), BUILDS)
@given(alpha=tilt_angles, attitude=attitudes)
@settings(max_examples=15, deadline=None)
def test_rotors_make_the_force_and_torque_of_chapter_3(vehicle, pod, alpha, attitude):
    model = compiled("tiltrotor", vehicle, pod=pod)
    data = placed(model, alpha=alpha, attitude=attitude)
    force, torque = np.zeros((3, 4)), np.zeros((3, 4))
    for i, spin in enumerate(SPIN):
        data.ctrl[4:8] = 0.0
        data.ctrl[4 + i] = spin  # w_i = varpi_i |varpi_i| = 1
        mujoco.mj_forward(model, data)
        force[:, i] = body_rotation(data).T @ data.qfrc_actuator[:3]
        torque[:, i] = data.qfrc_actuator[3:6]
    thrust = vehicle.thrust_coefficient
    assert np.abs(force - force_matrix(vehicle, alpha)).max() < 1e-12 * thrust
    moment = vehicle.arm_length * thrust
    assert np.abs(torque - torque_matrix(vehicle, alpha)).max() < 1e-12 * moment
    # The thrust axis meets the hinge at a right angle: neither thrust nor drag moves the servo.
    assert np.abs(data.qfrc_actuator[6:]).max() < 1e-12 * moment


def test_quadrotor_makes_the_force_and_torque_of_an_untilted_tiltrotor():
    model = compiled("quadrotor", LUUKKONEN)
    data = mujoco.MjData(model)
    w = np.array([-1.0, 2.0, -3.0, 4.0])
    data.ctrl[:4] = SPIN * w
    mujoco.mj_forward(model, data)
    matrices = (force_matrix, torque_matrix)
    wrench = np.concatenate([matrix(LUUKKONEN, np.zeros(4)) @ w for matrix in matrices])
    np.testing.assert_allclose(data.qfrc_actuator, wrench, rtol=1e-14, atol=1e-20)


# ------------------------------------------------------------------------------------ motion


def test_free_fall_is_a_parabola_however_it_tumbles():
    model = compiled("tiltrotor", AR_DRONE)
    data = mujoco.MjData(model)
    velocity = np.array([1.0, -2.0, 3.0])
    data.qvel[:6] = [*velocity, 0.3, -0.2, 0.5]
    mujoco.mj_step(model, data, 1000)
    gravity = np.array([0.0, 0.0, -AR_DRONE.gravity])
    t = data.time
    np.testing.assert_allclose(data.qpos[:3], velocity * t + 0.5 * gravity * t**2, atol=1e-12)
    np.testing.assert_allclose(data.qvel[:3], velocity + gravity * t, atol=1e-12)


@pytest.mark.parametrize("name", ["tiltrotor", "quadrotor"])
@pytest.mark.parametrize("vehicle", [AR_DRONE, LUUKKONEN, BIG])
def test_hover_keyframe_is_an_equilibrium(name, vehicle):
    model = compiled(name, vehicle)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    mujoco.mj_forward(model, data)
    assert np.abs(data.qacc).max() < 1e-12
    np.testing.assert_allclose(data.ctrl[-8:-4], data.act**2, rtol=1e-15)
    np.testing.assert_array_equal(np.sign(data.act), SPIN)
    np.testing.assert_allclose(
        data.sensor("accelerometer").data, [0.0, 0.0, vehicle.gravity], atol=1e-12
    )
    mujoco.mj_step(model, data, 1000)
    assert np.abs(data.qpos - model.key("hover").qpos).max() < 1e-12


def test_start_keyframe_has_the_rotors_at_300():
    key = compiled("tiltrotor", LUUKKONEN).key("start")
    np.testing.assert_array_equal(key.act, [-300.0, 300.0, -300.0, 300.0])
    np.testing.assert_array_equal(key.ctrl, [0] * 4 + [9e4] * 4 + [0] * 4)


def test_torque_free_rotation_follows_euler_and_keeps_energy_and_momentum():
    model = compiled("tiltrotor", AR_DRONE)
    data = mujoco.MjData(model)
    inertia = np.array(AR_DRONE[1:4])
    rate = np.array([0.1, 6.0, -0.2])  # near the unstable middle axis
    data.qvel[3:6] = rate
    energy, momentum = inertia @ rate**2, inertia * rate
    mujoco.mj_step(model, data, 5000)
    mujoco.mj_forward(model, data)

    def euler(_, w):
        return np.cross(inertia * w, w) / inertia

    solution = solve_ivp(euler, (0, data.time), rate, "DOP853", rtol=1e-13, atol=1e-13)
    end = data.qvel[3:6]
    assert np.abs(solution.y[0]).max() > 3.0, "the body is to tumble over"
    np.testing.assert_allclose(end, solution.y[:, -1], atol=1e-9)
    assert inertia @ end**2 == pytest.approx(energy, rel=1e-10)
    np.testing.assert_allclose(
        body_rotation(data) @ (inertia * end), momentum, atol=1e-10 * np.linalg.norm(momentum)
    )


# ---------------------------------------------------------------------- servos, pods, limits


@pytest.mark.parametrize(("axis", "pods"), [(0, (1, 3)), (1, (2, 4))])
def test_tilting_pod_turns_the_body_as_angular_momentum_demands(axis, pods):
    pod = Pod(mass=0.01, inertia=5e-5)
    model = compiled("tiltrotor", AR_DRONE, pod=pod)
    for tilted in pods:
        data = mujoco.MjData(model)
        data.ctrl[tilted - 1] = 1.0
        for _ in range(40):
            mujoco.mj_step(model, data)
            turned = 2.0 * np.arctan2(data.qpos[4 + axis], data.qpos[3])
            # The opposite pod, whose axis points the other way, is held but not rigidly.
            outward, inward = (data.qpos[6 + i] for i in pods)
            expected = -pod.inertia / AR_DRONE[1 + axis] * (outward - inward)
            assert turned == pytest.approx(expected, abs=1e-12)
        assert data.qpos[6 + tilted] == pytest.approx(1.0, abs=1e-3)
        assert abs(turned) > 0.01


def test_default_pods_turn_the_body_by_next_to_nothing():
    model = compiled("tiltrotor", AR_DRONE)
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    mujoco.mj_step(model, data, 100)
    assert data.qpos[7] == pytest.approx(1.0, abs=1e-9)
    assert 0.0 < abs(2.0 * data.qpos[4]) < 5e-11  # rad


@pytest.mark.parametrize(
    ("servo", "pod"),
    [
        (TiltServo(), Pod()),
        (TiltServo(natural_frequency=60.0, damping_ratio=0.4), Pod()),
        (TiltServo(natural_frequency=60.0, damping_ratio=0.4), Pod(mass=0.01, inertia=5e-5)),
    ],
)
def test_servo_step_response_is_the_second_order_closed_form(servo, pod):
    model = compiled("tiltrotor", AR_DRONE, timestep=2e-5, tilt_servo=servo, pod=pod)
    data = mujoco.MjData(model)
    step = 0.7
    data.ctrl[:4] = [step, 0.0, -step, 0.0]
    # Both pods turn the same way about x, and the body gives way to their reaction.
    held = pod.inertia + 1e-6
    free = held - 2.0 * pod.inertia**2 / AR_DRONE.inertia_xx
    w = servo.natural_frequency * (held / free) ** 0.5
    zeta = servo.damping_ratio * (held / free) ** 0.5
    for _ in range(10):
        mujoco.mj_step(model, data, 200)
        t = data.time
        if servo.damping_ratio == 1.0:  # the default pods leave it so to 1e-9
            response = 1.0 - (1.0 + w * t) * np.exp(-w * t)
        else:
            wd = w * (1.0 - zeta**2) ** 0.5
            response = 1.0 - np.exp(-zeta * w * t) * (cos(wd * t) + zeta * w / wd * sin(wd * t))
        np.testing.assert_allclose(
            data.qpos[[7, 9]], [step * response, -step * response], atol=1e-9
        )


def test_servo_stops_at_its_largest_angle():
    model = compiled("tiltrotor", AR_DRONE, tilt_servo=TiltServo(max_angle=0.5))
    data = mujoco.MjData(model)
    data.ctrl[:4] = [2.0, -2.0, 0.3, -0.3]
    mujoco.mj_step(model, data, 200)
    np.testing.assert_allclose(data.qpos[7:], [0.5, -0.5, 0.3, -0.3], atol=1e-9)


def test_pod_thrown_at_its_stop_goes_less_far_than_the_servo_alone_would_let_it():
    reached = []
    for max_angle in (0.5, None):
        model = compiled("tiltrotor", AR_DRONE, tilt_servo=TiltServo(max_angle=max_angle))
        data = placed(model, alpha=(0.5, 0.0, 0.0, 0.0))
        data.qvel[6] = speed = 200.0
        angles = []
        for _ in range(100):
            mujoco.mj_step(model, data)
            angles.append(data.qpos[7])
        assert angles[-1] == pytest.approx(0.5, abs=1e-6)
        reached.append(max(angles) - 0.5)
    against_stop, servo_alone = reached
    assert servo_alone == pytest.approx(speed / (300.0 * np.e), rel=1e-2)
    assert against_stop < 0.75 * servo_alone


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicit", "implicitfast"])
def test_rotor_speeds_stay_within_their_limits(integrator):
    limits = RotorLimits(min_speed=100.0, max_speed=400.0)
    model = compiled("tiltrotor", AR_DRONE, integrator=integrator, rotor_limits=limits)
    data = mujoco.MjData(model)
    data.act[:] = np.multiply(SPIN, 300.0)
    for pull, reached in ((1.0, 400.0), (-1.0, 100.0)):
        data.ctrl[8:] = np.multiply(SPIN, pull * 7e3)
        for _ in range(60):
            mujoco.mj_step(model, data)
            assert (np.abs(data.act) <= 400.0).all()
            assert (np.abs(data.act) >= 100.0).all()
        np.testing.assert_array_equal(data.act, np.multiply(SPIN, reached))


@pytest.mark.parametrize(
    ("limits", "counterclockwise", "clockwise"),
    [
        (RotorLimits(), None, None),
        (RotorLimits(min_speed=0.0), (0.0, inf), (-inf, 0.0)),
        (RotorLimits(max_speed=400.0), (-400.0, 400.0), (-400.0, 400.0)),
        (RotorLimits(305.27, 394.10), (305.27, 394.10), (-394.10, -305.27)),
    ],
)
def test_speed_range_has_the_sign_of_the_spin(limits, counterclockwise, clockwise):
    assert limits.speed_range(1.0) == counterclockwise
    assert limits.speed_range(-1.0) == clockwise
    model = compiled("quadrotor", AR_DRONE, rotor_limits=limits)
    assert model.actuator("rotor_speed_1").actlimited[0] == (clockwise is not None)
    if clockwise is not None:
        np.testing.assert_array_equal(model.actuator("rotor_speed_1").actrange, clockwise)
        np.testing.assert_array_equal(model.actuator("rotor_speed_2").actrange, counterclockwise)


@pytest.mark.parametrize(
    ("limits", "controls"),
    [
        (RotorLimits(), None),
        (RotorLimits(min_speed=0.0), (0.0, inf)),
        (RotorLimits(max_speed=400.0), (-16e4, 16e4)),
        (RotorLimits(300.0, 400.0), (9e4, 16e4)),
        (RotorLimits(300.0, 400.0, (0.0, 1.5)), (0.0, 24e4)),
    ],
)
def test_thrust_keeps_to_the_limits_of_the_speed(limits, controls):
    assert limits.thrust_range == controls
    model = compiled("tiltrotor", AR_DRONE, rotor_limits=limits)
    for actuator in map(model.actuator, ("thrust_1", "thrust_2")):
        assert actuator.ctrllimited[0] == (controls is not None)
        if controls is not None:
            np.testing.assert_array_equal(actuator.ctrlrange, controls)


# ----------------------------------------------------------------------------------- options


def test_options_reach_the_model():
    model = compile_of(
        "quadrotor", LUUKKONEN, timestep=4e-3, integrator="implicitfast", userdata_size=27
    )
    assert model.opt.timestep == 4e-3
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.nuserdata == 27
    assert model.opt.gravity[2] == -LUUKKONEN.gravity
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT


def test_visuals_grow_with_the_arms():
    small, large = compiled("tiltrotor", AR_DRONE), compiled("tiltrotor", BIG)
    ratio = BIG.arm_length / AR_DRONE.arm_length
    drawn = small.geom_bodyid > 0
    np.testing.assert_allclose(large.geom_size[drawn], ratio * small.geom_size[drawn], rtol=1e-14)
    np.testing.assert_allclose(large.body("pod_4").pos, [0, -BIG.arm_length, 0], rtol=1e-15)
    np.testing.assert_array_equal(large.geom("ground").pos, small.geom("ground").pos)


def test_flight_without_visuals_is_the_same_flight():
    ends = []
    for visuals in (True, False):
        model = compile_of("tiltrotor", AR_DRONE, visuals=visuals)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        data.ctrl[:4] = [0.3, -0.2, 0.1, 0.4]
        mujoco.mj_step(model, data, 500)
        ends.append((data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()))
    assert ends[0] == ends[1]
    assert (model.ngeom, model.ncam, model.nlight, model.nsensor) == (0, 0, 0, 0)


def test_models_compiled_alike_are_independent():
    first, second = (compile_of("quadrotor", AR_DRONE) for _ in range(2))
    first.opt.gravity = 0.0
    assert second.opt.gravity[2] == -9.8


def test_moments_that_no_body_has_are_refused():
    with pytest.raises(ValueError, match=r"0\.006"):
        compile_of("quadrotor", AR_DRONE._replace(inertia_zz=6e-3))


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"vehicle": {"model": "tricopter"}}, "tricopter.*tiltrotor"),
        ({"vehicle": {"mass": -1.0}}, "mass = -1.0"),
        ({"vehicle": {"arm_length": inf}}, "arm_length = Infinity"),
        ({"simulation": {"integrator": "rk4"}}, "rk4.*choose RK4"),
        ({"simulation": {"timestep": 0.0}}, "timestep = 0.0"),
        ({"vehicle": {"tilt_servo": {"natural_frequency": -3.0}}}, "natural_frequency = -3.0"),
        ({"vehicle": {"tilt_servo": {"damping_ratio": 0.0}}}, "damping_ratio = 0.0"),
        ({"vehicle": {"tilt_servo": {"max_angle": 0.0}}}, "max_angle = 0.0"),
        ({"vehicle": {"pod": {"mass": 0.0}}}, "pod.mass = 0.0"),
        ({"vehicle": {"pod": {"inertia": 1e-16}}}, "pod.inertia = 1e-16"),
        ({"vehicle": {"min_rotor_speed": -5.0}}, "min_rotor_speed = -5.0"),
        ({"vehicle": {"max_rotor_speed": 0.0}}, "max_rotor_speed = 0.0"),
        (
            {"vehicle": {"min_rotor_speed": 400.0, "max_rotor_speed": 300.0}},
            "min_rotor_speed = 400.0.*300.0",
        ),
        ({"ground": {"friction": 0.0}}, "ground.friction = 0.0"),
        ({"ground": {"height": inf}}, "ground.height = Infinity"),
    ],
)
def test_a_scenario_refuses_what_no_model_is_made_of(tables, message):
    with pytest.raises(InputError, match=message):
        parse_scenario(tables)


# --- models made of compiled ones --------------------------------------------------------------


def numbers(model):
    """Every array of a compiled model by name, options included."""
    for part in (model, model.opt):
        for name in dir(part):
            value = getattr(part, name) if not name.startswith("_") else None
            if isinstance(value, np.ndarray | float | int):
                yield name, np.array(value)


@pytest.mark.parametrize("kind", ["tiltrotor", "quadrotor"])
@pytest.mark.parametrize("law_states", [0, 2])
def test_vehicles_that_differ_in_numbers_share_their_composition(kind, law_states):
    vehicle = PRESETS["ar_drone_2"]
    other = vehicle._replace(
        mass=0.47123,
        inertia_xx=2.31e-3,
        inertia_yy=2.8e-3,
        inertia_zz=4.7e-3,
        thrust_coefficient=8.3e-6,
        drag_coefficient=2.5e-7,
        gravity=9.81,
    )
    heavy = Pod(mass=0.01, inertia=1e-6)
    compile_this = partial(compile_of, kind, law_states=law_states, userdata_size=3, pod=heavy)
    _compose.cache_clear()
    alone = dict(numbers(compile_this(other)))
    _compose.cache_clear()
    compile_this(vehicle).body_mass[:] = 1.0  # which changes no later one
    after_another = dict(numbers(compile_this(other)))
    assert _compose.cache_info().misses == 1
    assert after_another.keys() == alone.keys()
    assert len(alone) > 200
    assert not [name for name in alone if not np.array_equal(after_another[name], alone[name])]
    assert alone["body_mass"][1] == other.mass - 4.0 * heavy.mass * (kind == "tiltrotor")
