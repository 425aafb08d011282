"""Scalar functions on arrays or symbols: a small compiler that leaves their source as it is.

`Lifting` evaluates the syntax tree of a scalar function on whatever `Arrays` describe, JAX's arrays
or CasADi's symbols. An ``if`` on plain floats, such as the code of a gait, takes one branch, as in
Python. An ``if`` on arrays evaluates both branches and selects, variable by variable; so does an
early ``return`` or ``break``. A loop is unrolled: its length must not depend on arrays.
"""

import inspect
import operator
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import is_dataclass, replace
from functools import partial
from types import FunctionType, MethodType
from typing import Any

import numpy as np

from tiltsim.arrays.evaluation import Frame
from tiltsim.arrays.values import Arrays, Function, PlainNumberError, rebuilt
from tiltsim_controllers.code.traceable import as_tuples, is_traceable
from tiltsim_controllers.mathematics.scalar import Floats, scalar_functions


class Lifting:
    """Lifts scalar functions to arrays.

    Args:
        arrays: Values that the lifted functions work on.
        guarded: Whether a branch that is not selected gets harmless arguments for divisions and
            roots. Values do not need it; gradients do, as zero times infinity is no number.
        planning: Whether it lifts the plan of a flight, which calls more than scalar code.
            Functions that accept arrays run unchanged; an error that depends on arrays is not
            raised, as the scenario was checked before.
    """

    def __init__(self, arrays: Arrays, *, guarded: bool = False, planning: bool = False) -> None:
        self.arrays, self.guarded, self.planning = arrays, guarded, planning
        self._known = set(scalar_functions())
        self._active: Any = True  # the condition under which the present code runs

    def __call__(self, function: Function) -> Function:
        """The function on arrays; its other arguments may be floats, tuples and records."""

        def lifted(*args: Any, **keywords: Any) -> Any:
            self._active = True
            return self.run(function, args, keywords)

        lifted.__name__ = getattr(function, "__name__", "lifted")
        return lifted

    def run(self, function: Any, args: Iterable[Any], keywords: Mapping[str, Any]) -> Any:
        """Evaluate a function written in Python; a function of arrays runs as it is."""
        if is_traceable(function):
            return as_tuples(function(*args, **keywords))
        return Frame(self, function).call(args, keywords)

    def is_scalar(self, function: FunctionType) -> bool:
        """Whether a function may be lifted."""
        if function not in self._known:
            self._known = set(scalar_functions())  # closures are registered when they are made
        return function in self._known or is_traceable(function)

    def plan(self, function: Function, args: Iterable[Any], keywords: Mapping[str, Any]) -> Any:
        """Call any function, as it is or else lifted."""
        if isinstance(function, partial):
            keywords = {**function.keywords, **keywords}
            return self.plan(function.func, [*function.args, *args], keywords)
        args = list(args)
        try:
            return function(*args, **keywords)
        except TypeError as error:
            source = inspect.unwrap(getattr(function, "__func__", function))
            if hasattr(source, "affine_in"):
                return self.affine(source, inspect.signature(source).bind(*args, **keywords))
            if not isinstance(source, FunctionType):  # of NumPy, or one that caches its results
                raise PlainNumberError(f"{source.__name__}: {error}") from error
            bound = [function.__self__] if isinstance(function, MethodType) else []
            return self.run(source, [*bound, *args], keywords)

    def affine(self, function: Any, bound: inspect.BoundArguments) -> tuple[Any, ...]:
        """The result of a function marked by `affine_in`, from its values at unit vectors."""
        points = [[*point] for point in bound.arguments[function.affine_in]]
        entries = [entry for point in points for entry in point]

        def at(*values: float) -> Floats:
            plain = np.reshape(values, (len(points), -1))
            return np.array(function(**{**bound.arguments, function.affine_in: plain}))

        offset = at(*np.zeros(len(entries)))
        columns = [at(*unit) - offset for unit in np.eye(len(entries))]
        return tuple(offset + self.arrays.vector(entries) @ np.array(columns))

    def attribute(self, record: Any, name: str) -> Any:
        """A field, or a property that may have to be lifted."""
        try:
            return getattr(record, name)
        except TypeError:
            found = inspect.getattr_static(type(record), name)
            if not (self.planning and isinstance(found, property)):
                raise
            return self.run(found.fget, [record], {})

    def apply(self, function: Function, *args: Any) -> Any:
        """A function of ``math``, a builtin or an operator on floats or arrays."""
        arrays = self.arrays
        if any(map(arrays.is_array, args)):
            if self.guarded and self._active is not True and function in arrays.domains:
                *first, last = args
                args = (*first, arrays.where(self._active, last, arrays.domains[function]))
            return arrays.functions.get(function, function)(*args)
        try:
            return function(*args)
        except (ArithmeticError, ValueError):  # where native code has infinity or NaN
            if function is not operator.truediv:
                return np.nan
            with np.errstate(all="ignore"):
                return float(np.divide(*args))

    @contextmanager
    def under(self, condition: Any) -> Iterator[None]:
        """Code that is selected by a condition."""
        before = self._active
        self._active = self.conjunction(before, condition)
        try:
            yield
        finally:
            self._active = before

    def conjunction(self, first: Any, second: Any) -> Any:
        """Both of two conditions, each an array, True or False."""
        if first is True or second is False:
            return second
        if second is True or first is False:
            return first
        return self.arrays.both(first, second)

    def negation(self, condition: Any) -> Any:
        """The opposite of a condition, an array or a plain value."""
        return self.arrays.negated(condition) if self.arrays.is_array(condition) else not condition

    def select(self, condition: Any, yes: Any, no: Any) -> Any:
        """`Arrays.where` for values of any structure."""
        if yes is no:
            return yes
        if isinstance(yes, dict):
            missing = object()
            pairs = {name: (yes.get(name, missing), no.get(name, missing)) for name in yes | no}
            return {
                name: b if a is missing else a if b is missing else self.select(condition, a, b)
                for name, (a, b) in pairs.items()
            }
        if isinstance(yes, tuple | list) or isinstance(no, tuple | list):
            if len(yes) != len(no):
                raise ValueError(f"{len(yes)} or {len(no)} values, as an array decides")
            return rebuilt(yes, (self.select(condition, a, b) for a, b in zip(yes, no)))
        if is_dataclass(yes) and type(yes) is type(no):
            return replace(yes, **self.select(condition, vars(yes), vars(no)))  # type: ignore[type-var]
        if isinstance(yes, str) or yes is None:  # the name of a plan, or nothing known of it
            return no
        if no is None:
            return yes
        constant = not (self.arrays.is_array(yes) or self.arrays.is_array(no))
        if constant and type(yes) is type(no) and yes == no:
            return yes
        return self.arrays.where(condition, yes, no)
