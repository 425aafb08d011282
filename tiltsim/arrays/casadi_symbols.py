"""CasADi's symbols for lifted functions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property, reduce
from typing import Any, Final

from tiltsim.arrays.values import Function
from tiltsim.system.optional import optional_package


class CasadiSymbols:
    """Symbols (``casadi.SX``) as `tiltsim.arrays.values.Arrays`."""

    domains: Final[Mapping[Function, float]] = {}

    def __init__(self) -> None:
        self.casadi = casadi = optional_package("casadi", "tiltsim.symbolic", "'tiltsim[casadi]'")
        self.where, self.both = casadi.if_else, casadi.logic_and
        self.either, self.negated = casadi.logic_or, casadi.logic_not

    @property
    def refusals(self) -> tuple[type[Exception], ...]:
        """What symbols raise where a plain number is needed; CasADi has no error for that."""
        return ()

    def is_array(self, value: Any) -> bool:
        """Whether a value is a symbol or an expression of symbols."""
        return isinstance(value, self.casadi.SX)

    def vector(self, values: Any) -> Any:
        """Numbers as a column."""
        return self.casadi.vertcat(*values)

    def take(self, values: Any, index: Any) -> Any:
        """The entry of a vector at an index that is an expression."""
        first, *others = values
        entries = enumerate(others, start=1)
        return reduce(lambda found, e: self.where(index == e[0], e[1], found), entries, first)

    def separately(self, function: Function, args: Any, key: Any) -> Any:
        """Call a function; a symbol that is used twice is computed once."""
        return function(*args)

    @cached_property
    def functions(self) -> Mapping[Function, Function]:
        """Counterparts of the functions of ``math`` and of builtins."""
        casadi = self.casadi

        def smallest(*values: Any) -> Any:
            return reduce(lambda a, b: self.where(b < a, b, a), values)

        def largest(*values: Any) -> Any:
            return reduce(lambda a, b: self.where(b > a, b, a), values)

        def whole(value: Any) -> Any:
            raise TypeError("whole numbers, as random ones, have no symbolic form")

        names = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "floor", "exp")
        more = ("log", "hypot", "copysign", "fmod", "fabs")
        same = {getattr(math, name): getattr(casadi, name) for name in (*names, *more)}
        same[math.isfinite] = lambda value: casadi.fabs(value) < math.inf
        same[math.isnan] = lambda value: value != value
        return same | {abs: casadi.fabs, min: smallest, max: largest, int: whole, float: _same}


def _same(value: Any) -> Any:
    return value
