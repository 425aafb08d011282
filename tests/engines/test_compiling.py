"""Scalar functions as numba reads them, without compiling any."""

from __future__ import annotations

import ast
import inspect
import textwrap

from numba.core.bytecode import ByteCode, FunctionIdentity
from numba.core.interpreter import Interpreter

import tiltsim.laws.assembling  # noqa: F401  defines the scalar functions
from tests.tracing import untraced
from tiltsim_controllers.mathematics.scalar import scalar_functions


def test_every_scalar_function_is_translated():
    for function in scalar_functions():
        identity = FunctionIdentity.from_function(function)
        translate = untraced(Interpreter(identity).interpret)
        assert translate(ByteCode(identity)).blocks, function


def test_slices_of_tuples_have_constant_bounds():
    """Numba types a slice of a tuple by its bounds, and does not evaluate them."""
    for function in scalar_functions():
        if function.__module__.partition(".")[0] not in {"tiltsim", "tiltsim_controllers"}:
            continue  # of another test, whose file may be gone
        text = getattr(function, "__source__", None) or inspect.getsource(function)
        tree = ast.parse(textwrap.dedent(text))
        slices = [node for node in ast.walk(tree) if isinstance(node, ast.Slice)]
        bounds = [bound for s in slices for bound in (s.lower, s.upper) if bound is not None]
        assert all(isinstance(bound, ast.Constant | ast.Name) for bound in bounds), function
