"""Accelerations of any number of rotors within limits, against linear programs."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import linprog

from tiltsim_controllers.laws.multirotor_allocation import (
    RotorRange,
    acceleration_range,
    allocated_of,
)

CASES = 30


def best(objective, rows, known, box):
    """The largest value of an objective and where, under equations within a box."""
    found = linprog(-np.asarray(objective), A_eq=rows, b_eq=known, bounds=box)
    assert found.success, found.message
    return found.x


def steps(start, direction, box):
    """The least and the greatest step from a start along a direction that stay in a box."""
    ends = np.sort((box - start[:, None]) / direction[:, None], axis=1)
    return ends[:, 0].max(), ends[:, 1].min()


def parts(requested, torque, lift):
    """The least accelerations with roll and pitch, with yaw, with lift alone, and the rest."""
    inverse = np.linalg.pinv(torque)
    leaning, spinning = (
        inverse[:, :2] @ torque[:2] @ requested,
        inverse[:, 2] * (torque[2] @ requested),
    )
    null = np.eye(len(lift)) - inverse @ torque
    alone = null @ lift / np.linalg.norm(null @ lift)
    return leaning, spinning, alone, null @ requested - alone * (alone @ requested)


@cache
def cases(rotors):
    """Random matrices of orders as of vehicles, boxes with zero, requests and what is allocated.

    A third of the boxes have a rotor at its limit.
    """
    random, allocated, rows = np.random.default_rng(rotors), allocated_of(rotors), []
    while len(rows) < CASES:
        torque = random.uniform(-1.0, 1.0, (3, rotors)) * [[1.0], [1.0], [0.1]]
        lift = random.uniform(0.2, 1.0, rotors)
        box = np.sort(random.uniform(0.0, 1.0, (rotors, 2)) * [-1.0, 1.0])
        if len(rows) % 3 == 0:
            box[random.integers(rotors), random.integers(2)] = 0.0
        requested = random.uniform(-1.0, 1.0, rotors) * random.choice([1.0, 3.0, 10.0])
        given = tuple(map(tuple, torque.tolist())), tuple(lift.tolist())
        found = allocated(tuple(requested.tolist()), *given, tuple(map(tuple, box.tolist())))
        rows.append((torque, lift, box, requested, np.array(found)))
    return rows


@pytest.mark.parametrize("rotors", [4, 6, 9])
def test_each_part_is_the_optimum_of_its_linear_program(rotors):
    limited, one, nothing = np.zeros(4, int), np.eye(rotors), np.zeros(rotors)
    for torque, lift, box, requested, found in cases(rotors):
        assert (box[:, 0] <= found).all()
        assert (found <= box[:, 1]).all()
        if (found == requested).all():
            continue
        leaning, spinning, alone, rest = parts(requested, torque, lift)
        small = 1e-7 * np.abs(requested).max()  # the linear programs are solved to 1e-7

        # Unknowns: the share, the step of lift, and what the rotors then do.
        bounds, turning, shares = [(0.0, 1.0), (None, None), *box.tolist()], nothing, []
        for part in (leaning, spinning):
            rows = np.column_stack([part, alone, -one])
            share = best(np.r_[1.0, 0.0, nothing], rows, -turning, bounds)[0]
            turning = turning + share * part
            shares.append(share)
        assert np.abs(torque @ (found - turning)).max() < 10.0 * small

        # One variable each: the program's solution in closed form, good to rounding.
        asked, close = lift @ requested, 1e-9 * np.abs(requested).max() / np.abs(alone).min()
        turning = np.linalg.pinv(torque) @ torque @ found
        least, most = steps(turning, alone, box)
        step = (asked - lift @ turning) / (lift @ alone)
        assert alone @ found == pytest.approx(min(max(step, least), most), abs=close)

        if rotors > 4:
            _, most = steps(turning + alone * (alone @ found), rest, box)
            shares.append(min(max(most, 0.0), 1.0))
            assert rest @ found / (rest @ rest) == pytest.approx(shares[-1], abs=1e-6)
        given_up = [*(np.array(shares) < 0.99), abs(lift @ found - asked) > 1e-3]
        limited[: len(given_up)] += given_up
    assert (limited[: 3 + (rotors > 4)] > 2).all(), limited


@pytest.mark.parametrize("rotors", [4, 9])
def test_roll_and_pitch_are_the_largest_of_all_accelerations_of_four_rotors(rotors):
    """Of all in the box that do not yaw; those of more rotors are at most so large."""
    for torque, _, box, requested, found in cases(rotors):
        if (found == requested).all():
            continue
        asked = np.r_[(torque @ requested)[:2], 0.0]
        rows = np.column_stack([torque, -asked])
        bounds = [*box.tolist(), (0.0, 1.0)]
        share = best(np.r_[np.zeros(rotors), 1.0], rows, np.zeros(3), bounds)[-1]
        reached = (asked @ torque @ found) / (asked @ asked)
        assert reached < share + 1e-7
        assert rotors > 4 or reached > share - 1e-7


def test_what_the_limits_allow_comes_back_untouched():
    for torque, lift, box, _, _ in cases(6)[:5]:
        inside = tuple((0.3 * box[:, 0] + 0.6 * box[:, 1]).tolist())
        given = tuple(map(tuple, torque.tolist())), tuple(lift.tolist())
        assert allocated_of(6)(inside, *given, tuple(map(tuple, box.tolist()))) is inside


def test_a_singular_matrix_leaves_the_request():
    torque, lift = (
        ((1.0, -1.0, 1.0, -1.0), (1.0, -1.0, 1.0, -1.0), (1.0, 0.0, 0.0, 1.0)),
        (1.0,) * 4,
    )
    requested = (3.0, 0.0, 0.0, 0.0)
    assert allocated_of(4)(requested, torque, lift, ((-1.0, 1.0),) * 4) == requested


def test_limits_hold_along_the_spin_and_zero_is_always_allowed():
    limits = RotorRange(100.0, 400.0, 0.5)
    assert acceleration_range(300.0, 1.0, limits) == (-400.0, 200.0)
    assert acceleration_range(-300.0, -1.0, limits) == (-200.0, 400.0)
    assert acceleration_range(500.0, 1.0, limits) == (-800.0, 0.0)
    assert acceleration_range(50.0, 1.0, limits) == (0.0, 700.0)
    assert acceleration_range(-300.0, 1.0, RotorRange(-400.0, 400.0, 0.5)) == (-200.0, 1400.0)
