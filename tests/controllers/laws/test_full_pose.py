"""Full-pose control: the least-norm solve, linearization, limits, flights of ch. 3, Sec. 6.3."""

from __future__ import annotations

from math import inf, isnan

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.controllers.flights import fly, rk4_step, tiltrotor_rates
from tests.controllers.laws.test_tracking import PATH, TIME, reference
from tests.natively import natively
from tiltsim_controllers.analysis.stability import is_hurwitz
from tiltsim_controllers.gaits.parameters import GAIT_TYPES, GaitParameters
from tiltsim_controllers.laws import attitude_altitude
from tiltsim_controllers.laws.attitude_altitude import rotor_accelerations
from tiltsim_controllers.laws.full_pose import (
    GAIN_SETS,
    PUBLISHED_TILT_WEIGHT,
    Failure,
    Limits,
    Parameters,
    attitude_error,
    desired_jerks,
    force_balanced_tilt_weight,
    full_pose_inputs,
    limited_tilt_rate,
    minimum_norm_inputs,
    pose_rows,
)
from tiltsim_controllers.laws.gains import GAIN_SETS as ATTITUDE_GAINS
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.references.trajectories import (
    REFERENCE_TYPES,
    ReferenceParameters,
    reference_derivatives,
)
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    sines_and_cosines,
    torque_entries,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio

TILTROTOR = PRESETS["ar_drone_2_unrounded"]
GAINS = GAIN_SETS["ch03"]
HERE = ReferenceParameters(REFERENCE_TYPES["setpoint"])
WEIGHTS = {"published": PUBLISHED_TILT_WEIGHT, "even": force_balanced_tilt_weight(TILTROTOR)}
GAITS = {1: (-0.1, 0.1, -0.2, 0.1), 2: (-0.15, -0.1, 0.3, -0.1)}
CASES = 20


def parameters(weight="even", limits=None, reference=HERE):
    return Parameters(TILTROTOR, GAINS, reference, limits or Limits(), WEIGHTS[weight])


def random_state(random):
    return (
        *random.uniform(-1.0, 1.0, 6).tolist(),
        *random.uniform(-0.8, 0.8, 3).tolist(),
        *random.uniform(-2.0, 2.0, 3).tolist(),
        *random.uniform(-0.6, 0.6, 4).tolist(),
        *(random.uniform(150, 500, 4) * SPIN).tolist(),
    )


def start(tilts):
    return (*[0.0] * 12, *tilts, *(300.0 * sign for sign in SPIN))


# --- what is desired ---------------------------------------------------------------------------


def test_desired_jerks_are_those_of_the_reference_and_its_errors():
    reference = ReferenceParameters(
        REFERENCE_TYPES["lissajous"], amplitude_x=1.0, amplitude_y=0.7, amplitude_z=0.4,
        frequency_x=0.5, frequency_y=0.8, frequency_z=1.1, phase_y=0.3, phase_z=1.0,
        roll=0.2, pitch=-0.1, yaw=0.6,
    )  # fmt: skip
    random = np.random.default_rng(1)
    state = np.array(random_state(random))
    linear, angular = random.normal(size=(2, 3))
    rotation = rotation_from_euler(*state[6:9])
    now = parameters(reference=reference)
    found = desired_jerks(2.0, tuple(state), rotation, (tuple(linear), tuple(angular)), now, ())
    position, velocity, acceleration, jerk = np.reshape(
        reference_derivatives(2.0, reference)[:12], (4, 3)
    )
    feedback = GAINS.position_3 * (position - state[:3])
    feedback += GAINS.position_2 * (velocity - state[3:6])
    feedback += GAINS.position_1 * (acceleration - linear)
    np.testing.assert_allclose(found[0], jerk + feedback, rtol=1e-12)
    error = np.array(attitude_error(rotation, rotation_from_euler(0.2, -0.1, 0.6)))
    turning = GAINS.attitude_3 * error - GAINS.attitude_2 * state[9:12] - GAINS.attitude_1 * angular
    np.testing.assert_allclose(found[1], turning, rtol=1e-12)


# --- the solve ---------------------------------------------------------------------------------


def test_the_solve_is_the_pseudo_inverse():
    random = np.random.default_rng(0)
    for _ in range(CASES):
        rows = random.normal(size=(6, 8)) * 10.0 ** random.uniform(-3, 3, (6, 1))
        desired = random.normal(size=6)
        found = minimum_norm_inputs(tuple(map(tuple, rows.tolist())), tuple(desired.tolist()))
        expected = np.linalg.pinv(rows, rcond=1e-14) @ desired
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("weight", WEIGHTS)
def test_the_solve_copes_with_the_vehicles_matrix(weight):
    """Columns of thrust and of tilt differ by 1e5 under the published weight."""
    random = np.random.default_rng(1)
    ratio = drag_ratio(TILTROTOR)
    for _ in range(CASES):
        trig = sines_and_cosines(*random.uniform(-0.6, 0.6, 4))
        w = tuple(random.uniform(4e4, 2e5, 4) * SPIN / WEIGHTS[weight])
        rows = pose_rows(trig, torque_entries(trig, ratio), w)
        desired = random.normal(size=6)
        found = np.array(minimum_norm_inputs(rows, tuple(desired)))
        np.testing.assert_allclose(np.array(rows) @ found, desired, rtol=0, atol=1e-9)
        expected = np.linalg.lstsq(np.array(rows), desired, rcond=1e-15)[0]
        assert np.linalg.norm(found) <= np.linalg.norm(expected) * (1 + 1e-6)


def test_the_solve_is_nan_where_rows_depend_on_each_other():
    rows = np.random.default_rng(2).normal(size=(6, 8))
    rows[4] = rows[0] - 2 * rows[3]
    found = minimum_norm_inputs(tuple(map(tuple, rows.tolist())), (1.0,) * 6)
    assert all(isnan(value) for value in found)


@pytest.mark.parametrize("row", range(6))
def test_a_row_of_zeros_has_no_solution(row):
    rows = np.random.default_rng(2).normal(size=(6, 8))
    rows[row] = 0.0
    found = minimum_norm_inputs(tuple(map(tuple, rows.tolist())), (1.0,) * 6)
    assert all(isnan(value) for value in found)


def test_rows_are_derivatives_of_force_and_torque():
    random = np.random.default_rng(3)
    ratio = drag_ratio(TILTROTOR)

    def wrench(point):
        trig = sines_and_cosines(*point[4:])
        x2, x4, y1, y3, z1, z2, z3, z4 = torque_entries(trig, ratio)
        w1, w2, w3, w4 = point[:4]
        return np.array(
            [
                *body_force(trig, w1, w2, w3, w4),
                x2 * w2 + x4 * w4,
                y1 * w1 + y3 * w3,
                z1 * w1 + z2 * w2 + z3 * w3 + z4 * w4,
            ]
        )

    for _ in range(CASES):
        point = np.array([*random.uniform(-2, 2, 4), *random.uniform(-3, 3, 4)])
        trig = sines_and_cosines(*point[4:])
        rows = pose_rows(trig, torque_entries(trig, ratio), tuple(point[:4]))
        h = 1e-6
        columns = [(wrench(point + h * e) - wrench(point - h * e)) / (2 * h) for e in np.eye(8)]
        np.testing.assert_allclose(rows, np.stack(columns, axis=1), rtol=0, atol=1e-8)


# --- the law -----------------------------------------------------------------------------------


def test_the_attitude_error_is_the_sine_of_the_angle_along_its_axis():
    random = np.random.default_rng(4)
    for _ in range(CASES):
        now = Rotation.random(random_state=random.integers(1 << 30))
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = random.uniform(-3.0, 3.0)
        desired = now * Rotation.from_rotvec(angle * axis)
        found = attitude_error(tuple(now.as_matrix().ravel()), tuple(desired.as_matrix().ravel()))
        np.testing.assert_allclose(found, np.sin(angle) * axis, rtol=0, atol=1e-14)


@pytest.mark.parametrize("weight", WEIGHTS)
def test_the_outputs_move_as_demanded(weight):
    random = np.random.default_rng(5)
    law = parameters(weight, reference=PATH._replace(roll=0.1, pitch=-0.2, yaw=0.3))
    path = [reference(TIME, order) for order in range(4)]
    for case in range(CASES):
        state = random_state(random)
        if case % 2:  # backwards, too
            state = (*state[:16], *(-speed for speed in state[16:]))
        inputs = full_pose_inputs(TIME, state, law)

        def rates(_, state, inputs=inputs):
            return tiltrotor_rates(state, inputs, TILTROTOR)

        h = 1e-8 if weight == "published" else 1e-7
        now, ahead, behind = (
            np.array(rates(0.0, rk4_step(rates, 0.0, state, k * h))) for k in (0, 1, -1)
        )
        third = ((ahead - behind) / (2 * h))[[3, 4, 5, 9, 10, 11]]
        error = attitude_error(
            rotation_from_euler(*state[6:9]), rotation_from_euler(0.1, -0.2, 0.3)
        )
        desired = np.concatenate(
            [
                path[3]
                + 750.0 * (path[2] - now[3:6])
                + 1875.0 * (path[1] - state[3:6])
                + 1562.0 * (path[0] - state[:3]),
                2577.0 * np.array(error) - 1500.0 * np.array(state[9:12]) - 750.0 * now[9:12],
            ]
        )
        np.testing.assert_allclose(third, desired, rtol=0, atol=1e-4 * np.abs(desired).max())


@pytest.mark.parametrize("lost", [1, 2, 3, 4])
def test_a_rotor_known_to_be_lost_is_counted_on_no_more(lost):
    """From its time on the law is that of a vehicle whose rotor makes no thrust."""
    random = np.random.default_rng(6)
    law = parameters()
    warned = law._replace(failure=Failure(float(lost), 2.0))
    for _ in range(CASES // 4):
        state = random_state(random)
        whole = full_pose_inputs(1.0, state, law)
        assert full_pose_inputs(1.999, state, warned) == whole
        inputs = full_pose_inputs(2.0, state, warned)
        assert inputs == full_pose_inputs(9.0, state, warned)
        assert inputs[lost - 1] == inputs[lost + 3] == 0.0

        def rates(_, state, inputs=inputs):
            return tiltrotor_rates((*state[:16], *without(lost, state[16:])), inputs, TILTROTOR)

        now, ahead, behind = (
            np.array(rates(0.0, rk4_step(rates, 0.0, state, k * 1e-7))) for k in (0, 1, -1)
        )
        third = ((ahead - behind) / 2e-7)[[3, 4, 5, 9, 10, 11]]
        error = attitude_error(rotation_from_euler(*state[6:9]), rotation_from_euler(0, 0, 0))
        demanded = np.concatenate(
            [
                -1562.0 * np.array(state[:3]) - 1875.0 * np.array(state[3:6]) - 750.0 * now[3:6],
                2577.0 * np.array(error) - 1500.0 * np.array(state[9:12]) - 750.0 * now[9:12],
            ]
        )
        np.testing.assert_allclose(third, demanded, rtol=0, atol=1e-4 * np.abs(demanded).max())


def without(lost, speeds):
    return [0.0 if rotor == lost else speed for rotor, speed in enumerate(speeds, start=1)]


def test_no_failure_is_the_default():
    assert Failure() == Failure(0.0, inf)
    state = random_state(np.random.default_rng(7))
    named = parameters()._replace(failure=Failure(0.0, 0.0))
    assert full_pose_inputs(1.0, state, named) == full_pose_inputs(1.0, state, parameters())


def test_the_even_weight_is_that_of_hover():
    """A tilt rate moves the force by ``w alpha'``, a rotor's acceleration by ``w'``."""
    weight = TILTROTOR.mass * TILTROTOR.gravity / (4.0 * TILTROTOR.thrust_coefficient)
    assert WEIGHTS["even"] == pytest.approx(weight, rel=1e-12)


def test_the_published_gains_are_stable():
    assert is_hurwitz((1.0, GAINS.position_1, GAINS.position_2, GAINS.position_3))
    assert is_hurwitz((1.0, GAINS.attitude_1, GAINS.attitude_2, GAINS.attitude_3))


@pytest.mark.parametrize("stopped", [0, 3])
def test_inputs_are_nan_where_a_rotor_stands_still(stopped):
    state = list(start(GAITS[1]))
    state[16 + stopped] = 0.0
    assert all(isnan(value) for value in full_pose_inputs(0.0, tuple(state), parameters()))


def test_limits():
    limits = Limits(max_tilt_rate=2.0, max_tilt_angle=0.5)
    assert limited_tilt_rate(1.5, 0.2, limits) == 1.5
    assert limited_tilt_rate(-7.0, 0.2, limits) == -2.0
    assert limited_tilt_rate(7.0, 0.5, limits) == 0.0
    assert limited_tilt_rate(-7.0, 0.6, limits) == -2.0
    assert limited_tilt_rate(-1.0, -0.5, limits) == 0.0
    assert limited_tilt_rate(-9e9, -9.0, Limits()) == -9e9
    assert isnan(limited_tilt_rate(float("nan"), 0.0, limits))


# --- flights -----------------------------------------------------------------------------------


def settling_time(times, values, band):
    outside = np.flatnonzero(np.abs(values) > band)
    return times[outside[-1]] if outside.size else 0.0


def planned(gait, duration, step):
    law = attitude_altitude.Parameters(
        TILTROTOR,
        ATTITUDE_GAINS["ch03"],
        GaitParameters(GAIT_TYPES["fixed"], *GAITS[gait]),
        ReferenceParameters(REFERENCE_TYPES["attitude_altitude"]),
        0.0,
        0.0,
    )
    return fly(
        lambda time, state: (*rotor_accelerations(time, state, law), 0.0, 0.0, 0.0, 0.0),
        tiltrotor_rates,
        TILTROTOR,
        start(GAITS[gait]),
        duration,
        step,
    )


def full(gait, duration, step, **options):
    law = parameters(**options)
    return fly(
        lambda time, state: full_pose_inputs(time, state, law),
        tiltrotor_rates,
        TILTROTOR,
        start(GAITS[gait]),
        duration,
        step,
    )


@pytest.mark.parametrize("gait", GAITS)
def test_full_pose_control_is_faster_with_less_overshoot_and_fast_tilting(gait):
    """Ch. 3, Sec. 6.3 against Secs. 6.1.1 and 6.1.2: same start, with less thrust than weight."""
    times, states = planned(gait, 10.0, 0.002)
    assert settling_time(times, states[:, 2], 0.005) > 9.0
    assert states[:, 2].max() > 0.1
    times, states = full(gait, 1.0, 0.001)
    assert settling_time(times, states[:, 2], 0.005) < 0.1
    assert states[:, 2].max() < 0.001
    assert np.abs(states[:, :2]).max() < 0.001
    assert np.abs(states[:, 6:9]).max() < 0.002
    tilt_rates = np.diff(states[:, 12:16], axis=0) / np.diff(times)[:, None]
    assert np.abs(tilt_rates).max() > 20.0


def test_limits_hold_in_flight():
    limits = Limits(max_tilt_rate=5.0, max_tilt_angle=0.25)
    times, states = full(1, 1.5, 0.001, limits=limits)
    assert times[-1] == pytest.approx(1.5)
    assert np.abs(np.diff(states[:, 12:16], axis=0)).max() <= 5.0 * 0.001 * (1 + 1e-9)
    assert np.abs(states[:, 12:16]).max() <= 0.25 + 5.0 * 0.001
    assert np.abs(states[-1, 6:9]).max() < 0.01
    assert np.abs(states[-1, :3]).max() < 0.01


def test_under_the_published_weight_tilting_is_faster_than_any_step():
    """The finer the step the faster the pods: the flight of the printed norm has no limit."""
    fastest = []
    for step in (4e-4, 1e-4):
        times, states = full(1, 0.1, step, weight="published")
        rates = np.diff(states[:, 12:16], axis=0) / np.diff(times)[:, None]
        fastest.append(np.abs(rates).max())
    assert min(fastest) > 1e3


@pytest.mark.parametrize("weight", WEIGHTS)
def test_machine_code_gives_the_same_bits(weight):
    random = np.random.default_rng(6)
    law, state = parameters(weight, Limits(3.0, 0.5)), random_state(random)
    assert natively(full_pose_inputs, 1.7, state, law) == [*full_pose_inputs(1.7, state, law)]
