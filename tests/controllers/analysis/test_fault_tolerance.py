"""Hover with a broken vehicle: statics against the matrices, limits against brute force."""

from __future__ import annotations

from math import atan, cos, inf, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tiltsim_controllers.analysis.attainable import TiltedRotors, input_box
from tiltsim_controllers.analysis.fault_tolerance import (
    ROTORS,
    fixed_tilt_imbalance,
    minimum_hover_speed,
    pose_matrix,
    three_rotor_hover,
)
from tiltsim_controllers.analysis.hover import hover, rotor_losses
from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix
from tiltsim_controllers.analysis.two_color_map import delta
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio

VEHICLE = PRESETS["ar_drone_2"]
WEIGHT = VEHICLE.mass * VEHICLE.gravity / VEHICLE.thrust_coefficient
HOVER = VEHICLE.hover_rotor_speed
DELTA = atan(drag_ratio(VEHICLE))

each_loss = pytest.mark.parametrize("lost", ROTORS)


def at(tilts):
    """The rotors at tilt angles; they do not turn backwards."""
    factor = VEHICLE.thrust_coefficient
    torque = torque_matrix(tilts, VEHICLE) * factor * VEHICLE.arm_length
    limits = input_box((0.0, 10.0 * HOVER))
    return TiltedRotors(force_matrix(tilts) * factor, torque, *limits, WEIGHT * factor)


def wrench(hover):
    """Torque and force in units of the weight, the force in world axes."""
    w = np.array(hover.rotor_speeds) ** 2 * SPIN / WEIGHT
    tilts = np.array(hover.tilts)
    turn = rotation_matrix((hover.roll, hover.pitch, 0.3))
    return torque_matrix(tilts, VEHICLE) @ w, turn @ force_matrix(tilts) @ w


@each_loss
@given(st.floats(0.0, 1.2))
@settings(max_examples=20, deadline=None)
def test_three_rotors_hover(lost, share):
    hover = three_rotor_hover(lost, VEHICLE, opposite_speed=share * HOVER)
    assert hover.rotor_speeds[lost - 1] == 0.0
    torque, force = wrench(hover)
    np.testing.assert_allclose(torque, 0.0, atol=1e-12)
    np.testing.assert_allclose(force, [0.0, 0.0, 1.0], atol=1e-12)


@each_loss
def test_two_rotors_hover_without_authority_and_a_third_brings_it(lost):
    pair = three_rotor_hover(lost, VEHICLE, opposite_speed=0.0)
    assert pair.max_rotor_speed == pytest.approx((WEIGHT / 2.0 / cos(DELTA)) ** 0.5)
    assert pair.authority == pytest.approx(0.0, abs=1e-12)
    shares = (0.2, 0.5, 0.9)
    authority = [
        three_rotor_hover(lost, VEHICLE, opposite_speed=share * HOVER).authority for share in shares
    ]
    assert 0.01 < authority[0] < authority[1] < authority[2]


@each_loss
def test_the_pose_matrix_is_the_derivative_of_force_and_torque(lost):
    hover = three_rotor_hover(lost, VEHICLE, opposite_speed=0.6 * HOVER)
    tilts, w = np.array(hover.tilts), np.array(hover.rotor_speeds) ** 2 * SPIN

    def made(x):
        inputs = w * (1.0 + x[:4]) / WEIGHT
        angles = tilts + x[4:]
        force, torque = force_matrix(angles) @ inputs, torque_matrix(angles, VEHICLE) @ inputs
        return np.concatenate([force, torque])

    steps = 1e-6 * np.eye(8)
    slopes = np.array([(made(step) - made(-step)) / 2e-6 for step in steps]).T
    sound = [column for column in range(8) if column % 4 != lost - 1]
    found = pose_matrix(hover.tilts, hover.rotor_speeds, VEHICLE, lost)
    np.testing.assert_allclose(found, slopes[:, sound], atol=1e-9)
    assert found.shape == (6, 6)
    values = np.linalg.svd(slopes[:, sound])[1]
    assert hover.authority == pytest.approx(values[5] / values[0], rel=1e-7)


GREATEST_SPEED = (WEIGHT / cos(DELTA)) ** 0.5
"""The speed (rad/s) at which the opposite rotor alone carries the vehicle."""


@pytest.mark.parametrize("speed", [-1.0, 1.0001 * GREATEST_SPEED])
def test_negative_speeds_and_those_that_outweigh_the_vehicle_are_refused(speed):
    three_rotor_hover(1, VEHICLE, opposite_speed=0.9999 * GREATEST_SPEED)
    with pytest.raises(ValueError, match=f"between 0 and {GREATEST_SPEED:.4g} rad/s"):
        three_rotor_hover(1, VEHICLE, opposite_speed=speed)


def test_an_unknown_rotor_is_refused():
    with pytest.raises(ValueError, match="lost = 5"):
        three_rotor_hover(5, VEHICLE, opposite_speed=100.0)


# --- fixed tilts -------------------------------------------------------------------------------


@each_loss
@given(st.floats(-0.6, 0.6), st.tuples(*[st.floats(-0.5, 0.5)] * 2), st.floats(0.02, 0.3))
@settings(max_examples=6, deadline=None)
def test_fixed_tilts_hover_without_a_rotor_only_on_its_blue_line(lost, split, others, off):
    tilts = [others[0], others[1], others[0], others[1]]
    middle = SPIN[lost - 1] * delta(VEHICLE)
    tilts[lost % 4], tilts[(lost + 2) % 4] = middle + split, middle - split
    assert fixed_tilt_imbalance(tuple(tilts), lost, VEHICLE) == pytest.approx(0.0, abs=1e-12)
    found = rotor_losses(at(tilts))[lost - 1]
    opposite = found.rotor_speeds[(lost + 1) % 4]
    assert abs(opposite) < 1e-3 * found.max_rotor_speed
    assert not found.controllable

    tilts[lost % 4] += off
    assert rotor_losses(at(tilts))[lost - 1] is None


@given(st.floats(-0.6, 0.33))
@settings(max_examples=12, deadline=None)
def test_one_stuck_servo_of_a_level_gait_is_bearable_up_to_two_delta(angle):
    assert hover(at((angle, 0.0, 0.0, 0.0))) is not None
    assert hover(at((0.0, -angle, 0.0, 0.0))) is not None
    beyond = 2.0 * DELTA + 0.001 + abs(angle)
    assert hover(at((beyond, 0.0, 0.0, 0.0))) is None
    assert hover(at((0.0, 0.0, 0.0, -beyond))) is None


# --- free tilts --------------------------------------------------------------------------------


def test_a_whole_vehicle_needs_the_speed_of_hover():
    assert minimum_hover_speed(VEHICLE) == pytest.approx(HOVER, rel=1e-6)


@each_loss
def test_without_a_rotor_three_at_one_speed_are_best(lost):
    factors = tuple(0.0 if rotor == lost else 1.0 for rotor in ROTORS)
    least = minimum_hover_speed(VEHICLE, factors=factors)
    assert least / HOVER == pytest.approx(1.3285, abs=1e-4)
    # Among the symmetric hovers the one at equal speeds is the best, and nothing beats it.
    equal = three_rotor_hover(lost, VEHICLE, opposite_speed=least)
    assert equal.max_rotor_speed == pytest.approx(least, rel=1e-4)


def test_more_thrust_never_needs_more_speed():
    speeds = [
        minimum_hover_speed(VEHICLE, factors=(f, 1.0, 1.0, 1.0)) for f in (0.0, 0.3, 0.7, 1.0)
    ]
    assert sorted(speeds, reverse=True) == speeds


@pytest.mark.parametrize(
    ("angle", "any_attitude", "upright"),
    [(-1.6, 413.93, 437.00), (3.1, 361.54, 480.11), (0.8, 373.31, 373.31)],
)
def test_a_stuck_servo_needs_the_globally_least_speed(angle, any_attitude, upright):
    """Against a search from 300 directions, and at most the value for a lost rotor."""
    least = minimum_hover_speed(VEHICLE, stuck=(1, angle))
    assert least == pytest.approx(any_attitude, abs=0.01)
    assert minimum_hover_speed(VEHICLE, stuck=(1, angle), upright=True) == pytest.approx(
        upright, abs=0.01
    )
    # Half a turn of every pod, and of the body.
    opposite = minimum_hover_speed(VEHICLE, stuck=(1, angle - pi))
    assert opposite == pytest.approx(least, rel=1e-6)
    assert HOVER < least < upright + 0.01 < 1.3287 * HOVER


def test_one_rotor_alone_does_not_hover():
    assert minimum_hover_speed(VEHICLE, factors=(0.0, 1.0, 0.0, 0.0)) == inf


def test_a_servo_stuck_upright_costs_nothing_and_all_rotors_are_alike():
    assert minimum_hover_speed(VEHICLE, stuck=(2, 0.0)) == pytest.approx(HOVER, rel=1e-6)
    # Half a revolution exchanges rotors 1 and 3, a mirror image rotors 1 and 2.
    speeds = [
        minimum_hover_speed(VEHICLE, stuck=(rotor, angle))
        for rotor, angle in ((1, 0.8), (2, -0.8), (3, 0.8), (4, -0.8))
    ]
    assert speeds == pytest.approx([speeds[0]] * 4, rel=1e-6)
    assert speeds[0] > 1.01 * HOVER
