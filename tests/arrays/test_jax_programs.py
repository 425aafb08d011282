"""Functions as programs in JAX."""

import numpy as np
import pytest

from tiltsim.arrays import jax_programs
from tiltsim.arrays.flying import double_precision
from tiltsim.arrays.jax_programs import InJax
from tiltsim_controllers.code.arrays import take, traceable

jax = pytest.importorskip("jax")

LONG = 100


@pytest.fixture(autouse=True)
def _double_precision():
    with double_precision():
        yield


@pytest.mark.parametrize("merges", [False, True])
def test_a_long_program_is_compiled_in_segments_unless_xla_merges_loops(merges, monkeypatch):
    """XLA would compute a value for each of its uses again."""
    monkeypatch.setattr(jax_programs, "recomputes", lambda: not merges)

    @traceable
    def chained(state):
        for _ in range(12):
            size = state @ state
            state = size * state[[1, 2, 0]]
        return state

    def fly(state):
        return jax.vmap(lambda column: InJax("float64")(chained)([*column]), in_axes=1)(state)

    start = np.linspace(0.5, 0.6, 12).reshape(3, 4)
    lowered = jax.jit(fly).lower(start)
    assert lowered.as_text().count("call @call") == (0 if merges else 2)
    expected = [chained(column) for column in start.T.tolist()]
    np.testing.assert_allclose(np.transpose(lowered.compile()(start)), expected, rtol=1e-12)


def test_all_look_ups_in_a_table_are_in_one_constant():
    table = tuple(map(float, range(LONG)))

    def between(place):
        return (take(table, place) + take(table[1:], place),)

    program = jax.make_jaxpr(InJax("float64")(between))(2.0)
    assert [constant.shape for constant in program.consts] == [(LONG,)]
    assert InJax("float64")(between)(jax.numpy.asarray(2.0)) == (5.0,)


def test_a_result_that_no_array_decides_is_a_plain_number():
    run = InJax("float64")(lambda known, unknown: (2.0 * known, known * unknown))
    constant, product = run(1.5, jax.numpy.asarray(2.0))
    assert (constant, type(constant)) == (3.0, float)
    assert (product, product.dtype) == (3.0, np.float64)
