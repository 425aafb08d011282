"""The named gain sets, by the poles of their loops and as printed."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.laws.gains import GAIN_SETS, Gains, Poles
from tiltsim_controllers.laws.quadrotor import POSITION_GAINS
from tiltsim_controllers.tilt_car.laws import FOURTH_GAINS, PLANNED_GAINS, THIRD_GAINS

AXES = ("roll", "pitch", "yaw", "altitude")


def poles(name, axis):
    return np.roots([1.0, *GAIN_SETS[name].loops[axis]])


def assert_poles(name, axis, expected):
    """Equal as sets, to the accuracy of a triple root."""
    polynomial = np.poly(expected).real
    found = np.poly(poles(name, axis)).real
    np.testing.assert_allclose(found, polynomial, rtol=1e-9)


def test_the_exact_set_has_the_poles_that_it_says():
    for axis in ("roll", "pitch", "yaw"):
        assert_poles("exact", axis, [-20.0, -10.0 + 10.0j, -10.0 - 10.0j])
    climb = poles("exact", "altitude")
    assert (np.abs(climb) > 1.0).all()
    assert (-climb.real > 0.75 * np.abs(climb)).all()  # the damping of each


def test_the_feedforward_set_has_the_poles_that_it_says():
    for axis, bandwidth in (("roll", 25.0), ("pitch", 25.0), ("yaw", 10.0), ("altitude", 10.0)):
        assert_poles("feedforward", axis, [-bandwidth] * 3)
    gains = GAIN_SETS["feedforward"]
    position = np.poly([-1.5, -1.5])
    np.testing.assert_allclose([1.0, *gains.position], position, rtol=1e-12)


def test_the_published_sets_are_as_printed():
    """Ch. 3, Sec. 3.2, and ch. 4, Eqs. (26)-(28), whose third column is the yaw's."""
    ch03, ch04 = GAIN_SETS["ch03"], GAIN_SETS["ch04"]
    last = (10, 5, 10), (1, 1)
    assert ch03 == (*[(1, 1, 1)] * 3, *last)
    assert ch04 == ((1, 1, 1), (10, 10, 1), (50, 50, 1), *last)


def test_other_sets_are_as_printed_and_ours_have_the_poles_that_they_say():
    """Ch. 2, App. B; ch. 11, Sec. 4.2; of ch. 10, which prints none, multiple poles."""
    assert POSITION_GAINS["ch02"] == ((10.0, 20.0, 50.0, 500.0), (5.0, 5.0))
    assert POSITION_GAINS["stable"].yaw == POSITION_GAINS["ch02"].yaw
    assert PLANNED_GAINS["ch11"] == ((12.0, 6.0), (9.0, 18.0))
    loops = (
        (PLANNED_GAINS["ch10"].x, -2.0),
        (PLANNED_GAINS["ch10"].y, -2.0),
        (THIRD_GAINS["ch10"], -2.0),
        (FOURTH_GAINS["ch10"], -3.0),
    )
    for gains, pole in loops:
        np.testing.assert_allclose([1.0, *gains], np.poly([pole] * len(gains)), rtol=1e-12)


def test_rows_are_diagonals_of_roll_pitch_and_yaw():
    gains = Gains((1, 2, 3), (4, 5, 6), (7, 8, 9), (10, 11, 12), (13, 14))
    outputs = {"roll": (1, 4, 7), "pitch": (2, 5, 8), "yaw": (3, 6, 9), "altitude": (10, 11, 12)}
    assert gains.loops == outputs


@pytest.mark.parametrize("field", ["damping", "integral"])
def test_poles_are_critically_damped_without_integral_by_default(field):
    assert getattr(Poles(3.0), field) == {"damping": 1.0, "integral": 0.0}[field]
