"""Attitude-altitude law of the quadrotor and the switching controller of ch. 2, Sec. 5."""

from __future__ import annotations

from math import isnan, pi

import numpy as np
import pytest

from tests.controllers.flights import fly, quadrotor_rates, rk4_step
from tests.natively import compiled_law
from tiltsim_controllers.laws.keys import choice, number_of
from tiltsim_controllers.laws.quadrotor import (
    ATTITUDE_GAINS,
    POSITION_GAINS,
    PUBLISHED_ZONE,
    Switching,
    SwitchingParameters,
    attitude_altitude_inputs,
    attitude_altitude_thrust_rate,
    in_attitude_zone,
    switching_inputs,
    yaw_position_inputs,
)
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters
from tiltsim_controllers.vehicle.parameters import PRESETS

QUADROTOR = PRESETS["ar_drone_2_unrounded"]
WEIGHT = QUADROTOR.mass * QUADROTOR.gravity
GAINS = ATTITUDE_GAINS["ch02"]
EXTENSIONS = ("bumpless", "held", "running")
ZONE = number_of(Switching(law="switching"), "zone")
START = (*[0.0] * 6, 0.5, -0.5, 0.0, 0.0, 0.0, 0.0, WEIGHT, 0.0)
CASES = 20


def parameters(extension, roll=0.01, pitch=0.0, gains="ch02"):
    """Sec. 5's set-up; ``pitch`` is ch. 2's, of the other sign here."""
    reference = ReferenceParameters(
        REFERENCE_TYPES["circle"],
        (1.0, 0.0, 0.0),
        radius=-1.0,
        angular_frequency=-1 / 20,
        roll=roll,
        pitch=-pitch,
    )
    return SwitchingParameters(
        QUADROTOR,
        reference,
        POSITION_GAINS[gains],
        GAINS,
        ZONE,
        choice(Switching, "extension", extension),
        extension_rate=100.0,
    )


def random_state(random):
    return np.concatenate(
        [
            random.uniform(-2.0, 2.0, 6),
            random.uniform(-1.0, 1.0, 3),
            random.uniform(-3.0, 3.0, 3),
            random.uniform(1.0, 9.0, 2),
        ]
    )


def outputs_rates(state, inputs):
    rates = quadrotor_rates(state, (*inputs, 0.0, 0.0), QUADROTOR)
    return np.array([*rates[6:9], rates[2]])


def test_the_outputs_move_as_appendix_b_demands():
    random = np.random.default_rng(1)
    reference = ReferenceParameters(
        REFERENCE_TYPES["attitude_altitude"], (0.0, 0.0, 0.4), roll=0.2, pitch=-0.1, yaw=0.3
    )
    target = np.array([0.2, -0.1, 0.3, 0.4])
    for _ in range(CASES):
        state = random_state(random)
        inputs = attitude_altitude_inputs(0.0, state, QUADROTOR, GAINS, reference)

        def rates(_, state, inputs=inputs):
            return quadrotor_rates(state, (*inputs, 0.0, 0.0), QUADROTOR)

        h = 1e-5
        second = (
            outputs_rates(rk4_step(rates, 0.0, state, h), inputs)
            - outputs_rates(rk4_step(rates, 0.0, state, -h), inputs)
        ) / (2 * h)
        first = outputs_rates(state, inputs)
        now = np.array([*state[6:9], state[2]])
        desired = 10.0 * (target - now) - 10.0 * first
        np.testing.assert_allclose(second, desired, rtol=0, atol=1e-6 * (1 + abs(desired).max()))


def test_hover_needs_the_weight_and_no_torque():
    inputs = attitude_altitude_inputs(0.0, np.zeros(14), QUADROTOR, GAINS, ReferenceParameters(0.0))
    assert inputs == pytest.approx((WEIGHT, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("roll", "pitch", "inside"),
    [
        (0.0, 0.0, True),
        (0.2, 0.5, True),
        (0.2, -0.5, True),
        (-pi / 2, 0.0, True),
        (0.2001, 0.0, False),
        (0.0, 0.5001, False),
        (0.5, 0.5, False),
        (-1.6, 0.0, False),
        (float("nan"), 0.0, False),
    ],
)
def test_the_published_zone(roll, pitch, inside):
    assert bool(in_attitude_zone(roll, pitch, PUBLISHED_ZONE)) is inside


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_each_law_flies_in_its_zone(extension):
    random = np.random.default_rng(2)
    law = parameters(extension)
    for _ in range(2 * CASES):
        state = random_state(random)
        inputs = switching_inputs(1.0, state, law)
        if in_attitude_zone(state[6], state[7], PUBLISHED_ZONE):
            attitude = attitude_altitude_inputs(1.0, state, QUADROTOR, GAINS, law.reference)
            np.testing.assert_array_equal(inputs[:4], attitude)
            if extension == "held":
                np.testing.assert_array_equal(inputs[4:], 0.0)
            if extension == "running":
                outside = yaw_position_inputs(1.0, state, law)
                np.testing.assert_array_equal(inputs[4:], outside[4:])
        else:
            outside = yaw_position_inputs(1.0, state, law)
            np.testing.assert_array_equal(inputs, outside)


RISING_AND_FALLING = ReferenceParameters(
    REFERENCE_TYPES["lissajous"],
    amplitude=(0.0, 0.0, 0.5),
    frequency=(0.0, 0.0, 2.0),
    phase=(0.0, 0.0, 1.0),
)


@pytest.mark.parametrize("reference", [None, RISING_AND_FALLING])
def test_the_flown_thrust_rate_is_the_thrusts_derivative(reference):
    random = np.random.default_rng(3)
    law = parameters("bumpless")
    if reference is not None:
        law = law._replace(reference=reference)
    for _ in range(CASES):
        state = random_state(random)

        def thrust(time, state):
            return attitude_altitude_inputs(time, np.array(state), QUADROTOR, GAINS, law.reference)[
                0
            ]

        def rates(time, state):
            return quadrotor_rates(state, switching_inputs(time, np.array(state), law), QUADROTOR)

        state = (*state[:6], -0.3 + 0.4 * state[6], 0.4 * state[7], *state[8:])
        h = 1e-5
        numerical = (
            thrust(h, rk4_step(rates, 0.0, state, h)) - thrust(-h, rk4_step(rates, 0.0, state, -h))
        ) / (2 * h)
        found = attitude_altitude_thrust_rate(0.0, np.array(state), thrust(0.0, state), law)
        assert found == pytest.approx(numerical, abs=1e-6 * (1 + abs(numerical)))


def flight(law, duration, step=0.004):
    times, states = fly(
        compiled_law(switching_inputs, len(START), law),
        quadrotor_rates,
        QUADROTOR,
        START,
        duration,
        step,
    )
    inside = np.array(
        [in_attitude_zone(roll, pitch, PUBLISHED_ZONE) for roll, pitch in states[:, 6:8]]
    )
    return times, states, inside


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_experiment_1_is_captured(extension):
    """Ch. 2, Fig. 8: from (0.5, 0.5) through one switch to (0.01, 0)."""
    times, states, inside = flight(parameters(extension), 10.0)
    assert np.flatnonzero(np.diff(inside.astype(int))).size == 1
    assert times[np.argmax(inside)] == pytest.approx(0.31, abs=0.01)
    np.testing.assert_allclose(states[-1, 6:9], [0.01, 0.0, 0.0], atol=1e-4)


def test_experiment_2_is_lost_after_switches():
    """Ch. 2, Figs. 10-11, with the reference (0.5, -0.5) of the text, which lies outside."""
    times, states, inside = flight(parameters("running", roll=0.5, pitch=-0.5), 10.0, 0.002)
    switches = np.flatnonzero(np.diff(inside.astype(int))).size
    assert 5 <= switches <= 60
    assert times[-1] < 4.0
    assert np.abs(states[-1, 6:8]).max() > pi / 2


def test_experiment_2_with_the_other_reference_rests_on_the_zones_edge():
    """(-0.5, 0.5) is a corner of the closed zone; the exact law reaches it from inside."""
    times, states, _ = flight(parameters("running", roll=-0.5, pitch=0.5), 10.0)
    assert times[-1] == pytest.approx(10.0)
    np.testing.assert_allclose(states[-1, 6:8], [-0.5, -0.5], atol=1e-4)


def test_bumpless_states_carry_the_flown_thrust_over_the_switch():
    law = parameters("bumpless", roll=0.5, pitch=0.0)
    times, states, inside = flight(law, 3.0, 0.001)
    leaving = np.flatnonzero(inside[:-1] & ~inside[1:])
    leaving = leaving[times[leaving] > 0.6][:1]  # after some time inside
    assert leaving.size == 1
    before = states[leaving[0]]
    thrust = switching_inputs(times[leaving[0]], before, law)[0]
    assert before[12] == pytest.approx(thrust, abs=1e-3)
    held = parameters("held", roll=0.5, pitch=0.0)
    times, states, inside = flight(held, 3.0, 0.001)
    leaving = np.flatnonzero(inside[:-1] & ~inside[1:])[0]
    before = states[leaving]
    thrust = switching_inputs(times[leaving], before, held)[0]
    assert abs(before[12] - thrust) > 0.1


def test_no_law_at_ninety_degrees():
    state = (*[0.0] * 6, float("nan"), 0.0, 0.0, *[0.0] * 5)
    assert isnan(
        attitude_altitude_inputs(0.0, state, QUADROTOR, GAINS, ReferenceParameters(0.0))[0]
    )
