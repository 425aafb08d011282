"""Every operation of a program: the same bits in Python and machine code; folding; messages."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from tests.natively import machine_code, machine_code_in_lanes
from tiltsim_controllers.code.arrays import take
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.code.operations import CONDITIONS, OPERATIONS
from tiltsim_controllers.code.program import trace_vectors
from tiltsim_controllers.code.python_source import python_function, python_source
from tiltsim_controllers.code.tracing import make, remainder

SPECIAL = (0.0, -0.0, 1.0, -2.5, math.inf, -math.inf, math.nan, 1e308, -1e-300, 800.0)


def arguments_of(op):
    """Number of arguments of an operation."""
    if op in ("where", "uniform"):
        return 3
    ufunc = OPERATIONS[op].ufunc
    return ufunc.nin


def same(first, second):
    """Whether numbers are equal bit by bit; any NaN equals any other."""
    first, second = np.array(first), np.array(second)
    nan = np.isnan(first) & np.isnan(second)
    return bool(((first.view("u8") == second.view("u8")) | nan).all())


@pytest.mark.parametrize("op", OPERATIONS)
def test_python_and_machine_code_agree_in_every_bit(op):
    size = arguments_of(op)
    program = trace_vectors(lambda x: [make(op, *(x[i] for i in range(size)))], {"x": size})
    law, native, value = python_function(program), machine_code(program), OPERATIONS[op].value
    rng = np.random.default_rng(1)
    points = [*product(SPECIAL, repeat=size), *(3.0 * rng.normal(size=(100, size))).tolist()]
    for x in points:
        result = law(list(x))
        assert same(result, native(x)), (op, x)
        if op not in ("and", "or", "not", "where"):  # of conditions, here of numbers
            assert same(result, [float(value(*x))]), (op, x)
    for x, found in zip(points, machine_code_in_lanes(program, 8)(points), strict=True):
        assert same(law(list(x)), found), (op, x)


def test_python_s_remainder():
    program = trace_vectors(lambda x: [remainder(x[0], x[1])], {"x": 2})
    law, native = python_function(program), machine_code(program)
    rng = np.random.default_rng(2)
    for a, b in [
        *product((0.0, -0.0, 3.0, -3.0, 2.5), (2.0, -2.0, 0.7)),
        *rng.normal(size=(99, 2)),
    ]:
        assert same(law([a, b]), [float(a) % float(b)]), (a, b)
        assert same(law([a, b]), native([a, b]))


def test_an_operation_that_occurs_twice_is_evaluated_once():
    def twice(x):
        return [make("sin", x[0]) + 1.0, make("sin", x[0]) * 2.0]

    program = trace_vectors(twice, {"x": 1})
    assert [o.op for o in program.block.operations] == ["in", "sin", "add", "mul"]


def test_operations_that_no_result_needs_are_left_out():
    def wasteful(x):
        make("exp", x[1])
        return [x[0] * 2.0]

    assert len(trace_vectors(wasteful, {"x": 2})) == 2


def test_neutral_numbers_fold():
    def folded(x):
        a, chosen = x[0], make("where", 1.0, x[0], 2.0)
        back = make("neg", -a)
        return [0.0 + a, a - 0.0, a * 1.0, a / 1.0, back, 0.0 * a, a**2.0, chosen]

    program = trace_vectors(folded, {"x": 1})
    assert [o.op for o in program.block.operations] == ["in", "mul"]
    assert python_function(program)([3.0]) == (3.0, 3.0, 3.0, 3.0, 3.0, 0.0, 9.0, 3.0)


def test_signs_go_on_to_sums():
    program = trace_vectors(lambda x: [x[2] + -x[0] * x[1], x[2] - x[0] / -x[1]], {"x": 3})
    operations = [o.op for o in program.block.operations if o.op not in ("in", "neg")]
    assert operations == ["mul", "sub", "div", "add"]
    assert "neg" not in [o.op for o in program.block.operations]
    assert python_function(program)([3.0, 2.0, 1.0]) == (-5.0, 2.5)


def test_opposite_zeros_are_no_common_operation():
    program = trace_vectors(lambda x: [make("copysign", x[0], z) for z in (0.0, -0.0)], {"x": 1})
    assert python_function(program)([2.0]) == (2.0, -2.0)


TABLE = (1.0, 4.0, 9.0, 16.0)
LOOKED_UP = ((0.0, 1.0), (1.9, 4.0), (3.0, 16.0), (7.0, 16.0), (-2.0, 1.0), (math.inf, 16.0))


@pytest.mark.parametrize(("index", "entry"), LOOKED_UP)
def test_an_index_is_rounded_down_and_limited(index, entry):
    def look_up(x):
        own = [value * x[1] for value in TABLE]
        return [take(TABLE, x[0]), take(own, x[0]), take(x[2:], x[0])]

    program = trace_vectors(look_up, {"x": 6})
    x = [index, 1.0, *TABLE]
    assert python_function(program)(x) == (entry, entry, entry)
    assert machine_code(program)(x) == [entry, entry, entry]
    assert take(TABLE, index) == entry
    x[0] = math.nan
    assert all(map(math.isnan, machine_code(program)(x)))
    others = [[one, 1.0, 1.0, 4.0, 9.0, 16.0] for one, _ in LOOKED_UP]
    found = machine_code_in_lanes(program, 4)([*others, x])
    assert found[:-1] == [[looked_up] * 3 for _, looked_up in LOOKED_UP]
    assert all(map(math.isnan, found[-1]))


def test_parts_of_an_input_are_parts_of_its_memory():
    program = trace_vectors(lambda x, y: [x[1:][-1], y[2:4][1], len(x[5:])], {"x": 3, "y": 6})
    assert python_function(program)([0, 1, 2], [3, 4, 5, 6, 7, 8]) == (2, 6, 0.0)
    with pytest.raises(IndexError, match="entry 3 of an input of size 3"):
        trace_vectors(lambda x: [x[3]], {"x": 3})


def truth(x):
    return [x[0] if x[0] > 1.0 else x[1]]


def plain(x):
    return [math.sin(x[0])]


def filled(x):
    np.zeros(2)[0] = x[0]


def whole(x):
    return [TABLE[x[0]]]


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (truth, "`return [x[0] if x[0] > 1.0 else x[1]]`: a traced number has no truth value yet;"),
        (plain, "`return [math.sin(x[0])]`: a traced number has no value yet; use xp.sin"),
        (filled, "`np.zeros(2)[0] = x[0]`: a traced number has no value yet; use xp.sin"),
        (whole, "`return [TABLE[x[0]]]`: a traced number is no index; write take"),
    ],
)
def test_code_that_needs_a_known_number_is_named_with_its_line(function, message):
    with pytest.raises(TraceError) as caught:
        trace_vectors(function, {"x": 2})
    line = function.__code__.co_firstlineno + 1
    assert str(caught.value).startswith(f"{__file__}:{line}: {message}")


def test_a_number_that_leaves_its_trace_is_refused():
    kept = []
    trace_vectors(lambda x: kept.append(x[0]) or [1.0], {"x": 1})
    with pytest.raises(TraceError, match="a traced number outside its trace"):
        kept[0] + 1.0


def test_lines_of_the_source_name_the_code_that_made_them():
    source = python_source(trace_vectors(lambda x: [x[0] * 2.0], {"x": 1}))
    assert "# test_programs.py:" in source


def test_conditions_are_results_as_numbers():
    program = trace_vectors(lambda x: [make(op, x[0], x[1]) for op in ("lt", "ge")], {"x": 2})
    assert python_function(program)([1.0, 2.0]) == (1.0, 0.0)
    assert set(OPERATIONS) >= CONDITIONS
