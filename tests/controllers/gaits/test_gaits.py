"""Trots against ch. 4, Eqs. (21)-(24) and (31)-(34)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tiltsim_controllers.gaits.plans import continuous_trot, fixed, instant_trot

RHO, PERIOD = 0.65, 2.0

times = st.floats(0.0, 200.0)
# Subnormal numbers have too few digits for differences.
amplitudes = st.floats(-1.5, 1.5, allow_subnormal=False)
periods = st.floats(0.2, 20.0)

quick = settings(deadline=None, max_examples=60)


def trot_angle(trot, time):
    """The angle rho of a trot, after checking that the four tilt angles are a trot's."""
    alpha_1, alpha_2, alpha_3, alpha_4 = trot.angles(time)
    assert alpha_1 == alpha_2 == -alpha_3 == -alpha_4
    return alpha_3


def test_fixed_gait_keeps_its_angles():
    gait = fixed([0.1, -0.2, 0.3, -0.4])
    for time in (0.0, 17.3):
        np.testing.assert_array_equal(gait.angles(time), [0.1, -0.2, 0.3, -0.4])
        np.testing.assert_array_equal(gait.rates(time), [0.0] * 4)


@pytest.mark.parametrize(
    ("time", "rho"),
    [(0.0, RHO), (0.5, RHO), (1.0, RHO), (1.001, -RHO), (1.999, -RHO), (2.0, RHO), (7.5, -RHO)],
)
def test_instant_trot_changes_side_after_each_half_period(time, rho):
    trot = instant_trot(RHO, PERIOD)
    assert trot_angle(trot, time) == rho
    np.testing.assert_array_equal(trot.rates(time), [0.0] * 4)


@pytest.mark.parametrize(
    ("time", "rho"),
    [(0.0, RHO), (0.25, RHO / 2), (0.5, 0.0), (1.0, -RHO), (1.5, 0.0), (1.75, RHO / 2), (4.0, RHO)],
)
def test_continuous_trot_runs_to_the_other_side_and_back(time, rho):
    assert trot_angle(continuous_trot(RHO, PERIOD), time) == pytest.approx(rho, abs=1e-15)


@quick
@given(times, amplitudes, periods)
def test_continuous_trot_is_a_triangle_wave(time, amplitude, period):
    # rho / amplitude is 1 - 4 d, with d the distance in periods to the nearest start of a period.
    cycles = time / period
    distance = abs(cycles - round(cycles))
    rho = trot_angle(continuous_trot(amplitude, period), time)
    assert rho == pytest.approx(amplitude * (1 - 4 * distance), abs=1e-10)


@pytest.mark.parametrize("trot", [instant_trot, continuous_trot])
@quick
@given(st.integers(0, 4095), st.integers(0, 20), amplitudes)
def test_trots_repeat_after_a_period(trot, phase, cycle, amplitude):
    time = phase / 4096  # binary fractions, exact in floating point
    gait = trot(amplitude, 1.0)
    np.testing.assert_array_equal(gait.jets(time + cycle), gait.jets(time))
