"""Scenarios that differ in numbers: only the tables that hold these are validated again."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final, NamedTuple

from pydantic import BaseModel, ValidationError

from tiltsim.scenario.documents import split_key, with_value
from tiltsim.scenario.loading import parse_scenario
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.numbers import is_number

Document = dict[str, Any]


class _Known(NamedTuple):
    """A scenario with the values by key that it was made from."""

    values: Mapping[str, Any]
    document: Document
    scenario: Scenario


class SimilarScenarios:
    """Makes scenarios from documents; one of each kind is made in full.

    Args:
        address: Name of the documents in messages.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._known: dict[object, _Known] = {}

    def scenario(
        self, kind: object, values: Mapping[str, Any], document: Callable[[], Document]
    ) -> Scenario:
        """A scenario, from values by dotted key. Raises `InputError` if it is not valid.

        ``kind`` is equal for documents in which only ``values`` differ.
        """
        known = self._known.get(kind)
        if known is not None:
            changes = _changes(known.values, values)
            similar = None if changes is None else _similar(known, changes)
            if similar is not None:
                return similar
        made = document()
        scenario = parse_scenario(made, self._address)
        self._known.setdefault(kind, _Known(values, made, scenario))
        return scenario


def _changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, Any] | None:
    """The values that changed; None if one is no number or list of numbers as before."""
    # 0.0 equals -0.0 and 1, but a flight's scenario is the one that its row names.
    changed = {key: value for key, value in now.items() if repr(value) != repr(before.get(key))}
    if before.keys() != now.keys():
        return None
    return changed if all(_alike(before[key], value) for key, value in changed.items()) else None


def _alike(first: Any, second: Any) -> bool:
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(_alike, first, second))
    return type(first) is type(second) and is_number(first)


def _similar(known: _Known, changes: Mapping[str, Any]) -> Scenario | None:
    """A known scenario with other numbers; None if it is not valid, or its tables have no keys."""
    changed: Document = {}
    for key, value in changes.items():
        name, *path = _split(key)
        if not isinstance(getattr(known.scenario, str(name), None), BaseModel):
            return None
        table = changed.get(str(name), known.document[str(name)])
        changed[str(name)] = with_value(table, path, value)
    try:
        tables = {
            name: type(getattr(known.scenario, name)).model_validate(table)
            for name, table in changed.items()
        }
        scenario = known.scenario.model_copy(update=tables)
        scenario.require_consistency()
    except (ValidationError, InvalidValueError):  # in words of the whole document: by the caller
        return None
    return scenario


_split: Final = cache(split_key)
