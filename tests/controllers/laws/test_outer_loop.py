"""The outer loop of laws that demand a wrench or thrusts, the inner ones of `pid` and `indi`."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from tests.controllers.vehicle.test_multirotor import BODY, INERTIA
from tiltsim_controllers.laws.full_pose import attitude_error
from tiltsim_controllers.laws.geometric import Parameters as GeometricParameters
from tiltsim_controllers.laws.geometric import attitude_torque
from tiltsim_controllers.laws.indi import Parameters as IndiParameters
from tiltsim_controllers.laws.indi import filtered, indi_law_of
from tiltsim_controllers.laws.observed import Desired, Observed
from tiltsim_controllers.laws.outer_loop import (
    demanded_acceleration,
    pointing_attitude,
    pointing_rates,
    push_along,
    torque_for,
)
from tiltsim_controllers.laws.pid import Parameters as PidParameters
from tiltsim_controllers.laws.pid import pid_law_of
from tiltsim_controllers.laws.rotor_allocation import planned_allocation_of
from tiltsim_controllers.mathematics.rotation import rotation_from_euler

AXIS = (0.1, -0.2, 0.9)
ROTORS = 5


def observed(seed, states=()):
    """A vehicle in any motion and attitude, with any rotors and reference."""
    rng = np.random.default_rng(seed)

    def some(count):
        return tuple(rng.uniform(-1.0, 1.0, count).tolist())

    rows = [some(ROTORS) for _ in range(5)]
    attitude = some(3)
    return Observed(
        time=0.0, position=some(3), velocity=some(3), attitude=attitude,
        rotation=rotation_from_euler(*attitude), body_rates=some(3), tilt_angles=(),
        tilt_rates=(), rotor_speeds=(), thrusts=some(ROTORS), states=states,
        reference=Desired(some(3), some(3), some(3), some(3), some(3), (), ()), vehicle=BODY,
        force=(rows[0], rows[1], (1.0, 1.1, 0.9, 1.2, 1.0)), torque=tuple(rows[2:]),
        table=(), at=0, own=0,
    )  # fmt: skip


def matrix(rotation):
    return np.reshape(rotation, (3, 3))


@pytest.mark.parametrize("seed", range(5))
def test_rates_are_those_of_the_attitude_that_points_the_force(seed):
    """By central differences of the attitude as the acceleration follows its jerk."""
    seen, h = observed(seed), 1e-5
    acceleration = np.array(seen.reference.velocity)  # any

    def attitude(time):
        moved = acceleration + time * np.array(seen.reference.jerk)
        return matrix(pointing_attitude(seen, tuple(moved), AXIS))

    now = attitude(0.0)
    turning = (attitude(h) - attitude(-h)) / (2.0 * h) @ now.T  # the cross product's matrix
    found = pointing_rates(seen, tuple(acceleration), AXIS, tuple(now.ravel()))
    expected = matrix(seen.rotation).T @ (turning[2, 1], turning[0, 2], turning[1, 0])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_the_attitude_points_the_axis_along_the_force(seed):
    seen = observed(seed)
    acceleration = np.array(seen.reference.acceleration)
    force = acceleration + np.array([0.0, 0.0, BODY.gravity])
    desired = matrix(pointing_attitude(seen, tuple(acceleration), AXIS))
    along = desired @ AXIS
    np.testing.assert_allclose(np.cross(along, force), 0.0, atol=1e-12)
    assert along @ force > 0.0
    yaw = np.arctan2(desired[1, 0], desired[0, 0])
    assert yaw == pytest.approx(seen.reference.attitude[2], abs=1e-12)
    # The present attitude's axis gets its part of the same force.
    present = matrix(seen.rotation) @ AXIS
    push = BODY.mass * force @ present / np.linalg.norm(AXIS)
    assert push_along(seen, tuple(acceleration), AXIS) == pytest.approx(push, rel=1e-12)


@pytest.mark.parametrize("gyroscopic", [0.0, 1.0])
def test_the_torque_turns_the_body(gyroscopic):
    rates, angular = np.array([0.3, -0.4, 0.5]), np.array([2.0, 3.0, -5.0])
    found = torque_for(BODY, tuple(rates), tuple(angular), gyroscopic)
    expected = INERTIA @ angular + gyroscopic * np.cross(rates, INERTIA @ rates)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("gyroscopic", [0.0, 1.0])
def test_the_geometric_torque_is_eq_16(gyroscopic):
    """Lee et al. (2010), with zero desired angular acceleration."""
    seen, rates = observed(10), np.array([0.6, -0.2, 0.4])
    gains = GeometricParameters(0.0, 0.0, 6.0, 0.9, inf, gyroscopic)
    omega = np.array(seen.body_rates)
    turn, desired = matrix(seen.rotation), rotation_from_euler(0.3, -0.2, 0.5)
    skew = 0.5 * (matrix(desired).T @ turn - turn.T @ matrix(desired))
    error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    expected = -6.0 * error - 0.9 * (omega - rates) - INERTIA @ np.cross(omega, rates)
    expected += gyroscopic * np.cross(omega, INERTIA @ omega)
    found = attitude_torque(seen, desired, tuple(rates.tolist()), gains)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


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
    functions = planned_allocation_of(ROTORS)
    axis = functions.axis(seen, functions.lift(seen))
    push = np.array(axis) @ np.array(seen.force) @ thrusts / np.linalg.norm(axis)
    assert push == pytest.approx(push_along(seen, tuple(acceleration), axis), rel=1e-9)
    desired = pointing_attitude(seen, tuple(acceleration), axis)
    return np.array(seen.torque) @ thrusts, np.array(attitude_error(seen.rotation, desired))


@pytest.mark.parametrize("limited", [False, True])
def test_pid_is_a_cascade(limited):
    integral, turned, slow = np.random.default_rng(8).uniform(-1.0, 1.0, (3, 3))
    seen = observed(8, (*integral, *turned, *slow))
    c = PidParameters(
        position=1.1, max_speed=0.5 if limited else inf, velocity=2.1, velocity_integral=0.7,
        max_acceleration=0.4 if limited else inf, attitude=6.0, rates=9.0, rates_integral=3.0,
        rates_derivative=0.6, derivative_filter=40.0,
    )  # fmt: skip
    thrusts, tilts, rates = pid_law_of(ROTORS)(seen, c)
    ref = seen.reference
    faster = c.position * np.subtract(ref.position, seen.position)
    faster *= min(1.0, c.max_speed / np.linalg.norm(faster))
    speed_error = ref.velocity + faster - seen.velocity
    feedback = c.velocity * speed_error + c.velocity_integral * integral
    share = min(1.0, c.max_acceleration / np.linalg.norm(feedback))
    assert (share < 1.0) == limited
    torque, error = made(seen, thrusts, share * feedback + ref.acceleration)
    rate_error = c.attitude * error - seen.body_rates
    filtering = c.derivative_filter * (np.array(seen.body_rates) - slow)
    turning = c.rates * rate_error + c.rates_integral * turned - c.rates_derivative * filtering
    np.testing.assert_allclose(torque, INERTIA @ turning, rtol=1e-9)
    # Limited, the integral of velocity stops.
    integrating = np.zeros(3) if limited else speed_error
    np.testing.assert_allclose(rates, np.r_[integrating, rate_error, filtering], rtol=1e-12)
    assert tilts == ()


def test_indi_changes_the_torque_of_the_filtered_thrusts():
    rng = np.random.default_rng(9)
    rates, accelerations = rng.uniform(-1.0, 1.0, (2, 3))
    slow, changing = rng.uniform(-1.0, 1.0, (2, ROTORS))
    seen = observed(9, (*rates, *accelerations, *slow, *changing))
    c = IndiParameters(1.2, 2.2, inf, 7.0, 11.0, filter_frequency=50.0, filter_damping=0.55)
    thrusts, tilts, derivatives = indi_law_of(ROTORS)(seen, c)
    acceleration = demanded_acceleration(seen, c.position, c.velocity, inf)
    torque, error = made(seen, thrusts, acceleration)
    demanded = c.rates * (c.attitude * error - seen.body_rates)
    expected = np.array(seen.torque) @ slow + INERTIA @ (demanded - accelerations)
    np.testing.assert_allclose(torque, expected, rtol=1e-9)

    def filter_of(values, states, derivatives):
        pull = c.filter_frequency**2 * (np.array(values) - states)
        return pull - 2.0 * c.filter_damping * c.filter_frequency * derivatives

    found = (
        filter_of(seen.body_rates, rates, accelerations),
        filter_of(seen.thrusts, slow, changing),
    )
    whole = np.r_[accelerations, found[0], changing, found[1]]
    np.testing.assert_allclose(derivatives, whole, rtol=1e-12)
    assert filtered(1.0, 1.0, 1.0, 2.0, 0.5) == -2.0
    assert tilts == ()
