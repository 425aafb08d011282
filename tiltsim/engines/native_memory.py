"""Memory access by address in compiled code."""

from __future__ import annotations

from typing import Any

from numba import carray, types
from numba.extending import intrinsic, register_jitable

from tiltsim.engines.compiling import INNER


def _cast(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))


@intrinsic
def floats_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to floats."""
    return types.CPointer(types.float64)(address), _cast


@intrinsic
def bytes_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to anything."""
    return types.voidptr(address), _cast


@intrinsic
def addresses_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to addresses."""
    return types.CPointer(types.intp)(address), _cast


@intrinsic
def integers_at(_typing: Any, address: Any) -> Any:
    """An address as a pointer to C integers."""
    return types.CPointer(types.int32)(address), _cast


@register_jitable(**INNER)
def array_at(place, size):  # type: ignore[no-untyped-def]
    """The array of floats whose address is stored at a place in mjData."""
    return carray(floats_at(addresses_at(place)[0]), (size,))
