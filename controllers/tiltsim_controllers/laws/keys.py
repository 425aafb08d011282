"""Keys of a control law: its parameters in a scenario file, with bounds and descriptions.

A description of a number ends with its unit in brackets, ``[m/s]``, or ``[-]`` without one. A law
reads the numbers of its keys from a record with the names of the keys: `record_of`.
"""

from collections.abc import Mapping
from functools import cache
from math import inf, pi
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Final, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError

from tiltsim_controllers.mathematics.records import make_record_type, vector_of

# The outer bounds keep arithmetic far from overflow, and far beyond any real vehicle.
Positive = Annotated[float, Field(gt=0.0, le=1e9)]
NonNegative = Annotated[float, Field(ge=0.0, le=1e9)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector3 = Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)]
Angle = Annotated[float, Field(ge=-pi, le=pi)]
Angles3 = Annotated[tuple[Angle, Angle, Angle], Field(strict=False)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,30}$")]
_Item = TypeVar("_Item")
Many = Annotated[tuple[_Item, ...], Field(strict=False)]
ZEROS: Final = (0.0, 0.0, 0.0)
Gains2 = Annotated[tuple[float, float], Field(strict=False)]
Gains4 = Annotated[tuple[float, float, float, float], Field(strict=False)]


def required(meaning: str, *example: Any) -> Any:
    """A key without a default: its meaning, which ends with the unit of numbers, and an example."""
    return default(..., meaning, *example)


def default(value: Any, meaning: str, *example: Any) -> Any:
    """A key with the default ``value``, else as `required`."""
    examples: dict[str, Any] = {"examples": [*example]} if example else {}
    return Field(value, description=meaning, **examples)


GainSets = Mapping[str, Mapping[str, Any]]
"""Sets of gains: records by name, for each key that may name one."""


class Keys(BaseModel):
    """Base class of the keys of a law, and of a table among them.

    Attributes:
        gain_sets: See `GainSets`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
    gain_sets: ClassVar[GainSets] = {}

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse to change a key of a table within a scenario, in one line."""
        try:
            super().__setattr__(name, value)
        except ValidationError:
            text = f"{name}: a scenario stays as it is; make another with Scenario.replace"
            raise AttributeError(text) from None


def gain_kind(value: object) -> str:
    """The tag of gains: ``named`` for a set, ``table`` for numbers."""
    return "named" if isinstance(value, str) else "table"


_Names = TypeVar("_Names")
_Numbers = TypeVar("_Numbers")
NamedGains = Annotated[
    Annotated[_Names, Tag("named")] | Annotated[_Numbers, Tag("table")], Discriminator(gain_kind)
]
"""The name of a set of gains, or explicit gains."""


def options_of(annotation: Any) -> tuple[Any, ...]:
    """The alternative types of a key, without annotations."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return options_of(arguments[0])
    if origin in (Union, UnionType):
        return tuple(option for one in arguments for option in options_of(one))
    return (annotation,)


def choice(table: type[BaseModel], key: str, name: str) -> float:
    """The number of a choice in a record: its index among the choices of a key."""
    (annotation,) = options_of(table.model_fields[key].annotation)
    return float(get_args(annotation).index(name))


def _number_type(annotation: Any) -> Any:
    """The type of a key's numbers in a record; None for a key without numbers."""
    numbers = [o for o in options_of(annotation) if o is not NoneType]
    if len(numbers) > 1:
        numbers = [option for option in numbers if get_origin(option) is not Literal]
    if len(numbers) != 1:
        return None
    (kind,) = numbers
    if kind in (float, int, bool):
        return float
    if get_origin(kind) is tuple:
        return vector_of(len(get_args(kind)))
    if get_origin(kind) is Literal:
        return float if len(get_args(kind)) > 1 else None
    return record_of(kind) if isinstance(kind, type) and issubclass(kind, Keys) else None


NOTHING: Final = "none"
"""The field of the record of a law without parameters."""

_NOT_READ: Final = frozenset({"law"})


@cache
def record_of(table: type[BaseModel], without: frozenset[str] = _NOT_READ, **further: type) -> Any:
    """The type of the record of a law's parameters: of ``further`` ones, then of the keys it reads.

    A tuple is a vector and a table a record; a choice is its index among the choices, False and
    True are 0 and 1, and no value is infinite.
    """
    kinds = {
        name: _number_type(key.annotation)
        for name, key in table.model_fields.items()
        if name not in without and name not in further
    }
    numbers = {name: kind for name, kind in kinds.items() if kind is not None}
    fields = {**further, **numbers} or {NOTHING: float}
    return make_record_type(f"{table.__name__}Numbers", **fields)


def number_of(table: BaseModel, key: str) -> Any:
    """The value of a key in a record."""
    if key == NOTHING:
        return 0.0
    value = getattr(table, key)
    if isinstance(value, str):
        sets = getattr(table, "gain_sets", {}).get(key)
        return sets[value] if sets else choice(type(table), key, value)
    if isinstance(value, Keys):
        record = record_of(type(value))
        return record(*(number_of(value, name) for name in record._fields))
    if isinstance(value, bool):
        return float(value)
    return inf if value is None else value


def table_of(annotation: Any, numbers: Any) -> Any:
    """The value of a key of a type in a scenario, given its numbers in a record."""
    for option in options_of(annotation):
        if isinstance(option, type) and issubclass(option, Keys):
            return option(**numbers._asdict())
    return numbers
