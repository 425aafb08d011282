"""Functions of arrays called by scalar code: as they are, traced and on arrays of JAX."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from tests.natively import natively
from tiltsim.arrays.lifting import Lifting
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.linear import least_norm
from tiltsim_controllers.mathematics.scalar import scalar


class Gains(NamedTuple):
    rows: tuple[float, ...]
    size: float


@traceable
def shortest(gains, desired, columns=3):
    matrix = gains.rows.reshape(-1, columns)
    return gains.size * least_norm(matrix, desired)


@scalar
def law(gains, x, y):
    side = shortest(gains, (x, math.sin(y)))
    if x > 0.0:
        return (*side,)
    return -side[0], -side[1], -side[2]


GAINS = Gains((1.0, 2.0, 0.5, -0.3, 1.0, 2.0), 3.0)


@pytest.mark.parametrize("x", [0.4, -0.4])
def test_scalar_code_calls_a_function_of_arrays(x):
    matrix = np.reshape(GAINS.rows, (2, 3))
    expected = math.copysign(3.0, x) * np.linalg.pinv(matrix) @ [x, math.sin(0.7)]
    np.testing.assert_allclose(law(GAINS, x, 0.7), expected, rtol=1e-13)
    np.testing.assert_allclose(natively(law, GAINS, x, 0.7), expected, rtol=1e-13)


def test_on_arrays_of_jax():
    jax = pytest.importorskip("jax")
    from tiltsim.arrays.jax_arrays import JaxArrays

    with jax.enable_x64(True):
        lifted = Lifting(JaxArrays("float64"))(law)
        found = jax.jit(lambda x: xp.array(lifted(GAINS, x, 0.7)))(-0.4)
    np.testing.assert_allclose(found, law(GAINS, -0.4, 0.7), rtol=1e-13)


def test_scalar_code_gets_floats_of_python_and_no_warnings():
    twice = traceable(lambda vector: (vector * 2.0, vector @ vector, vector / 0.0))
    double, square, beyond = twice((1.0, -2.0))
    assert (double, square, beyond) == ((2.0, -4.0), 5.0, (math.inf, -math.inf))
    assert {type(value) for value in (*double, square, *beyond)} == {float}
