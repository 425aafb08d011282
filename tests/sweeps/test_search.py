"""The search for a boundary."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tiltsim.sweeps.chunks import Boundary, boundary


def search(holds, start, stop, step, tolerance):
    walk = boundary(start, stop, step, tolerance)
    tried = [next(walk)]
    try:
        while True:
            tried.append(walk.send(holds(tried[-1])))
    except StopIteration as end:
        return end.value, tried


@given(
    edge=st.floats(0.001, 1.999),
    step=st.floats(0.05, 0.5),
    tolerance=st.floats(1e-4, 1.0),
    sign=st.sampled_from([1.0, -1.0]),
)
def test_a_search_brackets_the_edge(edge, step, tolerance, sign):
    found, tried = search(lambda x: sign * x <= edge, 0.0, sign * 2.0, step, tolerance)
    last, first = sign * found.holds, sign * found.fails
    assert last <= edge < first
    assert first - last <= min(tolerance, step) * 1.001
    assert len(set(tried)) == len(tried)
    assert all(0.0 <= sign * x <= 2.0 for x in tried)


def test_the_first_failure_counts_even_if_it_holds_again_beyond():
    found, _ = search(lambda x: x < 0.32 or x > 0.45, 0.0, 1.0, 0.1, 0.01)
    assert 0.31 < found.holds < 0.32 <= found.fails < 0.33


def test_decimal_steps_stay_decimal():
    found, tried = search(lambda x: True, 0.0, 0.75, 0.1, 0.001)
    assert tried == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75]
    assert found == Boundary(0.75, None)


def test_a_failure_at_the_start_ends_it():
    assert search(lambda x: False, 0.2, 1.0, 0.1, 0.001) == (Boundary(None, 0.2), [0.2])


@pytest.mark.parametrize("tolerance", [0.1, 0.3])
def test_a_coarse_tolerance_needs_no_bisection(tolerance):
    found, tried = search(lambda x: x < 0.25, 0.0, 1.0, 0.1, tolerance)
    assert found == Boundary(0.2, 0.3)
    assert len(tried) == 4


def test_a_tolerance_finer_than_floats_terminates():
    found, _ = search(lambda x: x < 0.32, 0.0, 1.0, 0.1, 1e-30)
    assert np.nextafter(found.holds, 1.0) == found.fails == 0.32
