"""Functions of all lanes at once: equal to the C library bit by bit."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from tests.controllers.code.test_programs import same
from tests.natively import machine_code_in_lanes
from tiltsim.engines.machine_code import lane_math
from tiltsim_controllers.code.lane_functions import LANE_FUNCTIONS, PROGRAMS, lane_program
from tiltsim_controllers.code.operations import OPERATIONS
from tiltsim_controllers.code.program import trace_vectors
from tiltsim_controllers.code.tracing import make

SPECIAL = (0.0, -0.0, 1.0, -1.0, 0.5, math.inf, -math.inf, math.nan, 5e-324, 1e-200, 1e6, 1e300)
COUNT = 20_000

pytestmark = pytest.mark.skipif(lane_math(quick=False) != "exact", reason="another C library")


@cache
def rows_for(name):
    rng = np.random.default_rng(7)
    near, sizes = rng.uniform(-1.0, 1.0, COUNT), 10.0 ** rng.uniform(-18.0, 2.0, COUNT)
    if name == "atan2":
        pairs = np.stack([np.append(near, near * sizes), rng.uniform(-1.0, 1.0, 2 * COUNT)], -1)
        return [*pairs.tolist(), *([y, x] for y in SPECIAL for x in SPECIAL)]
    quarters = np.pi / 2 * rng.integers(-50_000, 50_000, COUNT)
    many = [near, 10.0 * near, near * sizes, 1.0 - sizes / 100.0, quarters, quarters + near * 1e-6]
    return [[x] for x in (*np.concatenate(many).tolist(), *SPECIAL)]


@pytest.mark.parametrize("name", LANE_FUNCTIONS)
def test_bits_are_the_c_library_s(name):
    size = 1 + (name == "atan2")
    program = trace_vectors(lambda x: [make(name, *(x[i] for i in range(size)))], {"x": size})
    rows = rows_for(name)
    expected = [[OPERATIONS[name].value(*row)] for row in rows]
    assert same(machine_code_in_lanes(program, 8, functions="exact")(rows), expected)
    assert same(machine_code_in_lanes(program, 4, functions="exact")(rows[-4:]), expected[-4:])


@pytest.mark.parametrize("name", LANE_FUNCTIONS)
def test_the_c_library_is_called_for_few_lanes(name):
    """Where it may round otherwise, and beyond the range; without it some values would differ."""
    program, place = LANE_FUNCTIONS[name]
    names, largest_error = PROGRAMS[program]
    rows = rows_for(name)[:COUNT]
    results = np.array(machine_code_in_lanes(lane_program(program), 8)(rows))
    values, within = results[:, place], np.abs(rows).max(axis=1) <= 1.0
    doubt = 1.0 - results[within, len(names) + place].mean()
    assert doubt == pytest.approx(2.0 * (largest_error - 0.5), rel=0.25)
    expected = np.array([OPERATIONS[name].value(*row) for row in rows])
    assert 0 < (values != expected).sum() < 0.01 * COUNT
    np.testing.assert_allclose(values, expected, rtol=2.3e-16, atol=0.0)


@pytest.mark.parametrize("name", LANE_FUNCTIONS)
def test_quick_values_are_the_c_library_s_to_2e_15(name):
    size = 1 + (name == "atan2")
    program = trace_vectors(lambda x: [make(name, *(x[i] for i in range(size)))], {"x": size})
    rows = rows_for(name)
    expected = np.array([OPERATIONS[name].value(*row) for row in rows])
    found = np.array(machine_code_in_lanes(program, 8, functions="quick")(rows))[:, 0]
    np.testing.assert_allclose(found, expected, rtol=2e-15, atol=2e-15)
    assert (found != expected).any()
