"""Scalar functions as numba reads them, without compiling any."""

from __future__ import annotations

import pytest
from numba.core.bytecode import ByteCode, FunctionIdentity
from numba.core.interpreter import Interpreter

import tiltsim.laws.assembling  # noqa: F401  defines the scalar functions
from tiltsim_controllers.mathematics.scalar import scalar_functions


@pytest.mark.parametrize(
    "function", scalar_functions(), ids=lambda f: f"{f.__module__}.{f.__qualname__}"
)
def test_every_scalar_function_is_translated(function):
    identity = FunctionIdentity.from_function(function)
    assert Interpreter(identity).interpret(ByteCode(identity)).blocks
