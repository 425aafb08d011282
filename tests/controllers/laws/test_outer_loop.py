"""The outer loop of laws that demand a wrench or thrusts, the inner ones of `pid` and `indi`."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from tests.controllers.vehicle.test_body import BODY, INERTIA
from tiltsim.arrays.jax_programs import InJax
from tiltsim_controllers.laws.geometric import Geometric, moment
from tiltsim_controllers.laws.indi import Indi, indi
from tiltsim_controllers.laws.observed import Desired, Observed
from tiltsim_controllers.laws.outer_loop import (
    demanded_acceleration,
    lift_without_torque,
    pointing_attitude,
    pointing_rates,
    push_along,
    shortened,
)
from tiltsim_controllers.laws.pid import Pid, pid
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix

AXIS = np.array([0.1, -0.2, 0.9])
ROTORS = 5


def observed(seed, states=(), gyroscopic=1.0):
    """A vehicle in any motion and attitude, with any rotors and reference."""
    rng = np.random.default_rng(seed)

    def some(*shape):
        return rng.uniform(-1.0, 1.0, shape)

    force, attitude, none = some(3, ROTORS), some(3), np.zeros(0)
    force[2] = 1.0, 1.1, 0.9, 1.2, 1.0
    return Observed(
        time=0.0, position=some(3), velocity=some(3), attitude=attitude,
        rotation=rotation_matrix(attitude), body_rates=some(3), tilt_angles=none,
        tilt_rates=none, rotor_speeds=none, thrusts=some(ROTORS), states=np.array(states),
        discrete=none,
        reference=Desired(some(3), some(3), some(3), some(3), some(3), none, none), vehicle=BODY,
        inertia=INERTIA, gyroscopic=gyroscopic, force=force, torque=some(3, ROTORS),
        rotors=None, table=(), tilt_commands=none,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_rates_are_derivatives_of_the_attitude_that_points_the_force(seed):
    """By central differences of the attitude as the acceleration follows its jerk."""
    seen, h = observed(seed), 1e-5
    acceleration = seen.reference.velocity  # any

    def attitude(time):
        return pointing_attitude(seen, acceleration + time * seen.reference.jerk, AXIS)

    now = attitude(0.0)
    turning = (attitude(h) - attitude(-h)) / (2.0 * h) @ now.T  # the cross product's matrix
    found = pointing_rates(seen, acceleration, AXIS, now)
    expected = seen.rotation.T @ (turning[2, 1], turning[0, 2], turning[1, 0])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_the_attitude_points_the_axis_along_the_force(seed):
    seen = observed(seed)
    acceleration = seen.reference.acceleration
    force = acceleration + np.array([0.0, 0.0, BODY.gravity])
    desired = pointing_attitude(seen, acceleration, AXIS)
    along = desired @ AXIS
    np.testing.assert_allclose(np.cross(along, force), 0.0, atol=1e-12)
    assert along @ force > 0.0
    yaw = np.arctan2(desired[1, 0], desired[0, 0])
    assert yaw == pytest.approx(seen.reference.attitude[2], abs=1e-12)
    # The present attitude's axis gets its part of the same force.
    present = seen.rotation @ AXIS
    push = BODY.mass * force @ present / np.linalg.norm(AXIS)
    assert push_along(seen, acceleration, AXIS) == pytest.approx(push, rel=1e-12)


@pytest.mark.parametrize("gyroscopic", [0.0, 1.0])
def test_the_geometric_torque_is_eq_16(gyroscopic):
    """Lee et al. (2010), with zero desired angular acceleration."""
    seen, rates = observed(10, gyroscopic=gyroscopic), np.array([0.6, -0.2, 0.4])
    keys = Geometric(law="geometric", attitude_bandwidth=7.0, attitude_damping=0.4)
    mean = np.trace(INERTIA) / 3.0
    stiffness, damping = mean * 7.0**2, 2.0 * 0.4 * mean * 7.0
    omega, turn = seen.body_rates, seen.rotation
    desired = rotation_matrix(np.array([0.3, -0.2, 0.5]))
    skew = 0.5 * (desired.T @ turn - turn.T @ desired)
    error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    expected = -stiffness * error - damping * (omega - rates) - INERTIA @ np.cross(omega, rates)
    expected += gyroscopic * np.cross(omega, INERTIA @ omega)
    np.testing.assert_allclose(moment(seen, keys, desired, rates), expected, rtol=1e-12)


def test_feedback_is_limited_and_the_reference_s_acceleration_added():
    seen = observed(7)
    ref, gains = seen.reference, (3.0, 2.0)
    error = np.subtract(ref.position, seen.position), np.subtract(ref.velocity, seen.velocity)
    feedback = gains[0] * error[0] + gains[1] * error[1]
    length = np.linalg.norm(feedback)
    for limit in (inf, 1.01 * length, 0.5 * length):
        share = min(1.0, limit / length)
        found = demanded_acceleration(seen, *gains, limit)
        np.testing.assert_allclose(found, share * feedback + ref.acceleration, rtol=1e-12)


def made(seen, thrusts, acceleration):
    """The torque of thrusts whose push is right for an acceleration, and the attitude's error."""
    axis = seen.force @ lift_without_torque(seen)
    push = axis @ seen.force @ thrusts / np.linalg.norm(axis)
    assert push == pytest.approx(push_along(seen, acceleration, axis), rel=1e-9)
    desired = pointing_attitude(seen, acceleration, axis)
    return seen.torque @ thrusts, attitude_error(seen.rotation, desired)


@pytest.mark.parametrize("limited", [False, True])
def test_pid_is_a_cascade(limited):
    integral, turned, slow = np.random.default_rng(8).uniform(-1.0, 1.0, (3, 3))
    seen = observed(8, (*integral, *turned, *slow))
    c = Pid(
        law="pid", position_gain=1.1, max_speed=0.5 if limited else 1e9,
        velocity_gains=(2.1, 0.7), max_acceleration=0.4 if limited else 1e9, attitude_gain=6.0,
        rate_gains=(9.0, 3.0, 0.6), derivative_filter=40.0,
    )  # fmt: skip
    command = pid(seen, c)
    ref = seen.reference
    faster = 1.1 * (ref.position - seen.position)
    faster *= min(1.0, c.max_speed / np.linalg.norm(faster))
    speed_error = ref.velocity + faster - seen.velocity
    feedback = 2.1 * speed_error + 0.7 * integral
    share = min(1.0, c.max_acceleration / np.linalg.norm(feedback))
    assert (share < 1.0) == limited
    torque, error = made(seen, command.thrusts, share * feedback + ref.acceleration)
    rate_error = 6.0 * error - seen.body_rates
    filtering = 40.0 * (seen.body_rates - slow)
    turning = 9.0 * rate_error + 3.0 * turned - 0.6 * filtering
    np.testing.assert_allclose(torque, INERTIA @ turning, rtol=1e-9)
    # Limited, the integral of velocity stops.
    integrating = np.zeros(3) if limited else speed_error
    np.testing.assert_allclose(command.rates, np.r_[integrating, rate_error, filtering], rtol=1e-12)
    assert command.tilt_angles is None


def test_indi_changes_the_torque_of_the_filtered_thrusts():
    rng = np.random.default_rng(9)
    rates, accelerations = rng.uniform(-1.0, 1.0, (2, 3))
    slow, changing = rng.uniform(-1.0, 1.0, (2, ROTORS))
    seen = observed(9, (*rates, *accelerations, *slow, *changing))
    c = Indi(law="indi", position_bandwidth=1.2, max_acceleration=1e9)
    command = indi(seen, c)
    acceleration = demanded_acceleration(seen, 1.2**2, 2.0 * 1.2, 1e9)
    torque, error = made(seen, command.thrusts, acceleration)
    demanded = c.rate_gain * (c.attitude_gain * error - seen.body_rates)
    expected = seen.torque @ slow + INERTIA @ (demanded - accelerations)
    np.testing.assert_allclose(torque, expected, rtol=1e-9)

    def filter_of(values, states, derivatives):
        pull = c.filter_frequency**2 * (values - states)
        return pull - 2.0 * c.filter_damping * c.filter_frequency * derivatives

    found = (
        filter_of(seen.body_rates, rates, accelerations),
        filter_of(seen.thrusts, slow, changing),
    )
    whole = np.r_[accelerations, found[0], changing, found[1]]
    np.testing.assert_allclose(command.rates, whole, rtol=1e-12)
    assert command.tilt_angles is None


def test_nothing_to_shorten_has_gradients():
    """On arrays, the side that is not selected must not make them NaN."""
    jax = pytest.importorskip("jax")
    run = InJax("float32")(lambda vector: shortened(vector, 1.0))
    jacobian = jax.jit(jax.jacobian(lambda vector: jax.numpy.stack(run(vector))))
    assert np.isfinite(jacobian(jax.numpy.zeros(3))).all()
