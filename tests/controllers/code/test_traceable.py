"""Functions of arrays: called with tuples, traced, and checked numbers of a plan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from tests.natively import natively
from tiltsim_controllers.code.arrays import as_number, is_known, program_of, traceable, xp
from tiltsim_controllers.mathematics.linear import least_norm


class Gains(NamedTuple):
    rows: tuple[float, ...]
    size: float


@traceable
def shortest(gains, desired, columns=3):
    matrix = gains.rows.reshape(-1, columns)
    return gains.size * least_norm(matrix, desired)


@traceable
def law(gains, x, y):
    side = shortest(gains, xp.array([x, xp.sin(y)]))
    return xp.where(x > 0.0, side, -side)


GAINS = Gains((1.0, 2.0, 0.5, -0.3, 1.0, 2.0), 3.0)


@pytest.mark.parametrize("x", [0.4, -0.4])
def test_a_function_calls_another_and_takes_tuples_in_records(x):
    matrix = np.reshape(GAINS.rows, (2, 3))
    expected = math.copysign(3.0, x) * np.linalg.pinv(matrix) @ [x, math.sin(0.7)]
    np.testing.assert_allclose(law(GAINS, x, 0.7), expected, rtol=1e-13)
    np.testing.assert_allclose(natively(law, GAINS, x, 0.7), expected, rtol=1e-13)


def test_tuples_give_floats_of_python_and_no_warnings():
    twice = traceable(lambda vector: (vector * 2.0, vector @ vector, vector / 0.0))
    double, square, beyond = twice((1.0, -2.0))
    assert (double, square, beyond) == ((2.0, -4.0), 5.0, (math.inf, -math.inf))
    assert {type(value) for value in (*double, square, *beyond)} == {float}


def test_arrays_give_arrays_whatever_is_beside_them():
    found = traceable(lambda vector, more: vector + more)(np.ones(2), (1.0, 2.0))
    np.testing.assert_array_equal(found, [2.0, 3.0])


def test_a_plan_checks_numbers_that_it_knows():
    def planned(numbers):
        assert is_known(1.0)
        assert not is_known(numbers[0])
        assert as_number(2) == 2.0
        return as_number(numbers[0])

    program = program_of(lambda numbers: (planned(numbers),), numbers=1)
    assert [result.op for result in program.block.results] == ["in"]
