"""Vectors of any fixed length as scalar code: tuples, with every component written out.

A loop would build lists, which are slower in native code by far, and in Python. Native code also
needs the length of a tuple. So the functions are made for a length, once, from the text of one
component.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NamedTuple

from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar


class Vectors(NamedTuple):
    """Scalar functions of vectors of one length."""

    dot: Callable[..., float]  # (a, b): inner product
    scaled: Callable[..., Values]  # (f, a): f a
    add_scaled: Callable[..., Values]  # (a, f, b): a + f b
    product: Callable[..., Values]  # (a, b): component by component
    sizes: Callable[..., Values]  # (a): magnitudes of the components


def written_out(name: str, arguments: str, result: str, **functions: Callable[..., Any]) -> Any:
    """A scalar function of this name whose body returns an expression.

    Args:
        name: distinguishes it from all others
        arguments: names, separated by commas
        result: an expression of these arguments and functions
        functions: scalar functions by their names in the expression
    """
    space: dict[str, Any] = {"__name__": __name__, **functions}
    text = f"def {name}({arguments}):\n    return {result}\n"
    exec(compile(text, __file__, "exec"), space)
    space[name].__source__ = text  # which no file has
    return scalar(space[name])


def tuple_text(components: Iterable[str]) -> str:
    """The text of a tuple of any length, from the texts of its components."""
    return "(" + "".join(f"{component}, " for component in components) + ")"


@cache
def componentwise(
    name: str, arguments: str, component: str, length: int, **functions: Callable[..., Any]
) -> Callable[..., Any]:
    """A scalar function that returns a tuple.

    Args:
        name, arguments, functions: as for `written_out`; the length is added to the name
        component: an expression, ``@`` for the index and ``#`` for an argument's entry, ``[@]``
        length: how many components the result has
    """
    texts = [component.replace("#", "[@]").replace("@", str(i)) for i in range(length)]
    function: Callable[..., Any] = written_out(
        f"{name}_{length}", arguments, tuple_text(texts), **functions
    )
    return function


@cache
def vectors_of(length: int) -> Vectors:
    """The functions of vectors of a length, 1 or more."""
    products = " + ".join(f"a[{i}] * b[{i}]" for i in range(length))
    return Vectors(
        written_out(f"dot_{length}", "a, b", products),
        componentwise("scaled", "f, a", "f * a#", length),
        componentwise("add_scaled", "a, f, b", "a# + f * b#", length),
        componentwise("product", "a, b", "a# * b#", length),
        componentwise("sizes", "a", "abs(a#)", length),
    )


@cache
def entries_of(first: int, count: int) -> Callable[[Vector], Values]:
    """Scalar code that reads ``count`` entries of a vector, which may be a list in native code."""
    entries = tuple_text(f"vector[{i}]" for i in range(first, first + count))
    reads: Callable[[Vector], Values] = written_out(f"entries_{first}_{count}", "vector", entries)
    return reads
