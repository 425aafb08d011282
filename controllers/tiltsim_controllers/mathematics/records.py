"""Parameter records: one declaration read by name in Python and in native code.

A record is a ``NamedTuple`` whose fields are floats, vectors (`vector_of`) or further records.
Flattened, it fills the head of MuJoCo's ``userdata``, so the parameters of a flight are part of its
state. Through `record_dtype` the same numbers are a struct whose fields native code reads by the
same names.
"""

from collections.abc import Iterable, Iterator
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, get_type_hints

import numpy as np

Record = TypeVar("Record", bound=tuple[Any, ...])


def leaves(record: Iterable[Any]) -> list[Any]:
    """The numbers of a record in the order of declaration, nested records in place."""
    found: list[Any] = []
    for value in record:
        if isinstance(value, tuple):
            found += leaves(value)
        else:
            found.append(value)
    return found


def flatten(record: Iterable[Any]) -> Iterator[float]:
    """The numbers of a record as floats, in order."""
    return map(float, leaves(record))


def paths_of(record_type: type[tuple[Any, ...]]) -> Iterator[str]:
    """The dotted names of the numbers of a record, in order; entries of vectors have an index."""
    for name, kind in _fields(record_type).items():
        if _is_record(kind):
            yield from (f"{name}.{inner}" for inner in paths_of(kind))
        elif issubclass(kind, tuple):
            yield from (f"{name}[{index}]" for index in range(kind.length))
        else:
            yield name


def unflatten(record_type: type[Record], values: Iterable[float]) -> Record:
    """Rebuild a record of type ``record_type`` from its floats; the inverse of `flatten`."""
    return _take(record_type, iter(values))


def make_record_type(name: str, **fields: type) -> Any:
    """Create a record type with these fields, for records of types known only at run time."""
    return NamedTuple(name, list(fields.items()))


def changed_record(record: Any, **fields: type) -> Any:
    """A record type whose fields are partly of other types."""
    return make_record_type(record.__name__, **{**_fields(record), **fields})


@cache
def vector_of(length: int) -> type:
    """The type of a field of ``length`` floats: a tuple in Python, an array in native code."""
    return type(f"Vector{length}", (tuple,), {"length": length})


if TYPE_CHECKING:
    Vector2 = Any
    Vector3 = Any
    Matrix3 = Any
else:  # types of fields, which are arrays in NumPy functions; a matrix is given row by row
    Vector2, Vector3, Matrix3 = vector_of(2), vector_of(3), vector_of(9)


def _take(kind: Any, values: Iterator[float]) -> Any:
    if _is_record(kind):
        return kind(*(_take(field, values) for field in _fields(kind).values()))
    if issubclass(kind, tuple):
        return tuple(islice(values, kind.length))
    return next(values)


@cache
def _fields(record_type: type[tuple[Any, ...]]) -> dict[str, Any]:
    """Types by name, cached: resolving them takes longer than computing a flight's metrics."""
    return get_type_hints(record_type)


@cache
def record_dtype(record_type: type[tuple[Any, ...]]) -> np.dtype[np.void]:
    """Return the structured dtype (all float64, no padding) with the record's field names."""
    return np.dtype([(name, *_format(kind)) for name, kind in _fields(record_type).items()])


def _format(kind: Any) -> tuple[Any, ...]:
    if _is_record(kind):
        return (record_dtype(kind),)
    return (np.float64, (kind.length,)) if issubclass(kind, tuple) else (np.float64,)


def record_size(record_type: type[tuple[Any, ...]]) -> int:
    """Return the number of floats in a flattened record."""
    return record_dtype(record_type).itemsize // np.dtype(np.float64).itemsize


def _is_record(kind: type) -> bool:
    return issubclass(kind, tuple) and hasattr(kind, "_fields")
