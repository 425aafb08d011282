"""Values that scalar functions are lifted to: arrays of JAX, symbols of CasADi."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from tiltsim.errors import TiltsimError

Function = Callable[..., Any]


class LiftError(TiltsimError):
    """A function that has no form on arrays; the message names function and line."""


class PlainNumberError(LiftError):
    """Code that decides or computes by plain numbers was given an array."""


class Arrays(Protocol):
    """The values that scalar functions are lifted to.

    Attributes:
        is_lazy: Whether one side of a branch alone is computed; such arrays have the methods
            ``side``, ``joined`` and ``keep`` of `tiltsim.arrays.traced_numbers.TracedNumbers`.
    """

    is_lazy: bool

    @property
    def functions(self) -> Mapping[Function, Function]:
        """Counterparts of the functions of ``math`` and of builtins."""

    @property
    def domains(self) -> Mapping[Function, float]:
        """A number in the domain of each function that is defined on a part of the reals only."""

    @property
    def refusals(self) -> tuple[type[Exception], ...]:
        """Exceptions that arrays raise where a plain number is needed."""

    def is_array(self, value: Any) -> bool:
        """Whether a value is known only when the lifted function runs."""

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        """Select by a condition, entry by entry."""

    def vector(self, values: Any) -> Any:
        """Numbers as an array of one dimension."""

    def take(self, values: Any, index: Any) -> Any:
        """The entry of a vector at an index that is an array."""

    def both(self, first: Any, second: Any) -> Any:
        """Conjunction."""

    def either(self, first: Any, second: Any) -> Any:
        """Disjunction."""

    def negated(self, condition: Any) -> Any:
        """Negation."""


def rebuilt(like: Any, values: Iterable[Any]) -> Any:
    """A tuple, list or record as another one, with other values."""
    if hasattr(like, "_fields"):
        return type(like)(*values)
    return list(values) if isinstance(like, list) else tuple(values)
