"""Sensors, servos and faults as functions."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tiltsim_controllers.code.arrays import as_arrays, normal
from tiltsim_controllers.vehicle.actuators import (
    faults_record,
    rate_limited_command,
    servo_commands,
    thrust_factors,
)
from tiltsim_controllers.vehicle.instruments import (
    Sensor,
    Sensors,
    reading_error,
    reading_index,
    rotate_by_small_angle,
)

angles = st.floats(-3.0, 3.0)


@given(st.floats(1e-4, 1.0), st.integers(0, 10_000))
def test_a_reading_stands_from_its_own_multiple_on(period, number):
    assert reading_index(number * period, period) == number
    assert reading_index((number + 0.99) * period, period) == number


def test_readings_have_the_noise_and_bias_given():
    sensor = Sensor(0.3, (1.0, -2.0, 0.5))
    given = as_arrays(sensor)
    errors = np.array([reading_error(given, 5.0, 6.0, float(i)) for i in range(4000)])
    np.testing.assert_allclose(errors.mean(axis=0), [1.0, -2.0, 0.5], atol=0.02)
    np.testing.assert_allclose(np.cov(errors.T), 0.09 * np.eye(3), atol=0.008)


@given(st.tuples(angles, angles, angles), st.tuples(*[st.floats(-0.05, 0.05)] * 3))
def test_an_attitude_is_turned_about_the_body_axes(attitude, vector):
    start = Rotation.from_euler("xyz", attitude)
    quaternion = start.as_quat(scalar_first=True).tolist()
    found = Rotation.from_quat(rotate_by_small_angle(quaternion, vector), scalar_first=True)
    desired = start * Rotation.from_rotvec(vector)
    third_order = np.linalg.norm(vector) ** 3 / 12.0
    assert (found.inv() * desired).magnitude() < 1.01 * third_order + 1e-12


@given(angles, angles, st.floats(0.01, 1.0))
def test_a_set_point_leads_the_pod_by_its_reach_at_most(command, angle, reach):
    point = rate_limited_command(command, angle, reach)
    assert abs(point - angle) <= reach + 1e-12
    assert point == command or abs(point - angle) == pytest.approx(reach)
    assert rate_limited_command(command, angle, inf) == command


def test_faults_begin_at_their_time():
    faults = as_arrays(
        faults_record(3)((2.0, inf, inf), (0.3, 1.0, 1.0), (1.0, 3.0, inf), (0.2, 0.4, 0.0))
    )
    times = (0.0, 1.999, 2.0, 9.0)
    found = [thrust_factors(time, faults).tolist() for time in times]
    assert found == [[1.0, 1.0, 1.0]] * 2 + [[0.3, 1.0, 1.0]] * 2
    commands = np.array([0.5, 0.6])  # two servos, three rotors
    found = [servo_commands(time, commands, faults).tolist() for time in (0.999, 1.0, 3.0)]
    assert found == [[0.5, 0.6], [0.2, 0.6], [0.2, 0.4]]


@pytest.mark.parametrize("channel", [0.0, 3.0])
def test_every_axis_has_independent_noise(channel):
    sensor = Sensor(0.3)
    errors = tuple(reading_error(as_arrays(sensor), 5.0, channel, 17.0))
    alone = [0.3 * normal(5.0, channel + axis, 17.0) for axis in (0.0, 1.0, 2.0)]
    assert errors == pytest.approx(alone, rel=1e-15)
    assert len(set(errors)) == 3


def test_by_default_no_sensor_errs():
    for sensor in (Sensor(), Sensors().position, Sensors().velocity, Sensors().attitude):
        assert not reading_error(as_arrays(sensor), 5.0, 0.0, 1.0).any()
    assert (Sensors().active, Sensors().seed, Sensors().period) == (0.0, 0.0, 1.0)
