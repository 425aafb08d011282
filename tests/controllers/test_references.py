"""References against ch. 4, Eqs. (41)-(44)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.references import REFERENCE_TYPES, ReferenceParameters, position_reference

CIRCLE = ReferenceParameters(
    REFERENCE_TYPES["circle"], 1.0, -2.0, 3.0, radius=5.0, angular_frequency=0.1
)
LINE = ReferenceParameters(
    *(REFERENCE_TYPES["line"], 1.0, 2.0, 3.0),
    velocity_x=1.5,
    velocity_y=-0.5,
    velocity_z=0.25,
)

times = st.floats(0.0, 300.0)
quick = settings(deadline=None, max_examples=60)


def test_setpoint_stays_where_it_is():
    reference = ReferenceParameters(REFERENCE_TYPES["setpoint"], 1.0, -2.0, 3.0, yaw=0.5)
    for time in (0.0, 12.5):
        assert position_reference(time, reference) == (1.0, -2.0, 3.0, *[0.0] * 6)


def test_attitude_altitude_reference_holds_its_altitude():
    reference = ReferenceParameters(
        REFERENCE_TYPES["attitude_altitude"], z=4.0, roll=0.1, pitch=0.2, yaw=0.3
    )
    assert position_reference(7.0, reference) == (0.0, 0.0, 4.0, *[0.0] * 6)


def test_line_moves_uniformly_from_its_start():
    assert position_reference(4.0, LINE) == (7.0, 0.0, 4.0, 1.5, -0.5, 0.25, 0.0, 0.0, 0.0)


@quick
@given(times)
def test_circle_is_eqs_43_and_44(time):
    phase = 0.1 * time
    x, y, z, vx, vy, vz, *acceleration = position_reference(time, CIRCLE)
    expected = (1 + 5 * np.cos(phase), -2 + 5 * np.sin(phase), 3.0)
    assert (x, y, z) == pytest.approx(expected, abs=1e-14)
    assert (vx, vy, vz) == pytest.approx((-0.5 * np.sin(phase), 0.5 * np.cos(phase), 0.0))
    assert acceleration == [0.0, 0.0, 0.0], "ch. 4 leaves the acceleration out"


@quick
@given(times)
def test_circle_passes_its_acceleration_on_when_asked(time):
    *_, ax, ay, az = position_reference(time, CIRCLE._replace(acceleration_feedforward=1.0))
    expected = (-0.05 * np.cos(0.1 * time), -0.05 * np.sin(0.1 * time), 0.0)
    assert (ax, ay, az) == pytest.approx(expected, abs=1e-16)


@pytest.mark.parametrize("reference", [LINE, CIRCLE], ids=["line", "circle"])
@quick
@given(time=times)
def test_each_derivative_belongs_to_the_one_before(reference, time):
    reference = reference._replace(acceleration_feedforward=1.0)
    step = 1e-3
    before, now, after = (
        np.array(position_reference(time + shift, reference)) for shift in (-step, 0.0, step)
    )
    slope = (after - before) / (2 * step)
    np.testing.assert_allclose(slope[:6], now[3:], rtol=0, atol=1e-8)
