"""Rotor accelerations within limits, against a linear program and against the matrix itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix, world_up
from tiltsim_controllers.laws.allocation import (
    allocate_accelerations,
    allocate_by_priority,
    largest_feasible_scale,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN

VEHICLE = PRESETS["ar_drone_2"]
LIMITS = (200.0, 400.0)
HORIZON = 0.02

entries = st.integers(-1000, 1000).map(lambda number: number / 100)
vectors = st.tuples(entries, entries, entries, entries)
widths = st.tuples(*[st.integers(0, 50).map(lambda number: number / 10)] * 4)
tilts = st.tuples(*[st.floats(-0.5, 0.5)] * 4)
speeds = st.tuples(*[st.floats(*LIMITS)] * 4)
accelerations = st.tuples(*[st.floats(-2e4, 2e4)] * 4)


def program(cost, columns, low, high, bounds):
    """Least cost of factors whose combination of the columns lies in the box."""
    matrix = np.array(columns).T
    return linprog(
        cost,
        A_ub=np.concatenate([matrix, -matrix]),
        b_ub=np.concatenate([high, -np.array(low)]),
        bounds=bounds,
    )


@given(vectors, vectors, widths, widths)
@settings(max_examples=50, deadline=None)
def test_the_share_is_that_of_a_linear_program(attitude, direction, below, above):
    low = -np.array(below)
    desired = program([-1.0, 0.0], [attitude, direction], low, above, [(0.0, 1.0), (None, None)])
    assert largest_feasible_scale(attitude, direction, tuple(low), above) == pytest.approx(
        -desired.fun, abs=1e-6
    )


@given(vectors, vectors, vectors, st.floats(-3.0, 3.0), widths, widths)
@settings(max_examples=50, deadline=None)
def test_the_answer_is_in_the_box_and_wanted_where_allowed(
    tilting, turning, direction, lift, below, above
):
    assume(any(direction))
    low, high = -np.array(below), np.array(above)
    found = np.array(
        allocate_by_priority(
            tilting, turning, direction, lift, tuple(low.tolist()), tuple(high.tolist())
        )
    )
    assert (found >= low - 1e-9).all()
    assert (found <= high + 1e-9).all()
    desired = np.array(tilting) + turning + lift * np.array(direction)
    # Roll and pitch come first, also where yaw alone would bring them within the box.
    first = largest_feasible_scale(tilting, direction, tuple(low.tolist()), tuple(high.tolist()))
    if first == 1.0 and (desired > low + 1e-9).all() and (desired < high - 1e-9).all():
        np.testing.assert_allclose(found, desired, atol=1e-9)


@pytest.mark.parametrize("rounding", [-1e-14, 0.0, 1e-14])
@pytest.mark.parametrize("room", [-1e-14, 0.0, 1e-14])
def test_rotors_that_a_share_moves_alike_do_not_bound_it(rounding, room):
    """The first cannot go below 2, the third not above: rounding alone would leave no share."""
    desired = (1.0, -1.0, 1.0 + rounding, -1.0)
    low, high = (2.0, -9.0, -9.0, -9.0), (9.0, 9.0, 2.0 + room, 9.0)
    assert largest_feasible_scale(desired, (1.0, 1.0, 1.0, 1.0), low, high) == 1.0
    assert largest_feasible_scale((1.0, -1.0, 1.1, -1.0), (1.0,) * 4, low, high) < 1e-12


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
    found = allocate_accelerations(desired, angles, signed, r, p, VEHICLE, LIMITS, HORIZON)
    requested, allocated = matrix @ desired, matrix @ found
    # What an allocation leaves of one rotor it takes from another: all are good to the largest.
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


def test_what_the_limits_allow_comes_back_untouched():
    desired = (10.0, -20.0, 5.0, 1.0)
    speeds_now = (-300.0, 300.0, -300.0, 300.0)
    tilts_now = (0.1, -0.1, 0.2, 0.0)
    assert (
        allocate_accelerations(desired, tilts_now, speeds_now, 0.1, 0.2, VEHICLE, LIMITS, 0.02)
        == desired
    )


def test_a_climb_beyond_the_limit_costs_no_attitude():
    speeds_now = (-395.0, 390.0, -395.0, 390.0)
    desired = (-9000.0, 9500.0, -8800.0, 9000.0)
    found = allocate_accelerations(
        desired, (0.0,) * 4, speeds_now, 0.0, 0.0, VEHICLE, LIMITS, HORIZON
    )
    matrix = decoupling((0.0,) * 4, speeds_now, 0.0, 0.0)
    np.testing.assert_allclose((matrix @ found)[:3], (matrix @ desired)[:3], rtol=1e-9, atol=1e-6)
    assert (matrix @ found)[3] < (matrix @ desired)[3]


def test_attitude_comes_before_yaw_and_yaw_before_climb():
    """Three linear programs in a row, with the decoupling matrix inverted by NumPy."""
    random = np.random.default_rng(8)
    limited = 0
    for _ in range(25):
        angles, (roll, pitch) = random.uniform(-0.4, 0.4, 4), random.uniform(-0.4, 0.4, 2)
        magnitudes = random.uniform(*LIMITS, 4)
        signed = np.multiply(SPIN, magnitudes)
        requested = random.uniform(-1e4, 1e4, 4)
        matrix = decoupling(angles, signed, roll, pitch)
        tilting, turning, climbing = (
            np.linalg.solve(matrix, part * (matrix @ requested))
            for part in ([1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1])
        )
        ends = np.multiply(SPIN, (np.array(LIMITS)[:, None] - magnitudes) / HORIZON)
        low, high = np.minimum(0.0, ends.min(axis=0)), np.maximum(0.0, ends.max(axis=0))
        if (low <= requested).all() and (requested <= high).all():
            continue  # nothing to allocate
        free, share = (None, None), (0.0, 1.0)
        first = -program([-1.0, 0.0], [tilting, climbing], low, high, [share, free]).fun
        left = low - first * tilting, high - first * tilting
        second = -program([-1.0, 0.0], [turning, climbing], *left, [share, free]).fun
        found = allocate_accelerations(
            *(tuple(requested.tolist()), tuple(angles.tolist()), tuple(signed.tolist())),
            *(roll, pitch, VEHICLE, LIMITS, HORIZON),
        )
        third = nearest_to_one(climbing, left[0] - second * turning, left[1] - second * turning)
        expected = first * tilting + second * turning + third * climbing
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(requested).max())
        limited += second < 1.0
    assert limited > 5


def nearest_to_one(direction, low, high):
    """The factor of a direction that is nearest to 1 within a box."""
    ends = np.sort([low / direction, high / direction], axis=0)
    return min(max(1.0, ends[0].max()), ends[1].min())


def test_a_singular_matrix_gives_back_what_was_requested():
    """A rotor that stands still has no acceleration that moves its thrust."""
    requested = (9000.0, -9000.0, 9000.0, -9000.0)
    for stopped in range(4):
        speeds_now = [-300.0, 300.0, -300.0, 300.0]
        speeds_now[stopped] = 0.0
        found = allocate_accelerations(
            requested, (0.0,) * 4, tuple(speeds_now), 0.0, 0.0, VEHICLE, LIMITS, HORIZON
        )
        assert found == requested


def test_a_rotor_without_part_in_the_climb_does_not_bound_it():
    found = allocate_by_priority(
        (0.0,) * 4, (0.0,) * 4, (1.0, 0.0, 2.0, 0.0), 3.0, (-1.0,) * 4, (1.0,) * 4
    )
    assert found == (0.5, 0.0, 1.0, 0.0)
