"""Parameter records: one declaration read by name in Python and in native code.

A record is a ``NamedTuple`` whose fields are floats or further records. Flattened, it fills the
head of MuJoCo's ``userdata``, so the parameters of a flight are part of its state. Through
`record_dtype` the same numbers are a struct whose fields native code reads by the same names.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np

Record = TypeVar("Record", bound=tuple[Any, ...])


def flatten(record: Iterable[Any]) -> Iterator[float]:
    """Yield the floats of a record in the order of declaration, nested records in place."""
    for value in record:
        if isinstance(value, tuple):
            yield from flatten(value)
        else:
            yield float(value)


def unflatten(record_type: type[Record], values: Iterable[float]) -> Record:
    """Rebuild a record of type ``record_type`` from its floats; the inverse of `flatten`."""
    record: Record = _take(record_type, iter(values))
    return record


def slotted(record: Any) -> Any:
    """Return the same fields in an object with slots, which Python reads several times faster.

    For the parameters of a controller that is evaluated a hundred thousand times.
    """
    if not isinstance(record, tuple):
        return record
    fields: tuple[str, ...] = record._fields  # type: ignore[attr-defined]
    view = type(type(record).__name__, (), {"__slots__": fields})()
    for name, value in zip(fields, record):
        setattr(view, name, slotted(value))
    return view


def make_record_type(name: str, **fields: type) -> Any:
    """Create a record type with these fields, for records of types known only at run time."""
    made: Any = NamedTuple(name, list(fields.items()))  # type: ignore[misc]
    return made


def _take(record_type: Any, values: Iterator[float]) -> Any:
    return record_type(
        *(
            _take(kind, values) if _is_record(kind) else next(values)
            for kind in _fields(record_type).values()
        )
    )


@cache
def _fields(record_type: type[tuple[Any, ...]]) -> dict[str, Any]:
    """Types by name, cached: resolving them takes longer than computing a flight's metrics."""
    return get_type_hints(record_type)


@cache
def record_dtype(record_type: type[tuple[Any, ...]]) -> np.dtype[np.void]:
    """Return the structured dtype (all float64, no padding) with the record's field names."""
    return np.dtype(
        [
            (name, record_dtype(kind) if _is_record(kind) else np.float64)
            for name, kind in _fields(record_type).items()
        ]
    )


def record_size(record_type: type[tuple[Any, ...]]) -> int:
    """Return the number of floats in a flattened record."""
    return record_dtype(record_type).itemsize // np.dtype(np.float64).itemsize


def _is_record(kind: type) -> bool:
    return isinstance(kind, type) and issubclass(kind, tuple)
