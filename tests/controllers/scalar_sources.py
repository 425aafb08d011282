"""The scalar functions' own source, run on symbols."""

from __future__ import annotations

import math
from types import FunctionType, SimpleNamespace

import sympy

from tiltsim_controllers.mathematics.scalar import scalar_functions


def rebuilt(make, replaced=()):
    """Every scalar function remade by ``make``, calling the remade ones in place of its own."""
    known = dict(replaced)
    for function in scalar_functions():
        if function.__closure__ is not None:
            continue  # of a layer around a law; no other scalar code calls it
        scope = dict(function.__globals__)
        for name in function.__code__.co_names:
            value = scope.get(name)
            if isinstance(value, FunctionType | type(math.sin)) and value in known:
                scope[name] = known[value]
        copied = FunctionType(function.__code__, scope, function.__name__, function.__defaults__)
        known[function] = make(copied)
    return known


def symbolic():
    """Every scalar function with sympy's functions for those of ``math``."""
    names = ("sin", "cos", "tan", "sqrt")
    return rebuilt(lambda f: f, {getattr(math, name): getattr(sympy, name) for name in names})


def fields(**values):
    """A stand-in for a record, with symbols for numbers."""
    return SimpleNamespace(**values)
