"""Full pose of any multirotor: the tiltrotor's is a case, and what is asked of the body happens."""

from __future__ import annotations

import numpy as np
import pytest

from tests.controllers.multirotors import FOUR, HEXAROTOR, Vehicle, random_states, ring, tiltrotor
from tiltsim_controllers.laws import full_pose
from tiltsim_controllers.laws.full_pose import Failure, Limits, desired_jerks
from tiltsim_controllers.laws.multirotor_full_pose import Parameters, full_pose_law_of, pose_rank
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.references.trajectories import CIRCLE, ReferenceParameters
from tiltsim_controllers.vehicle.effectiveness import (
    force_and_torque,
    rotor_entries,
    tilt_of_rotor,
    tilts_of,
)

GAINS = full_pose.GAIN_SETS["ch03"]
ON_CIRCLE = ReferenceParameters(
    CIRCLE, x=0.3, y=-0.2, z=0.1, radius=2.0, angular_frequency=0.5, yaw=0.4
)
EVEN = full_pose.force_balanced_tilt_weight(FOUR)
LOST = Failure(2.0, 10.0)
"""Known in a part of the random states, whose times reach 30 s."""


@pytest.mark.parametrize("failure", [Failure(), LOST], ids=["whole", "lost"])
# The published weight's columns differ by 1e5, which multiplies rounding.
@pytest.mark.parametrize(("weight", "bound"), [(EVEN, 1e-12), (1.0, 1e-9)])
def test_the_tiltrotors_law_is_a_case(weight, bound, failure):
    vehicle, limits = tiltrotor(), Limits(5.0, 1.0)
    law = full_pose_law_of(tilt_of_rotor(vehicle.table))
    own = full_pose.Parameters(FOUR, GAINS, ON_CIRCLE, limits, weight, failure)
    general = Parameters(vehicle.body, GAINS, ON_CIRCLE, limits, weight, 0.0, failure)
    for time, state in random_states(100):
        expected = np.array(full_pose.full_pose_inputs(time, state, own))
        found = np.array(law(time, state, general, vehicle.table))
        for part in (slice(4), slice(4, 8)):
            assert np.abs(found - expected)[part].max() <= bound * np.abs(expected[part]).max()


def on_shared_pods():
    """Eight rotors, two with opposite spins on each of four hinges."""
    table = []
    for i in range(8):
        x, y = ((0.2, 0.0), (0.0, 0.2), (-0.2, 0.0), (0.0, -0.2))[i % 4]
        spin = (-1.0) ** (i + i // 4)
        table += rotor_entries(
            (x, y, 0.03 * (i // 4)), (0.0, 0.0, 1.0), 8.5e-6, 1.4e-7, spin,
            tilt=i % 4, hinge=(x, y, 0.0), hinge_axis=(5.0 * x, 5.0 * y, 0.0),
        )  # fmt: skip
    return tuple(table)


@pytest.mark.parametrize("failure", [Failure(), Failure(3.0, 0.0)], ids=["whole", "lost"])
@pytest.mark.parametrize(
    "table", [ring(6, hinged=True), ring(7, 0.44), on_shared_pods()], ids=["arms", "fixed", "pods"]
)
def test_force_and_torque_change_as_desired_with_the_least_inputs(table, failure):
    vehicle, layout = Vehicle(table, HEXAROTOR, 3), tilt_of_rotor(table)
    rotors, tilts = len(layout), tilts_of(layout)
    law = full_pose_law_of(layout)
    parameters = Parameters(vehicle.body, GAINS, ON_CIRCLE, Limits(), 3e5, 0.0, failure)
    works = np.array([rotor + 1.0 != failure.rotor for rotor in range(rotors)], float)
    rng = np.random.default_rng(4)
    for _ in range(3):
        body, angles = 0.3 * rng.normal(size=12), rng.uniform(-0.5, 0.5, tilts)
        speeds = rng.uniform(300.0, 500.0, rotors) * rng.choice((-1.0, 1.0), rotors)
        inputs = np.array(law(1.0, (*body, *angles, *speeds), parameters, table))
        turned, accelerations = inputs[rotors:], inputs[:rotors]

        def wrench(step, angles=angles, speeds=speeds, inputs=(turned, accelerations)):
            v = speeds + step * inputs[1]
            w = works * v * np.abs(v)
            return np.concatenate(
                [part @ w for part in force_and_torque(table, angles + step * inputs[0])]
            )

        step = 1e-4 / max(1.0, np.abs(turned).max(initial=0.0), np.abs(accelerations).max())
        rate = (wrench(step) - wrench(-step)) / (2.0 * step)
        rotation = np.reshape(rotation_from_euler(*body[6:9]), (3, 3))
        force, torque = np.split(wrench(0.0), 2)
        inertia = np.diag((HEXAROTOR.inertia_xx, HEXAROTOR.inertia_yy, HEXAROTOR.inertia_zz))
        present = rotation @ force / HEXAROTOR.mass - (0.0, 0.0, HEXAROTOR.gravity)
        jerk, angular = desired_jerks(
            1.0, tuple(body), tuple(rotation.ravel()),
            (tuple(present), tuple(np.linalg.solve(inertia, torque))), parameters, table,
        )  # fmt: skip
        lift = HEXAROTOR.mass * rotation.T @ jerk - np.cross(body[9:12], force)
        np.testing.assert_allclose(rate[:3], lift, rtol=1e-6, atol=1e-6 * np.abs(lift).max())
        moment = inertia @ angular
        np.testing.assert_allclose(rate[3:], moment, rtol=1e-6, atol=1e-6 * np.abs(moment).max())
        assert (accelerations[works == 0.0] == 0.0).all()

        # Least norm: orthogonal to all directions that leave force and torque alone.
        x = np.concatenate([2.0 * np.abs(speeds) * accelerations, 3e5 * turned])
        w = works * speeds * np.abs(speeds)
        columns = [np.concatenate(force_and_torque(table, angles)) * works]
        for tilt in range(tilts):
            high, low = (
                np.concatenate(force_and_torque(table, angles + h * np.eye(tilts)[tilt])) @ w
                for h in (1e-6, -1e-6)
            )
            columns.append(((high - low) / 2e-6 / 3e5)[:, np.newaxis])
        rows = np.hstack(columns)
        rows /= np.linalg.norm(rows, axis=1, keepdims=True)
        assert np.linalg.norm(x - np.linalg.pinv(rows) @ rows @ x) < 1e-6 * np.linalg.norm(x)


def test_the_rank_counts_rotors_tilts_and_losses():
    arms = ring(6, hinged=True)
    w = np.ones(6) * (-1.0) ** np.arange(1, 7)
    assert pose_rank(ring(6), (), w) == 4
    assert pose_rank(ring(6, 0.44), (), w) == 6
    assert pose_rank(ring(6, 0.44), (), w * (np.arange(6) > 0)) == 5
    assert pose_rank(arms, (0.0,) * 6, w) == 6
    assert pose_rank(arms, (0.0,) * 6, w * (np.arange(6) > 0)) == 6
