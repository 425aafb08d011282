"""Arithmetic in sweep files: right where it is allowed, refused in words where it is not."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tiltsim.sweeps.expressions import evaluate, names

numbers = st.floats(-1e3, 1e3)


@given(numbers, numbers, numbers)
def test_arithmetic_agrees_with_python(a, b, c):
    values = {"a": a, "gait.period": b, "gait.angles[1]": c}
    assert evaluate("2 * a - gait.period / 4 + -gait.angles[1]", values) == 2 * a - b / 4 + -c
    assert evaluate("max(a, 0) ** 2 + sin(pi * a)", values) == max(a, 0) ** 2 + math.sin(
        math.pi * a
    )


def test_names_are_found_with_dots_and_positions():
    assert names("u * gait.angles[1] + sqrt(pi)") == {"u", "gait.angles[1]"}


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        ("u +", "not an arithmetic"),
        ("v", "v is unknown; known: pi, u"),
        ("u.real", "u.real is unknown"),
        ("open('x')", "open() is unknown"),
        ("().__class__", "unknown"),
        ("[u]", "not allowed"),
        ("u if u else 1", "not allowed"),
        ("'u'", "not allowed"),
        ("True", "not allowed"),
        ("1 / 0", "divides by zero"),
        ("(-1) ** 0.5", "not a real number"),
        ("1e300 * 1e300", "not a real number"),
        ("9 ** 9 ** 9", "too large"),
        ("sqrt(u - 2)", "has no value: sqrt(-1) is not defined"),
        ("sin(1e400)", "has no value: sin(inf) is not defined"),
        ("sin(1, 2)", "wrong type of argument"),
        ("min(u)", "wrong type of argument"),
    ],
)
def test_everything_else_is_refused(expression, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        evaluate(expression, {"u": 1.0})
