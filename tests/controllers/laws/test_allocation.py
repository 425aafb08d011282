"""Rotor accelerations within limits, against a linear program and against the matrix itself."""

from __future__ import annotations

from math import atan, inf, nan, pi

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.sparse import block_diag, csr_array, eye_array, hstack, vstack

from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix, world_up
from tiltsim_controllers.laws import allocation
from tiltsim_controllers.laws.allocation import (
    RotorRange,
    acceleration_range,
    limited_accelerations,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio

VEHICLE = PRESETS["ar_drone_2"]
LIMITS = (200.0, 400.0)
HORIZON = 0.02
RANGE = RotorRange(*LIMITS, HORIZON)

tilts = st.tuples(*[st.floats(-0.5, 0.5)] * 4)
speeds = st.tuples(*[st.floats(*LIMITS)] * 4)
accelerations = st.tuples(*[st.floats(-2e4, 2e4)] * 4)


def limited_tiltrotor(requested, angles, signed, roll, pitch, vehicle, limits):
    """Accelerations of the tiltrotor within limits."""
    force = force_matrix(np.array(angles))
    wrench = np.vstack([force, torque_matrix(angles, vehicle)])  # in two units: no result changes
    asked, speeds, spins = map(np.array, (requested, signed, SPIN))
    found = limited_accelerations(asked, wrench, world_up(roll, pitch), speeds, spins, limits)
    return tuple(found.tolist())


def decoupling(angles, rotor_speeds, roll, pitch):
    """Third derivatives of roll, pitch, yaw and altitude (scaled) per rotor acceleration."""
    rows = np.vstack(
        [torque_matrix(angles, VEHICLE), world_up(roll, pitch) @ force_matrix(np.array(angles))]
    )
    return rows * 2.0 * np.abs(rotor_speeds)


@example((0.0,) * 4, (200.0,) * 4, 0.0, 0.0, (0.0, 0.0, 3.86401735937295e-07, -2770.0))
@given(tilts, speeds, st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), accelerations)
@settings(max_examples=50, deadline=None)
def test_roll_and_pitch_keep_their_direction_and_come_before_yaw(angles, magnitudes, r, p, desired):
    signed = tuple(s * m for s, m in zip(SPIN, magnitudes, strict=True))
    matrix = decoupling(angles, signed, r, p)
    assume(np.linalg.cond(matrix) < 1e4)
    found = limited_tiltrotor(desired, angles, signed, r, p, VEHICLE, RANGE)
    requested, allocated = matrix @ desired, matrix @ found
    # An allocation trades one rotor against another: errors are relative to the largest.
    scale = np.abs(matrix).sum(axis=1) * np.abs([*desired, *found]).max() + 1e-9

    # Within the limits, in the spin's sense, over the horizon.
    along = np.array(magnitudes) + HORIZON * np.array(found) * SPIN
    assert (along >= LIMITS[0] - 1e-6).all()
    assert (along <= LIMITS[1] + 1e-6).all()

    cross = allocated[0] * requested[1] - allocated[1] * requested[0]
    assert abs(cross) < 1e-9 * scale.max() ** 2
    for axis in (0, 1):
        if abs(requested[axis]) > 1e-3 * scale[axis]:
            assert -1e-6 < allocated[axis] / requested[axis] < 1.0 + 1e-6


def test_commands_within_the_limits_come_back_untouched():
    desired = (10.0, -20.0, 5.0, 1.0)
    speeds_now = (-300.0, 300.0, -300.0, 300.0)
    tilts_now = (0.1, -0.1, 0.2, 0.0)
    assert limited_tiltrotor(desired, tilts_now, speeds_now, 0.1, 0.2, VEHICLE, RANGE) == desired


def test_a_climb_beyond_the_limit_costs_no_attitude():
    speeds_now = (-395.0, 390.0, -395.0, 390.0)
    desired = (-9000.0, 9500.0, -8800.0, 9000.0)
    found = limited_tiltrotor(desired, (0.0,) * 4, speeds_now, 0.0, 0.0, VEHICLE, RANGE)
    matrix = decoupling((0.0,) * 4, speeds_now, 0.0, 0.0)
    np.testing.assert_allclose((matrix @ found)[:3], (matrix @ desired)[:3], rtol=1e-9, atol=1e-6)
    assert (matrix @ found)[3] < (matrix @ desired)[3]


def sequential_program(matrices, requested, low, high):
    """Lexicographic optima of many cases, by three linear programs.

    The cases share no variable: the optimum of the sum is the optimum of each.

    Args:
        matrices: decoupling matrices, shape (cases, 4, rotors)
        requested: rates of roll, pitch, yaw and lift, shape (cases, 4)
        low, high: limits of the rotor accelerations, shape (cases, rotors)

    Returns:
        The attainable rates, shape (cases, 4).
    """
    cases, _, rotors = matrices.shape
    box = np.stack([low, high], axis=-1).reshape(-1, 2)

    def solve(objective, ends, equal, known, limited=None, limits=None):
        """Optimal accelerations, and the one further variable of each case, between its ends."""
        cost = np.repeat([0.0, objective], [rotors * cases, cases])
        bounds = np.vstack([box, np.tile(ends, (cases, 1))])
        found = linprog(cost, limited, limits, equal, known, bounds)
        assert found.success, found.message
        return np.split(found.x, [rotors * cases])

    rows = block_diag(matrices[:, :2])
    tilting = block_diag(requested[:, :2, None])
    _, share = solve(-1.0, (0.0, 1.0), hstack([rows, -tilting]), np.zeros(2 * cases))
    known = tilting @ share
    for axis in (2, 3):  # least distance from the request, a bound on both differences
        row, requirement, one = (
            block_diag(matrices[:, None, axis]),
            requested[:, axis],
            eye_array(cases),
        )
        limited = vstack([hstack([row, -one]), hstack([-row, -one])])
        equal = hstack([rows, csr_array((rows.shape[0], cases))])
        limits = np.concatenate([requirement, -requirement])
        inputs, _ = solve(1.0, (0.0, np.inf), equal, known, limited, limits)
        rows, known = vstack([rows, row]), np.concatenate([known, row @ inputs])
    roll_pitch, yaw, lift = np.split(known, [2 * cases, 3 * cases])
    return np.column_stack([roll_pitch.reshape(cases, 2), yaw, lift])


def test_roll_and_pitch_come_before_yaw_and_yaw_before_lift():
    """1,000 random cases, in units of 1e4 rad/s^2."""
    random, cases, unit = np.random.default_rng(8), 1000, 1e4
    angles, leans = random.uniform(-0.4, 0.4, (cases, 4)), random.uniform(-0.4, 0.4, (cases, 2))
    slowest = random.choice([0.0, LIMITS[0]], (cases, 1))
    magnitudes = random.uniform(*LIMITS, (cases, 4))
    signed = magnitudes * SPIN
    requested = random.uniform(-1.0, 1.0, (cases, 4)) * 10.0 ** random.uniform(-2, 0.5, (cases, 1))
    found = np.array(
        [
            limited_tiltrotor(w, a, s, *lean, VEHICLE, RANGE._replace(slowest=least))
            for w, a, s, lean, (least,) in zip(
                *(map(tuple, table.tolist()) for table in (unit * requested, angles, signed)),
                *(leans.tolist(), slowest.tolist()),
                strict=True,
            )
        ]
    )
    matrices = np.array([decoupling(*case) for case in zip(angles, signed, *leans.T, strict=True)])
    matrices /= np.abs(matrices).sum(axis=2, keepdims=True)
    ends = np.array([slowest - magnitudes, LIMITS[1] - magnitudes]) * SPIN / (HORIZON * unit)
    requirement, achieved = (
        np.einsum("nij,nj->ni", matrices, w) for w in (requested, found / unit)
    )
    attainable = sequential_program(matrices, requirement, ends.min(axis=0), ends.max(axis=0))
    limited = (np.abs(attainable - requirement) > 1e-6).sum(axis=0)
    assert (limited > 100).all(), limited
    # The linear program is solved to 1e-7.
    np.testing.assert_allclose(achieved, attainable, rtol=0, atol=1e-6)


@pytest.mark.parametrize("limits", [(0.0, inf), (350.0, inf), (0.0, 365.0)])
def test_one_limit_is_enough(limits):
    desired, signed = (-9e3, -9e3, 9e3, 9e3), (-360.0, 360.0, -361.0, 361.0)
    arguments = (0.1, 0.2, 0.0, -0.1), signed, 0.1, 0.2, VEHICLE
    found = limited_tiltrotor(desired, *arguments, RotorRange(*limits, HORIZON))
    finite = (limits[0], min(limits[1], 1e6))
    np.testing.assert_allclose(
        found, limited_tiltrotor(desired, *arguments, RotorRange(*finite, HORIZON)), rtol=1e-9
    )
    assert all(
        limits[0] - 1e-9 <= s * v <= limits[1] + 1e-9
        for s, v in zip(SPIN, np.array(signed) + HORIZON * np.array(found), strict=True)
    )


def test_a_pair_without_yaw_torque_does_not_hang_on_rounding():
    """Rotors 2 and 4 together make no yaw at ``alpha_2 + alpha_4 = -2 delta``, only lift."""
    delta, signed = atan(drag_ratio(VEHICLE)), (-390.0, 400.0, -390.0, 390.0)
    for yaw in (-1.0, 1.0):
        found = [
            limited_tiltrotor(
                (-8e3 * yaw, 9e3, -8e3 * yaw, 9e3),
                (0.1, 0.2, -0.1, -2.0 * delta - 0.2 + rounding),
                *(signed, 0.0, 0.0, VEHICLE, RANGE),
            )
            for rounding in (-1e-15, 0.0, 1e-15)
        ]
        np.testing.assert_allclose(found, [found[1]] * 3, atol=1e-6)


@pytest.mark.parametrize("stopped", range(4))
def test_a_rotor_that_stands_still_does_not_stop_the_others(stopped):
    """Its acceleration moves no thrust: they make the requested roll and pitch alone."""
    requested, speeds_now = (9000.0, -9000.0, 9000.0, -9000.0), [-300.0, 300.0, -300.0, 300.0]
    speeds_now[stopped] = 0.0
    limits = RANGE._replace(slowest=0.0)
    found = limited_tiltrotor(requested, (0.0,) * 4, tuple(speeds_now), 0.0, 0.0, VEHICLE, limits)
    matrix = decoupling((0.0,) * 4, speeds_now, 0.0, 0.0)
    along = np.abs(speeds_now) + HORIZON * np.array(found) * SPIN
    assert (along > -1e-9).all()
    assert (along < LIMITS[1] + 1e-9).all()
    asked = matrix[:2] @ requested
    assert np.abs(asked).max() > 1e6
    np.testing.assert_allclose(matrix[:2] @ found, asked, rtol=1e-9, atol=1e-3)


def test_non_finite_requests_come_back():
    for value in (nan, inf):
        requested = (value, 0.0, 0.0, 0.0)
        found = limited_tiltrotor(
            requested, (0.0,) * 4, (-300.0, 300.0, -300.0, 300.0), 0.0, 0.0, VEHICLE, RANGE
        )
        np.testing.assert_array_equal(found, requested)


# --- any number of rotors ------------------------------------------------------------------------


def random_vehicles(rotors, cases):
    """Torque and lift per acceleration, requests and boxes with zero, of orders as of vehicles.

    A third of the boxes have a rotor at its limit. A fifth of the vehicles are symmetric and so are
    their boxes, in which rotors meet their limits at the same time.
    """
    random, found = np.random.default_rng(rotors), []
    while len(found) < cases:
        rows = random.uniform(-1.0, 1.0, (4, rotors)) * [[1.0], [1.0], [0.1], [1.0]]
        rows[3] = 0.6 + 0.4 * rows[3]
        box = np.sort(random.uniform(0.0, 1.0, (rotors, 2)) * [-1.0, 1.0])
        requested = random.uniform(-1.0, 1.0, rotors) * random.choice([1.0, 3.0, 10.0])
        if len(found) % 3 == 0:
            box[random.integers(rotors), random.integers(2)] = 0.0
        if len(found) % 5 == 0:
            angle, turn = 2.0 * pi * np.arange(rotors) / rotors, (-1.0) ** np.arange(rotors)
            rows = np.array([np.sin(angle), -np.cos(angle), 0.1 * turn, np.ones(rotors)])
            box, requested = np.tile([-0.5, 0.5], (rotors, 1)), np.round(requested)
        if np.linalg.matrix_rank(rows, 1e-6) == 4:
            found.append((rows, requested, box))
    return found


def allocated(rows, requested, box):
    return allocation.allocated(requested, rows[:3], rows[3], *box.T)


@pytest.mark.parametrize("rotors", [4, 5, 7, 12])
def test_any_number_of_rotors_reaches_the_optima_of_the_linear_programs(rotors):
    vehicles = random_vehicles(rotors, 100)
    rows, requests, boxes = (np.array(part) for part in zip(*vehicles, strict=True))
    found = np.array([allocated(*vehicle) for vehicle in vehicles])
    assert (found >= boxes[..., 0]).all()
    assert (found <= boxes[..., 1]).all()
    requirement, achieved = (np.einsum("nij,nj->ni", rows, w) for w in (requests, found))
    attainable = sequential_program(rows, requirement, boxes[..., 0], boxes[..., 1])
    limited = (np.abs(attainable - requirement) > 1e-6).sum(axis=0)
    assert (limited > 10).all(), limited
    np.testing.assert_allclose(achieved, attainable, rtol=0, atol=1e-5)


@pytest.mark.parametrize("rotors", [5, 6, 8, 12])
def test_the_rest_is_nearest_to_the_request(rotors):
    """No other accelerations in the box with the same torque and lift are nearer."""
    apart = 0
    for rows, requested, box in random_vehicles(rotors, 40):
        found = allocated(rows, requested, box)
        towards = requested - found
        # Along the gradient of the distance none goes further: the condition of an optimum.
        best = linprog(-towards, A_eq=rows, b_eq=rows @ found, bounds=box)
        assert best.status == 0
        assert towards @ best.x <= towards @ found + 1e-6 * (towards @ towards)
        apart += np.abs(rows @ towards).max() < 1e-9 < np.abs(towards).max()
    assert apart > 0 or rotors == 5


def test_points_in_the_box_come_back_and_its_edge_is_no_jump():
    for rows, requested, box in random_vehicles(6, 40):
        edge = np.clip(requested, *box.T)
        np.testing.assert_array_equal(allocated(rows, edge, box), edge)
        beyond = edge + 1e-9 * requested
        np.testing.assert_allclose(allocated(rows, beyond, box), edge, atol=1e-6)


def test_limits_hold_along_the_spin_and_zero_is_always_allowed():
    limits = RotorRange(100.0, 400.0, 0.5)
    assert acceleration_range(300.0, 1.0, limits) == (-400.0, 200.0)
    assert acceleration_range(-300.0, -1.0, limits) == (-200.0, 400.0)
    assert acceleration_range(500.0, 1.0, limits) == (-800.0, 0.0)
    assert acceleration_range(50.0, 1.0, limits) == (0.0, 700.0)
    assert acceleration_range(-300.0, 1.0, RotorRange(-400.0, 400.0, 0.5)) == (-200.0, 1400.0)
