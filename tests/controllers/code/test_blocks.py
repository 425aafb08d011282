"""Branches, loops, arrays: alike in Python, machine code, NumPy and JAX."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.controllers.code.test_programs import SPECIAL, same
from tests.natively import machine_code, machine_code_in_lanes
from tiltsim_controllers.code import jax_function
from tiltsim_controllers.code.arrays import branch, flatten, repeat, take, xp
from tiltsim_controllers.code.casadi_function import casadi_function
from tiltsim_controllers.code.jax_function import results_in_jax
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.code.program import trace_vectors
from tiltsim_controllers.code.python_source import python_function, python_source

TABLE = np.array([1.0, 4.0, 9.0, 16.0])


def everything(x):
    """A matrix product, domain errors, tables, a branch and a search."""
    A = xp.array([[x[0], 0.0], [0.5, x[1]]])
    root = xp.sqrt(x[0] - x[1])
    looked_up = take(TABLE, x[2])
    lazy = branch(
        x[1] > 0.0,
        lambda: xp.array([xp.log(x[1]), x[0]]),
        lambda: xp.array([xp.exp(x[0]), 1.0 / (x[0] - 2.0)]),
    )

    def halve(_, low, high):
        middle = 0.5 * (low + high)
        below = middle * middle < 2.0
        return xp.where(below, middle, low), xp.where(below, high, middle)

    low, high = repeat(60, halve, 0.0 * x[0], 2.0 + 0.0 * x[0], until=lambda a, b: b - a < 1e-9)
    numbers = xp.array([root, looked_up, low, high, xp.floor(x[0]), xp.arctan2(x[0], x[1])])
    return xp.concatenate([A @ x[:2], numbers, lazy, xp.minimum(x, 0.5), xp.clip(x, -1.0, 1.0)])


def nested(x):
    """A search in a branch in a loop, an early end, conditions of conditions."""

    def newton(_, c):
        return (0.5 * (c + 2.0 / c),)

    def body(i, a, b):
        step = branch(
            (a > b) & (i >= 1.0) | xp.isnan(a),
            lambda: repeat(5, newton, a + i)[0],
            lambda: xp.sin(a) * 2.0,
        )
        return a + 0.1 * step, xp.where(xp.isfinite(step) & (b < 3.0), b + 0.5, b)

    a, b = repeat(x[2], body, x[0], x[1], until=lambda a, b: a > 50.0)
    return xp.array([a, b, xp.sin(x[0])])  # a sine that the loop has also computed


def traced(function, size):
    def on_vector(x):
        return list(function(xp.array([x[i] for i in range(size)])).ravel())

    return trace_vectors(on_vector, {"x": size})


def points(function):
    rng = np.random.default_rng(0)
    own = [*(3.0 * rng.normal(size=(200, 3)))]
    if function is nested:
        return [np.array([a, b, abs(c) + 2.0]) for a, b, c in own]
    return own + [np.array([a, b, c]) for a in SPECIAL for b in SPECIAL for c in SPECIAL[:4]]


@pytest.mark.parametrize("function", [everything, nested])
def test_python_machine_code_and_numpy_agree(function):
    program = traced(function, 3)
    law, native = python_function(program), machine_code(program)
    for x in points(function):
        result = law(x.tolist())
        assert same(result, native(x)), x
        with np.errstate(all="ignore"):
            eager = np.asarray(function(x), float)
        if not np.isfinite(x).all():
            continue  # zeros of matrices hide infinity and NaN from programs
        np.testing.assert_allclose(eager, result, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("lanes", [2, 4, 8])
@pytest.mark.parametrize("function", [everything, nested])
def test_lanes_that_take_different_ways_keep_the_bits_of_each(function, lanes):
    program = traced(function, 3)
    law, rows = python_function(program), [x.tolist() for x in points(function)]
    for x, found in zip(rows, machine_code_in_lanes(program, lanes)(rows), strict=True):
        assert same(law(x), found), x


@pytest.mark.parametrize("in_segments", [False, True])
@pytest.mark.parametrize("function", [pytest.param(everything, marks=pytest.mark.slow), nested])
def test_a_program_has_the_same_values_in_jax(function, in_segments, monkeypatch):
    jax = pytest.importorskip("jax")
    monkeypatch.setattr(jax_function, "SEGMENT", 7)
    program = traced(function, 3)
    law = python_function(program)

    def run(x):
        return jax.numpy.stack(results_in_jax(program, [x], "float64", in_segments=in_segments))

    with jax.enable_x64(True):
        compiled = jax.jit(run)
        for x in points(function)[:20]:
            np.testing.assert_allclose(compiled(x), law(x.tolist()), rtol=1e-12, atol=1e-12)
        assert jax.jit(jax.jacfwd(run))(np.array([1.0, 0.5, 3.0])).shape[1] == 3


def test_loops_of_a_known_count_and_tables_have_derivatives_in_jax():
    jax = pytest.importorskip("jax")

    def search(x):
        grown = repeat(4, lambda i, a: (a * x[0] + i,), 1.0, until=lambda a: a > 30.0)[0]
        return [grown + take((1.0, 4.0, 9.0), x[1])]

    program = trace_vectors(search, {"x": 2})

    @jax.jit
    def run(x):
        return results_in_jax(program, [x], "float64", in_segments=False)[0]

    with jax.enable_x64(True):
        start = np.array([2.0, 1.5])
        # With x0 = a it is a^4 + a^2 + 2 a + 3, and the entry 4 of the table.
        assert run(start) == python_function(program)([2.0, 1.5])[0] == 27.0 + 4.0
        assert jax.jit(jax.grad(run))(start).tolist() == [38.0, 0.0]
        assert run(np.array([4.0, 0.0])) == python_function(program)([4.0, 0.0])[0]


def test_only_one_side_of_a_branch_is_evaluated():
    def one_side(x):
        return [branch(x[0] > 0.0, lambda: xp.sqrt(x[0]), lambda: 1.0 / x[1])]

    program = trace_vectors(one_side, {"x": 2})
    text = python_source(program)
    assert text.index("if t") < text.index("sqrt(") < text.index("else:") < text.index(" / ")
    law = python_function(program)
    assert law([4.0, 0.0]) == (2.0,)
    assert machine_code(program)([-1.0, 0.0]) == [math.inf]


def test_a_known_condition_leaves_no_branch():
    program = trace_vectors(lambda x: [branch(True, lambda: x[0], lambda: x[1])], {"x": 2})
    assert [o.op for o in program.block.operations] == ["in"]


def test_a_number_that_leaves_its_branch_is_refused():
    def leaks(x):
        kept = []
        branch(x[0] > 0.0, lambda: kept.append(xp.sin(x[1])) or x[0], lambda: x[1])
        return [kept[0]]

    with pytest.raises(TraceError, match=r"a number leaves the branch or loop that computes it"):
        trace_vectors(leaks, {"x": 2})


def test_sides_of_different_shapes_are_refused():
    def unequal(x):
        return branch(x[0] > 0.0, lambda: (x[0], x[1]), lambda: (x[0],))

    with pytest.raises(TraceError, match="results of different shapes; return the same from both"):
        trace_vectors(unequal, {"x": 2})


def test_functions_that_cannot_be_traced_are_named():
    with pytest.raises(TraceError, match=r"numpy.sinh cannot be traced"):
        traced(lambda x: xp.sinh(x), 2)


def test_numbers_of_nested_values_are_put_back_in_their_places():
    value = (np.arange(6.0).reshape(2, 3), [1.0, (2.0,)])
    leaves, build = flatten(value)
    assert leaves == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 1.0, 2.0]
    matrix, rest = build([10.0 * leaf for leaf in leaves])
    np.testing.assert_array_equal(matrix, 10.0 * value[0])
    assert rest == [10.0, (20.0,)]


@pytest.mark.parametrize("function", [everything, nested])
def test_casadi_agrees(function):
    pytest.importorskip("casadi")
    turns = 4.0

    def fixed(x):
        return function(xp.array([x[0], x[1], turns]))

    program = traced(fixed, 2)
    symbolic, law = casadi_function(program, "law", "y"), python_function(program)
    for x in points(function)[:50]:
        result = symbolic(x[:2]).full().ravel()
        np.testing.assert_allclose(result, law(x[:2].tolist()), rtol=1e-12, atol=1e-12)


def test_a_loop_of_unknown_length_has_no_form_in_casadi():
    pytest.importorskip("casadi")
    with pytest.raises(TraceError, match="the number of turns of a loop has to be known"):
        casadi_function(traced(nested, 3), "law", "y")
