"""Routh's criterion against the roots, and the verdict on the published gains."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tiltsim_controllers.analysis.stability import (
    error_loops,
    is_hurwitz,
    linear_loop,
    routh_first_column,
    third_order_loop,
)
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.vehicle.parameters import PRESETS

AR_DRONE = PRESETS["ar_drone_2"]
MARGIN = 1e-3  # polynomials with a root nearer to the imaginary axis are no fair question

coefficients = st.one_of(st.floats(0.01, 50.0), st.floats(-5.0, 50.0))
leading = st.floats(0.1, 10.0)
gains = st.floats(-2.0, 100.0)
roots = st.lists(
    st.one_of(
        st.floats(-5.0, 1.0).map(lambda root: (root,)),
        st.tuples(st.floats(-5.0, 1.0), st.floats(0.1, 5.0)).map(
            lambda pair: (complex(*pair), complex(pair[0], -pair[1]))
        ),
    ),
    min_size=1,
    max_size=4,
).map(lambda groups: [root for group in groups for root in group])

quick = settings(deadline=None, max_examples=60)


def largest_real_part(polynomial):
    return np.roots(polynomial).real.max()


def loops(gain_set, decoupling, vehicle=AR_DRONE):
    found = error_loops(GAIN_SETS[gain_set], vehicle.hover_rotor_speed, DECOUPLINGS[decoupling])
    return {loop.name: loop for loop in found}


@quick
@given(leading, st.lists(coefficients, min_size=1, max_size=6), st.sampled_from([1.0, -1.0]))
def test_hurwitz_means_that_all_roots_lie_left(first, others, sign):
    polynomial = [sign * value for value in (first, *others)]
    right = largest_real_part(polynomial)
    assume(abs(right) > MARGIN)
    assert is_hurwitz(polynomial) == (right < 0)


@quick
@given(roots)
def test_hurwitz_finds_the_side_of_known_roots(roots):
    right = max(root.real for root in roots)
    assume(abs(right) > 0.05)
    assert is_hurwitz(np.poly(roots).real.tolist()) == (right < 0)


@pytest.mark.parametrize(
    "polynomial",
    [
        pytest.param([1, 1, 10, 10], id="pair on the axis"),
        pytest.param([1, 2, 3, 0], id="root at zero"),
        pytest.param([1, 0, 4], id="undamped"),
        pytest.param([1, 10, 20, 50, 500], id="position gains of ch. 2, Appendix B"),
        pytest.param([1, 0, 0, 0], id="three roots at zero"),
    ],
)
def test_polynomials_on_the_boundary_or_beyond_are_not_hurwitz(polynomial):
    assert not is_hurwitz(polynomial)


def test_first_column_of_a_textbook_array():
    # s^4 + 2 s^3 + 3 s^2 + 4 s + 5: rows (1 3 5), (2 4), (1 5), (-6)
    assert routh_first_column([1, 2, 3, 4, 5]) == [1, 2, 1, -6]
    # s^3 + 6 s^2 + 11 s + 6 = (s + 1)(s + 2)(s + 3)
    assert routh_first_column([1, 6, 11, 6]) == [1, 6, 10, 6]


@quick
@given(gains, gains, gains, st.sampled_from([1.0, 722.0]))
def test_third_order_verdict_agrees_with_the_roots(k1, k2, k3, loop_gain):
    loop = third_order_loop("roll", (k1, k2, k3), loop_gain)
    expected = (1.0, loop_gain * k1, loop_gain * k2, loop_gain * k3)
    assert loop.polynomial == pytest.approx(expected)
    right = largest_real_part(expected)
    assume(abs(right) > MARGIN)
    assert loop.stable == (right < 0)
    assert (loop.condition == "") == loop.stable


@pytest.mark.parametrize(
    ("gains", "condition"),
    [
        ((-1.0, 2.0, 3.0), "roll K1 = -1 must be positive"),
        ((1.0, 0.0, 3.0), "roll K2 = 0 must be positive"),
        ((1.0, 2.0, -3.5), "roll K3 = -3.5 must be positive"),
        ((1.0, 10.0, 50.0), "roll K1 K2 = 10 must exceed K3 = 50"),
    ],
)
def test_the_condition_that_fails_is_named_with_its_numbers(gains, condition):
    assert third_order_loop("roll", gains, 1.0).condition == condition


@pytest.mark.parametrize(
    ("gain_set", "name", "condition"),
    [
        ("ch03", "roll", "roll K1 K2 = 1 must exceed K3 = 1"),
        ("ch03", "pitch", "pitch K1 K2 = 1 must exceed K3 = 1"),
        ("ch03", "yaw", "yaw K1 K2 = 1 must exceed K3 = 1"),
        ("ch04", "roll", "roll K1 K2 = 10 must exceed K3 = 50"),
        ("ch04", "pitch", "pitch K1 K2 = 10 must exceed K3 = 50"),
        ("ch04", "yaw", "yaw K1 K2 = 1 must exceed K3 = 1"),
    ],
)
def test_published_attitude_gains_fail_under_the_exact_matrix(gain_set, name, condition):
    loop = loops(gain_set, "exact")[name]
    assert not loop.stable
    assert loop.condition == condition


@pytest.mark.parametrize("gain_set", ["ch03", "ch04"])
def test_published_gains_pass_under_the_published_matrix(gain_set):
    assert all(loop.stable for loop in loops(gain_set, "published").values())


def test_exact_gains_place_the_poles_as_documented():
    found = loops("exact", "exact")
    assert all(loop.stable for loop in found.values())
    for name in ("roll", "pitch", "yaw"):
        poles = np.sort_complex(np.roots(found[name].polynomial))
        np.testing.assert_allclose(poles, [-20, -10 - 10j, -10 + 10j], rtol=1e-9)


@pytest.mark.parametrize("vehicle", PRESETS.values(), ids=PRESETS)
def test_published_matrix_multiplies_the_attitude_loops_by_twice_the_hover_speed(vehicle):
    # 4 K_f varpi^2 = m g at hover
    hover = np.sqrt(vehicle.mass * vehicle.gravity / (4 * vehicle.thrust_coefficient))
    found = loops("ch04", "published", vehicle)
    expected = (1.0, 2 * hover, 20 * hover, 100 * hover)
    assert found["roll"].polynomial == pytest.approx(expected)
    assert found["altitude"].polynomial == (1.0, 10.0, 5.0, 10.0)
    assert found["position"].polynomial == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("position", [(0.0, 1.0), (1.0, -1.0)])
def test_position_gains_must_both_be_positive(position):
    bad = GAIN_SETS["ch04"]._replace(position=position)
    loop = error_loops(bad, AR_DRONE.hover_rotor_speed, DECOUPLINGS["published"])[-1]
    assert not loop.stable
    assert loop.condition == f"position gains {[*position]} must both be positive"


@pytest.mark.parametrize(
    ("gains", "condition"),
    [
        ((2.0, 3.0), ""),
        ((2.0, -3.0), "yaw k2 = -3 must be positive"),
        ((0.0, 3.0), "yaw k1 = 0 must be positive"),
        # s^3 + s^2 + s + 2: the third entry is (1 * 1 - 2) / 1.
        ((1.0, 1.0, 2.0), "yaw [1.0, 1.0, 2.0]: entry 3 of the Routh array's first column is -1"),
    ],
)
def test_a_linear_loop_names_the_first_condition_that_fails(gains, condition):
    loop = linear_loop("yaw", gains)
    assert loop.stable == (condition == "") == is_hurwitz((1.0, *gains))
    assert loop.condition.startswith(condition)
    assert loop.polynomial == (1.0, *gains)
