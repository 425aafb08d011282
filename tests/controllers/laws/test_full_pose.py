"""Full-pose control: the least-norm solve, linearization, limits, flights of ch. 3, Sec. 6.3."""

from __future__ import annotations

from math import inf, isnan, prod

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.controllers.flat_laws import attitude_altitude_inputs, numbers
from tests.controllers.flights import fly, rk4_step, tiltrotor_rates
from tests.controllers.laws.test_tracking import PATH, TIME, reference
from tests.controllers.multirotors import FOUR, HEXAROTOR, Vehicle, random_states, ring, tiltrotor
from tests.natively import compiled, natively
from tiltsim_controllers.analysis.stability import is_hurwitz
from tiltsim_controllers.code.arrays import traceable
from tiltsim_controllers.gaits.motion import FIXED, GaitParameters
from tiltsim_controllers.laws import attitude_altitude
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.full_pose import (
    GAIN_SETS,
    PUBLISHED_TILT_WEIGHT,
    Parameters,
    force_balanced_tilt_weight,
    full_pose,
    input_matrix,
    limited_tilt_rate,
    pose_rank,
    turning_rates,
)
from tiltsim_controllers.laws.gains import GAIN_SETS as ATTITUDE_GAINS
from tiltsim_controllers.laws.observed import UNHARMED, Failure, Seen
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.mathematics.linear import least_norm
from tiltsim_controllers.references.trajectories import (
    CIRCLE,
    REFERENCE_TYPES,
    ReferenceParameters,
    reference_motion,
)
from tiltsim_controllers.vehicle.cross import cross_table
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio
from tiltsim_controllers.vehicle.rotors import (
    force_and_torque,
    rotor_entries,
    rotors_in,
    tilt_of_rotor,
    tilts_of,
)

TILTROTOR = PRESETS["ar_drone_2_unrounded"]
GAINS = GAIN_SETS["ch03"]
NO_LIMITS = (inf, inf)
HERE = ReferenceParameters(REFERENCE_TYPES["setpoint"])
WEIGHTS = {"published": PUBLISHED_TILT_WEIGHT, "even": force_balanced_tilt_weight(TILTROTOR)}
GAITS = {1: (-0.1, 0.1, -0.2, 0.1), 2: (-0.15, -0.1, 0.3, -0.1)}
CASES = 20
ROTORS = rotors_in(cross_table(TILTROTOR, tilting=True), 0, (0, 1, 2, 3))


@traceable
def full_pose_inputs(time, state, parameters, knots=()):
    """The law of the tiltrotor."""
    return numbers(full_pose(Seen(time, state), parameters, knots, (0, 1, 2, 3)))


def law_of(vehicle, weight, limits, failure=UNHARMED, reference=HERE):
    """Parameters, given the limits of tilt rate and tilt angle."""
    rate, angle = limits
    return Parameters(
        vehicle, reference, weight, failure, 0.0, GAINS, max_tilt_rate=rate, max_tilt_angle=angle
    )


def parameters(weight="even", limits=None, reference=HERE):
    return law_of(TILTROTOR, WEIGHTS[weight], limits or NO_LIMITS, reference=reference)


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


# --- the solve ---------------------------------------------------------------------------------


def test_the_solve_is_the_pseudo_inverse():
    random = np.random.default_rng(0)
    for _ in range(CASES):
        rows = random.normal(size=(6, 8)) * 10.0 ** random.uniform(-3, 3, (6, 1))
        desired = random.normal(size=6)
        expected = np.linalg.pinv(rows, rcond=1e-14) @ desired
        bound = 1e-9 * np.abs(expected).max()
        np.testing.assert_allclose(least_norm(rows, desired), expected, rtol=0, atol=bound)


@pytest.mark.parametrize("weight", WEIGHTS)
def test_the_solve_copes_with_the_vehicles_matrix(weight):
    """Columns of thrust and of tilt differ by 1e5 under the published weight."""
    random = np.random.default_rng(1)
    units = np.repeat((TILTROTOR.arm_length, 1.0), 3)[:, np.newaxis] * TILTROTOR.thrust_coefficient
    for _ in range(CASES):
        w = random.uniform(4e4, 2e5, 4) * SPIN
        tilts = random.uniform(-0.6, 0.6, 4)
        rows = input_matrix(ROTORS, tilts, w, WEIGHTS[weight]) / units
        desired = random.normal(size=6)
        found = least_norm(rows, desired)
        np.testing.assert_allclose(rows @ found, desired, rtol=0, atol=1e-9)
        expected = np.linalg.lstsq(rows, desired, rcond=1e-15)[0]
        assert np.linalg.norm(found) <= np.linalg.norm(expected) * (1 + 1e-6)


@pytest.mark.parametrize("row", range(6))
@pytest.mark.parametrize("dependent", [False, True], ids=["zero", "dependent"])
def test_the_solve_is_nan_where_a_row_depends_on_the_others(row, dependent):
    rows = np.random.default_rng(2).normal(size=(6, 8))
    rows[row] = rows[row - 2] - 2 * rows[row - 3] if dependent else 0.0
    assert np.isnan(least_norm(rows, np.ones(6))).all()


def test_the_matrix_is_the_derivative_of_torque_and_force_in_closed_form():
    """Tilting a pod converts roll or pitch torque to yaw torque and back (ch. 3, Eqs. 3, 5)."""
    random = np.random.default_rng(3)
    per_force = TILTROTOR.thrust_coefficient
    per_torque = per_force * TILTROTOR.arm_length
    for _ in range(CASES):
        tilts, w = random.uniform(-3, 3, 4), random.uniform(-2, 2, 4)
        s, c, r = np.sin(tilts), np.cos(tilts), drag_ratio(TILTROTOR)
        roll, yaw = c - r * s, s + r * c  # of rotors 2 and 4, by the side they are on
        pitch, turn = c + r * s, s - r * c  # of rotors 1 and 3
        expected = [
            [0, roll[1], 0, -roll[3], 0, -yaw[1] * w[1], 0, yaw[3] * w[3]],
            [pitch[0], 0, -pitch[2], 0, -turn[0] * w[0], 0, turn[2] * w[2], 0],
            [
                *(turn[0], -yaw[1], turn[2], -yaw[3]),
                *(pitch[0] * w[0], -roll[1] * w[1], pitch[2] * w[2], -roll[3] * w[3]),
            ],
            [0, s[1], 0, -s[3], 0, c[1] * w[1], 0, -c[3] * w[3]],
            [s[0], 0, -s[2], 0, c[0] * w[0], 0, -c[2] * w[2], 0],
            [-c[0], c[1], -c[2], c[3], s[0] * w[0], -s[1] * w[1], s[2] * w[2], -s[3] * w[3]],
        ]
        units = np.repeat((per_torque, per_force), 3)[:, np.newaxis]
        found = input_matrix(ROTORS, tilts, w) / units
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


# --- the law -----------------------------------------------------------------------------------


def test_the_attitude_error_is_the_sine_of_the_angle_along_its_axis():
    random = np.random.default_rng(4)
    for _ in range(CASES):
        now = Rotation.random(random_state=random.integers(1 << 30))
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = random.uniform(-3.0, 3.0)
        desired = now * Rotation.from_rotvec(angle * axis)
        found = attitude_error(now.as_matrix(), desired.as_matrix())
        np.testing.assert_allclose(found, np.sin(angle) * axis, rtol=0, atol=1e-14)


@pytest.mark.parametrize("weight", WEIGHTS)
def test_the_outputs_move_as_demanded(weight):
    random = np.random.default_rng(5)
    law = parameters(weight, reference=PATH._replace(roll=0.1, pitch=-0.2, yaw=0.3))
    path = [reference(TIME, order) for order in range(4)]
    for case in range(CASES):
        state = random_state(random)
        if case % 2:  # also backward
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
            rotation_matrix(np.array(state[6:9])), rotation_matrix(np.array([0.1, -0.2, 0.3]))
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
    """From its time on the law is the law of a vehicle whose rotor makes no thrust."""
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
        error = attitude_error(rotation_matrix(np.array(state[6:9])), np.eye(3))
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


def test_the_even_weight_follows_from_hover():
    """A tilt rate moves the force by ``w alpha'``, a rotor's acceleration by ``w'``."""
    weight = TILTROTOR.mass * TILTROTOR.gravity / (4.0 * TILTROTOR.thrust_coefficient)
    assert WEIGHTS["even"] == pytest.approx(weight, rel=1e-12)


def test_the_published_gains_are_stable():
    assert all(is_hurwitz((1.0, *gains)) for gains in GAINS)


@pytest.mark.parametrize("stopped", [0, 3])
def test_inputs_are_nan_where_a_rotor_stands_still(stopped):
    state = list(start(GAITS[1]))
    state[16 + stopped] = 0.0
    found = full_pose_inputs(0.0, tuple(state), parameters())
    assert [isnan(value) for value in found[:4]] == [rotor == stopped for rotor in range(4)]


def test_limits():
    limits = parameters(limits=(2.0, 0.5))
    assert limited_tilt_rate(1.5, 0.2, limits) == 1.5
    assert limited_tilt_rate(-7.0, 0.2, limits) == -2.0
    assert limited_tilt_rate(7.0, 0.5, limits) == 0.0
    assert limited_tilt_rate(-7.0, 0.6, limits) == -2.0
    assert limited_tilt_rate(-1.0, -0.5, limits) == 0.0
    assert limited_tilt_rate(-9e9, -9.0, parameters()) == -9e9
    assert isnan(limited_tilt_rate(float("nan"), 0.0, limits))


# --- flights -----------------------------------------------------------------------------------


def settling_time(times, values, band):
    outside = np.flatnonzero(np.abs(values) > band)
    return times[outside[-1]] if outside.size else 0.0


def planned(gait, duration, step):
    law = attitude_altitude.Parameters(
        TILTROTOR,
        ATTITUDE_GAINS["ch03"],
        GaitParameters(FIXED),
        ReferenceParameters(REFERENCE_TYPES["attitude_altitude"]),
        Supervisor(),
        RotorRange(),
        decoupling=0.0,
        decoupler=0.0,
    )
    inputs = compiled(attitude_altitude_inputs, 0.0, start(GAITS[gait]), law)
    return fly(
        lambda time, state: (*inputs(time, state, law)[:4], 0.0, 0.0, 0.0, 0.0),
        tiltrotor_rates,
        TILTROTOR,
        start(GAITS[gait]),
        duration,
        step,
    )


def full(gait, duration, step, **options):
    law = parameters(**options)
    inputs = compiled(full_pose_inputs, 0.0, start(GAITS[gait]), law)
    return fly(
        lambda time, state: inputs(time, state, law),
        tiltrotor_rates,
        TILTROTOR,
        start(GAITS[gait]),
        duration,
        step,
    )


@pytest.mark.slow
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
    limits = (5.0, 0.25)
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
def test_machine_code_gives_the_same_inputs(weight):
    random = np.random.default_rng(6)
    law, state = parameters(weight, (3.0, 0.5)), random_state(random)
    found = natively(full_pose_inputs, 1.7, state, law)
    np.testing.assert_allclose(found, full_pose_inputs(1.7, state, law), rtol=1e-9)


# --- any rotors --------------------------------------------------------------------------------

ON_CIRCLE = ReferenceParameters(
    CIRCLE, (0.3, -0.2, 0.1), radius=2.0, angular_frequency=0.5, yaw=0.4
)


@pytest.mark.parametrize("failure", [Failure(), Failure(2.0, 10.0)], ids=["whole", "lost"])
def test_the_tiltrotors_parameters_stand_for_a_table_of_its_rotors(failure):
    vehicle, weight = tiltrotor(), force_balanced_tilt_weight(FOUR)
    own = law_of(FOUR, weight, (5.0, 1.0), failure, ON_CIRCLE)
    general = own._replace(vehicle=vehicle.body)
    for time, state in random_states(10):
        expected = np.array(full_pose_inputs(time, state, own))
        found = np.array(full_pose_inputs(time, state, general, vehicle.table))
        for part in (slice(4), slice(4, 8)):
            assert np.abs(found - expected)[part].max() <= 1e-12 * np.abs(expected[part]).max()


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
    parameters = law_of(vehicle.body, 3e5, NO_LIMITS, failure, ON_CIRCLE)
    target = reference_motion(1.0, ON_CIRCLE)
    works = np.array([rotor + 1.0 != failure.rotor for rotor in range(rotors)], float)
    rng = np.random.default_rng(4)
    for _ in range(3):
        body, angles = 0.3 * rng.normal(size=12), rng.uniform(-0.5, 0.5, tilts)
        speeds = rng.uniform(300.0, 500.0, rotors) * rng.choice((-1.0, 1.0), rotors)
        state = np.array([*body, *angles, *speeds])
        inputs = numbers(full_pose(Seen(1.0, state), parameters, np.array(table), layout))
        turned, accelerations = inputs[rotors:], inputs[:rotors]

        def wrench(step, angles=angles, speeds=speeds, inputs=(turned, accelerations)):
            v = speeds + step * inputs[1]
            w = works * v * np.abs(v)
            return np.concatenate(
                [part @ w for part in force_and_torque(table, angles + step * inputs[0])]
            )

        step = 1e-4 / max(1.0, np.abs(turned).max(initial=0.0), np.abs(accelerations).max())
        rate = (wrench(step) - wrench(-step)) / (2.0 * step)
        rotation = rotation_matrix(body[6:9])
        force, torque = np.split(wrench(0.0), 2)
        inertia = np.reshape(HEXAROTOR.inertia, (3, 3))
        present = rotation @ force / HEXAROTOR.mass - (0.0, 0.0, HEXAROTOR.gravity)
        jerk = target[3] + np.dot(
            GAINS.position, (target[2] - present, target[1] - body[3:6], target[0] - body[:3])
        )
        yaw = rotation_matrix((0.0, 0.0, ON_CIRCLE.yaw)).ravel()
        error = attitude_error(rotation, np.reshape(yaw, (3, 3)))
        angular = -np.dot(GAINS.attitude, (np.linalg.solve(inertia, torque), body[9:12], -error))
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


def test_rates_of_a_desired_attitude_are_seen_from_the_turning_body():
    """The reference ahead by differences of rotations, with all the terms of the body's turning."""
    random = np.random.default_rng(6)
    powers = random.uniform(-0.4, 0.4, (5, 3))  # of time, for roll, pitch and yaw

    def angles(time, order=0):
        terms = [prod(range(k - order + 1, k + 1)) * time ** (k - order) for k in range(order, 5)]
        return np.array(terms) @ powers[order:]

    def desired(time):
        return rotation_matrix(angles(time))

    def body(time):
        return rotation_matrix(np.array([0.3, -0.2, 0.4]) * (1.0 + time + 0.5 * time**2))

    def rates_of(rotation, time, step=1e-5):
        change = rotation(time).T @ (rotation(time + step) - rotation(time - step)) / (2.0 * step)
        return np.array([change[2, 1], change[0, 2], change[1, 0]])

    def seen(time):
        return body(time).T @ desired(time) @ rates_of(desired, time)

    def slope(vector, time, step=1e-3):
        return (vector(time + step) - vector(time - step)) / (2.0 * step)

    now, step = 0.4, 1e-3
    omega, omega_rate = rates_of(body, now), slope(lambda time: rates_of(body, time), now)
    target = np.array([angles(now, order) for order in range(4)])
    found = turning_rates(target, body(now).T @ desired(now), omega, omega_rate)
    second = (seen(now + step) - 2.0 * seen(now) + seen(now - step)) / step**2
    np.testing.assert_allclose(found.value, seen(now), atol=1e-8)
    np.testing.assert_allclose(found.rate, slope(seen, now), atol=1e-5)
    np.testing.assert_allclose(found.acceleration, second, atol=1e-4)
