"""The table of rotors against MuJoCo, and its equations of motion against four rotors."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from tests.controllers.multirotors import FOUR, random_states, ring, tiltrotor
from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.vehicle.craft import equations_of_motion
from tiltsim_controllers.vehicle.rotors import (
    force_and_torque,
    rotor_entries,
    rotors_in,
    tilt_of_rotor,
    tilts_of,
    without_rotor,
)


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def random_vehicle(rng):
    """MJCF and table of rotors anywhere: fixed, on hinges beside them, two on a pod."""
    bodies, thrusts, table, tilts = [], [], [], 0
    rotors = 0
    while rotors < 4 or rng.random() < 0.7:
        axis = rng.normal(size=3)
        hinge, axis = rng.normal(size=3), axis / np.linalg.norm(axis)
        hinged, sites = rng.random() < 0.7, ""
        for _ in range(rng.integers(1, 3)):
            rotors += 1
            place, push = rng.normal(size=3), rng.normal(size=3)
            push /= np.linalg.norm(push)
            thrust, drag = rng.uniform(1e-6, 1e-5), rng.uniform(1e-8, 1e-6)
            spin = float(rng.choice((-1.0, 1.0)))
            sites += f'<site name="rotor_{rotors}" pos="{numbers(place)}" zaxis="{numbers(push)}"/>'
            gear = numbers((0, 0, thrust, 0, 0, -spin * drag))
            thrusts.append(f'<general site="rotor_{rotors}" gear="{gear}"/>')
            tilt = {"tilt": tilts, "hinge": hinge, "hinge_axis": axis} if hinged else {}
            table += rotor_entries(place, push, thrust, drag, spin, **tilt)
        if hinged:
            tilts += 1
            sites = (
                f'<body><joint pos="{numbers(hinge)}" axis="{numbers(axis)}"/>'
                f'<inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/>{sites}</body>'
            )
        bodies.append(sites)
    return (
        '<mujoco><compiler angle="radian"/><worldbody><body name="vehicle"><freejoint/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{"".join(bodies)}</body>'
        f"</worldbody><actuator>{''.join(thrusts)}</actuator></mujoco>"
    ), table


def in_mujoco(model, angles, quaternion):
    """F and tau, shape (6, N), of unit inputs: force in body axes, torque about its origin."""
    data = mujoco.MjData(model)
    data.qpos[:] = (0.3, -0.2, 1.0, *quaternion, *angles)
    columns = []
    for actuator in range(model.nu):
        # A unit of w turns the rotor forward: along its axis or, against its spin, the other way.
        data.ctrl[:] = 0.0
        data.ctrl[actuator] = -1.0 if model.actuator_gear[actuator, 5] > 0.0 else 1.0
        mujoco.mj_forward(model, data)
        rotation = data.body("vehicle").xmat.reshape(3, 3)
        pushed = data.qfrc_actuator[:6]
        columns.append((*rotation.T @ pushed[:3], *pushed[3:]))
    return np.transpose(columns)


@pytest.mark.parametrize("seed", range(10))
def test_effectiveness_is_what_mujoco_makes_of_unit_thrusts(seed):
    rng = np.random.default_rng(seed)
    text, table = random_vehicle(rng)
    model = mujoco.MjModel.from_xml_string(text)
    angles, quaternion = rng.uniform(-3.0, 3.0, tilts_of(tilt_of_rotor(table))), rng.normal(size=4)
    found = np.vstack(force_and_torque(table, tuple(angles)))
    expected = in_mujoco(model, angles, quaternion)
    assert np.abs(found - expected).max() < 1e-14 * np.abs(expected).max()


def test_equations_of_motion_agree_with_chapter_3_for_its_tiltrotor():
    vehicle = tiltrotor()
    rotors = rotors_in(np.array(vehicle.table), 0, tilt_of_rotor(vehicle.table))
    inertia = (FOUR.inertia_xx, FOUR.inertia_yy, FOUR.inertia_zz)
    inputs, gust = np.array([1.0, -2.0, 3.0, -4.0]), np.array([0.1, 0.2, -0.3])
    for _, (*body, a1, a2, a3, a4, s1, s2, s3, s4) in random_states(50):
        tilts, speeds = np.array([a1, a2, a3, a4]), np.array([s1, s2, s3, s4])
        rotation, (p, q, r) = rotation_matrix(body[6:9]), body[9:]
        state = np.array([*body[:6], *rotation.ravel(), p, q, r, *speeds])
        found = equations_of_motion(state, tilts, inputs, vehicle.body, rotors, gust, 0.0)
        w = speeds * np.abs(speeds)
        acceleration = rotation @ force_matrix(FOUR, tilts) @ w / FOUR.mass + gust
        turning = rotation @ [[0.0, -r, q], [r, 0.0, -p], [-q, p, 0.0]]
        expected = [
            *body[3:6], *acceleration - (0.0, 0.0, FOUR.gravity), *turning.ravel(),
            *torque_matrix(FOUR, tilts) @ w / inertia, *inputs,
        ]  # fmt: skip
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("lost", [1, 3, 6])
def test_a_failed_rotor_makes_no_force_or_torque_and_leaves_the_others_unchanged(lost):
    table, tilts = ring(6, 0.2, hinged=True), (0.1, -0.2, 0.3, -0.4, 0.5, -0.6)
    whole = np.vstack(force_and_torque(table, tilts))
    whole[:, lost - 1] = 0.0
    without = without_rotor(table, lost)
    np.testing.assert_array_equal(np.vstack(force_and_torque(without, tilts)), whole)
    assert tilt_of_rotor(without) == tilt_of_rotor(table)
