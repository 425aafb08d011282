"""Scalar functions on JAX's arrays have the values that they have in Python."""

from __future__ import annotations

from math import isfinite

import numpy as np
import pytest

from tests.arrays.recorded_calls import called_rows, described, flown, frozen, mapped, record
from tests.laws.test_laws import LAWS
from tiltsim.arrays import jax_programs
from tiltsim.arrays.flying import double_precision
from tiltsim.arrays.jax_arrays import JaxArrays
from tiltsim.arrays.jax_programs import InJax
from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.values import LiftError
from tiltsim.closed_loop.choices import CHOICES
from tiltsim.engines import sample_evaluation
from tiltsim_controllers.mathematics.scalar import scalar

jax = pytest.importorskip("jax")

CHANGE = 1e-3
"""Relative change of recorded arguments: their values must not be in the lifted function."""

ROUNDING = 1e-12
"""Relative to the largest of the values: a few hundred roundings."""


@pytest.fixture(autouse=True)
def _as_when_compiled(monkeypatch):
    """Arrays have 64 bits, and none becomes a number, as if its value were not known yet.

    So functions are evaluated operation by operation: to trace them for a batch takes ten times as
    long, to compile them longer still.
    """

    def refused(_array):
        raise TypeError("an array becomes a number")

    with double_precision():
        array = type(jax.numpy.zeros(()))
        for name in ("__bool__", "__int__", "__float__", "__index__"):
            monkeypatch.setattr(array, name, refused)
        yield


def numbers(values):
    """The numbers of nested tuples, lists and records; NaN where there is none."""
    if isinstance(values, tuple | list):
        for value in values:
            yield from numbers(value)
    else:
        yield np.nan if values is None else values


COUNTS = {"rows", "size", "start", "offset"}
"""Arguments that choose an entry or a length, as `CHOICES` among the fields."""


def varies(value, name):
    return isinstance(value, float) and isfinite(value) and name not in CHOICES | COUNTS


def changed(change, function, arguments):
    """The arguments with every number changed by ``change(number, name of its field)``."""
    names = function.__code__.co_varnames
    return [mapped(change, argument, name) for argument, name in zip(arguments, names)]


def fields(function, arguments):
    """Every number of the arguments with the name of its field."""
    found = []
    changed(lambda number, name: found.append((number, name)), function, arguments)
    return found


LONG = 100
"""Entries from which a tuple is a table, whose entries are looked up."""


def with_tables(value):
    """A value whose tables are one array each: to join one at each look-up takes minutes."""
    if hasattr(value, "_fields"):
        return type(value)(*map(with_tables, value))
    if isinstance(value, tuple | list):
        entries = [with_tables(entry) for entry in value]
        return jax.numpy.asarray(entries) if len(entries) > LONG else type(value)(entries)
    return value


class Compared(Lifting):
    """Lifts functions, and compares each of them, at its first call, with its result in Python."""

    def __init__(self):
        super().__init__(JaxArrays("float64"))
        self.compared, self.wrong = set(), {}

    def run(self, function, args, keywords):
        args, new = [*args], self.is_scalar(function) and described(function) not in self.compared
        if keywords or not new:
            return super().run(function, args, keywords)
        before = [*map(frozen, args)]
        lifted = super().run(function, args, keywords)
        self.compare(function, before, lifted)
        return lifted

    def compare(self, function, args, lifted):
        try:
            expected = np.array([float(v) for v in numbers(function(*args))])
        except (ArithmeticError, ValueError):  # where arrays have NaN
            return
        self.compared.add(described(function))
        result = np.array([np.asarray(value, float) for value in numbers(lifted)])
        size = np.abs(expected[np.isfinite(expected)]).max(initial=0.0)
        if not np.allclose(result, expected, rtol=ROUNDING, atol=ROUNDING * size, equal_nan=True):
            self.wrong[name_of(function)] = f"{result} instead of {expected}"


def name_of(function):
    return f"{function.__module__}.{function.__qualname__}"


def differences(lifting, function, arguments, rng):
    """Lift a function near its arguments, and note an error; ``lifting`` notes wrong values."""
    found = np.array([value for value, name in fields(function, arguments) if varies(value, name)])
    row = found * (1.0 + CHANGE * rng.standard_normal(len(found)))
    following = iter(map(jax.numpy.asarray, row))
    lifted = changed(lambda v, n: next(following) if varies(v, n) else v, function, arguments)
    try:
        lifting(function)(*map(with_tables, lifted))
    except (LiftError, TypeError) as error:
        lifting.wrong[name_of(function)] = str(error)


def all_differences(flights):
    """Compare what the flights call; returns failures by function, and the functions called."""
    calls, lifting, rng = {}, Compared(), np.random.default_rng(0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sample_evaluation, "_in_python", called_rows)
        for tables, simulation in flights:
            record(lambda: flown(tables, **simulation).metrics(), calls)  # noqa: B023
    for function in calls:  # callers first: most functions that they call are compared with them
        if described(function) not in lifting.compared:
            differences(lifting, function, calls[function], rng)
    return lifting.wrong, calls


def test_functions_of_a_controller_have_the_same_values_on_arrays():
    wrong, calls = all_differences([(LAWS["attitude_altitude"], {"plant": "thesis"})])
    assert wrong == {}
    assert len(calls) > 20


@pytest.mark.parametrize("merges", [False, True])
def test_a_long_program_is_compiled_in_segments_unless_xla_merges_loops(merges, monkeypatch):
    """XLA would compute a value for each of its uses again."""
    monkeypatch.setattr(jax_programs, "recomputes", lambda: not merges)

    @scalar
    def chained(state):
        for _ in range(12):
            x, y, z = state
            size = x * x + y * y + z * z
            state = size * y, size * z, size * x
        return state

    def fly(state):
        return jax.vmap(lambda column: InJax("float64")(chained)([*column]), in_axes=1)(state)

    start = np.linspace(0.5, 0.6, 12).reshape(3, 4)
    lowered = jax.jit(fly).lower(start)
    assert lowered.as_text().count("call @call") == (0 if merges else 2)
    expected = [chained(column) for column in start.T.tolist()]
    np.testing.assert_allclose(np.transpose(lowered.compile()(start)), expected, rtol=ROUNDING)


def test_all_look_ups_in_a_table_are_in_one_constant():
    @scalar
    def between(place, table):
        return table[place] + table[place + 1]

    numbers = tuple(map(float, range(LONG)))
    lifted = Lifting(JaxArrays("float64"))(between)
    program = jax.make_jaxpr(lambda place: lifted(place, numbers))(2)
    assert [table.shape for table in program.consts] == [(LONG,)]
