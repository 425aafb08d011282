"""Base class and number types of the tables of a scenario file."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from operator import attrgetter
from typing import Annotated, Any, ClassVar, NoReturn, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from tiltsim.errors import InputError
from tiltsim.scenario.messages import InvalidValueError, missing_keys, one_line_message, show
from tiltsim.system.text import short_repr, valid_unicode
from tiltsim_controllers.laws.keys import ZEROS as ZEROS
from tiltsim_controllers.laws.keys import Angle as Angle
from tiltsim_controllers.laws.keys import Angles3 as Angles3
from tiltsim_controllers.laws.keys import Coordinate as Coordinate
from tiltsim_controllers.laws.keys import Gains2 as Gains2
from tiltsim_controllers.laws.keys import Many as Many
from tiltsim_controllers.laws.keys import Name as Name
from tiltsim_controllers.laws.keys import NonNegative as NonNegative
from tiltsim_controllers.laws.keys import Positive as Positive
from tiltsim_controllers.laws.keys import Vector3 as Vector3
from tiltsim_controllers.laws.keys import default as default
from tiltsim_controllers.laws.keys import required as required

NotTiny = Annotated[float, Field(ge=1e-12, le=1e9)]  # for divisors
Period = Annotated[float, Field(ge=1e-3, le=1e9)]
Factor = Annotated[float, Field(ge=-1e3, le=1e3)]
Angles2 = Annotated[tuple[Angle, Angle], Field(strict=False)]
AnglesEach = Annotated[Many[Angle], Field(min_length=1, max_length=16)]
Row = Annotated[Many[float], Field(min_length=2, max_length=17)]  # of a time and values
PositiveEach = Annotated[Many[Positive], Field(min_length=2, max_length=16)]
Limit = Annotated[float, Field(allow_inf_nan=True)]
Range = Annotated[tuple[Limit, Limit], Field(strict=False)]


def example(**keys: Any) -> ConfigDict:
    """The configuration of a table with an example, for tables without required keys."""
    return ConfigDict(json_schema_extra={"examples": [keys]})


class Table(BaseModel):
    """A table of the scenario file: unknown keys, NaN and loose types are errors.

    The description of a key with numbers ends with their unit, ``[m/s]``, or ``[-]`` without one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
    table_name: ClassVar[str] = ""  # before its keys in messages; empty for the whole document
    only_with: ClassVar[Mapping[tuple[str, ...], tuple[Any, ...]]] = {}
    """Keys that have an effect only with another key's values: its name, then the values."""

    @field_validator("*")
    @classmethod
    def _check_unicode(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse text that no file could hold, as from a command line that is not UTF-8."""
        if isinstance(value, str) and value != valid_unicode(value):
            key = f"{cls.table_name}.{info.field_name}".removeprefix(".")
            raise InvalidValueError(key, value, "not valid Unicode")
        return value

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        for keys, (other, *values) in self.only_with.items():
            if getattr(self, other) not in values:
                allowed = " or ".join(map(show, values))
                self.require_defaults(keys, f"needs {self.table_name}.{other} = {allowed}")
        self._check_values()
        return self

    def _check_values(self) -> None:
        """Refuse keys that contradict each other; called when every key alone is valid."""

    def __dir__(self) -> list[str]:
        """Names to complete, without pydantic's methods except for copies and dumps."""
        inherited = {name for name in dir(BaseModel) if not name.startswith("_")}
        useful = {"model_copy", "model_dump", "model_dump_json"}
        return sorted({*super().__dir__()} - (inherited - useful))

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse to change a key, in words that help."""
        if not name.startswith("_"):
            raise self._frozen(f"{name} = {short_repr(value)}")
        super().__setattr__(name, value)

    def __delattr__(self, name: str) -> None:
        """Refuse to delete a key, in words that help."""
        if not name.startswith("_"):
            raise self._frozen(name)
        super().__delattr__(name)

    def _frozen(self, what: str) -> InputError:
        """The error of a change of a key."""
        key = f"{self.table_name}.{what}".removeprefix(".")
        return InputError(f"{key}: a scenario stays as it is; make another with Scenario.replace")

    def mistake(self, key: str, allowed: str) -> InvalidValueError:
        """The error of the value of a dotted key that is not allowed; see `InvalidValueError`."""
        value = attrgetter(key)(self)
        is_table = isinstance(value, BaseModel)
        shown = value.model_dump(exclude_unset=True) if is_table else value
        return InvalidValueError(f"{self.table_name}.{key}".removeprefix("."), shown, allowed)

    def refuse(self, key: str, reason: str, *value: object) -> NoReturn:
        """Refuse a dotted key for a reason, or a ``value`` that is not the key's own."""
        raise InvalidValueError(key, value[0], reason) if value else self.mistake(key, reason)

    def require(self, key: str, value: object, reason: str) -> None:
        """Refuse any other value of a dotted key, for a reason."""
        if attrgetter(key)(self) != value:
            raise self.mistake(key, reason)

    def require_defaults(self, keys: Iterable[str], reason: str) -> None:
        """Refuse keys that are set although they have no effect, for a reason."""
        for key in keys:
            self.require(key, type(self).model_fields[key].default, reason)


@contextmanager
def in_one_line(
    address: str, document: Any, table: type[BaseModel], emptied: Collection[str] = ()
) -> Iterator[None]:
    """Raise `InputError` in place of pydantic's error; see `one_line_message`.

    Args:
        address: Name of the document in the message.
        document, table, emptied: The document, and the table that it is validated against.
    """
    try:
        yield
    except ValidationError as error:
        message = one_line_message(error, document, table, emptied)
        missing = missing_keys(error, document, table)
        raise InputError(f"{address}: {message}", missing) from None
