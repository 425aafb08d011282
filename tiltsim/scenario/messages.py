"""Wording of errors: each is one line with the key, the value and the allowed values."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from difflib import SequenceMatcher, get_close_matches
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.scenario.schema import TAG_KEYS, Node, schema_of
from tiltsim.system.text import LONGEST_WORD, short_repr, shortened

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError


class InvalidValueError(ValueError):
    """A value that is well formed but not allowed.

    Args:
        key, value: The dotted key and its value.
        allowed: The mistake, or the allowed values.
    """

    def __init__(self, key: str, value: object, allowed: str) -> None:
        super().__init__(f"{key} = {show(value)}: {allowed}")


ALIKE: Final = 0.85
"""Similarity from which the words of two names make them close, whatever else they have."""

CLOSE: Final = 0.6  # similarity from which names are close, ...
SHORT, CLOSE_SHORT = 4, 0.55  # ... and from which shorter ones are, whose letters count for more

MAX_OTHERS: Final = 5  # most keys with further mistakes that are named

_PLAIN_TYPES: Final = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be a string",
    "finite_number": "must be a finite number",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
}

_PATTERNS: Final = {
    r"^[a-z][a-z0-9_]{0,30}$": "up to 31 lowercase letters, digits and _, a letter first",
    r"^[A-Za-z0-9_.-]+$": "letters, digits, _, . and - only",
    "^state_[a-z0-9_]+$": "state_, then lowercase letters, digits and _",
    r"^[a-z0-9]+(-[a-z0-9]+)+$": "words of lowercase letters and digits, two or more, joined by -",
}
"""Patterns of names, in words."""


def show(value: object) -> str:
    """A value as the user wrote it, shortened to 80 characters unless it is a path."""
    is_path = isinstance(value, str) and Path(value).name != value
    length = LONGEST_WORD if is_path else 80
    try:
        return shortened(json.dumps(value, default=str), length)
    except Exception:  # of an object that has no text
        return short_repr(value)


def did_you_mean(name: object, names: Iterable[str]) -> str:
    """A suggestion of the closest of some names, also by the end of a dotted one; or empty."""
    given = shortened(name if isinstance(name, str) else short_repr(name))
    names = list(names)
    cutoff = CLOSE if len(given) > SHORT else CLOSE_SHORT
    close = get_close_matches(given, names, max(1, len(names)), cutoff)
    close += [known for known in names if _shared_words(given, known) > ALIKE]
    # Among close names, final_position_error_x shares more words with final_eror_x than final_roll.
    alike = max(close, key=lambda known: _shared_words(given, known), default="")
    best = next((known for known in names if known.endswith(f".{given}")), alike)
    return f"did you mean {best}? " if best else ""


def _shared_words(given: str, known: str) -> float:
    """How well the words of one name are found in another, from 0 to 1."""
    words = given.split("_")
    similarity = (
        max(SequenceMatcher(None, word, other).ratio() for other in known.split("_"))
        for word in words
    )
    return sum(similarity) / len(words)


def choose(name: object, names: Iterable[str]) -> str:
    """The allowed names in place of an unknown one, after the closest."""
    names = list(names)
    return f"{did_you_mean(name, names)}choose {', '.join(names)}"


def one_line_message(
    error: ValidationError,
    document: Mapping[str, Any],
    schema: type[BaseModel],
    emptied: Collection[str] = (),
) -> str:
    """The first mistake in one line, and the keys of others.

    Args:
        error: The mistakes that pydantic found.
        document: The document that was validated.
        schema: The table that it was validated against.
        emptied: Dotted keys, such as ``gait.type``, whose change dropped other keys of the table.
    """
    details = error.errors(include_url=False)
    # A table with mistakes in it is also none of the names that may stand instead.
    wrong = {_mistake(detail, document) for detail in details}
    details = [
        detail
        for detail in details
        if detail["type"] != "literal_error"
        or not any(key.startswith(f"{_mistake(detail, document)}.") for key in wrong)
    ]
    # A misspelt key is often a missing key as well: the unknown one is more helpful.
    details.sort(key=lambda detail: detail["type"] != "extra_forbidden")
    # Missing entries of one list, and the options of one union, are one mistake each.
    missing = {_mistake(detail, document): detail["type"] == "missing" for detail in details}
    explained, line = _dropped_keys(missing, document, emptied) or (
        [*missing][:1],
        _short_list(details, document) or _describe(details[0], document, schema, details),
    )
    others = [key for key in missing if key not in explained]
    if not others:
        return line
    more = f" and {len(others) - MAX_OTHERS} more" if len(others) > MAX_OTHERS else ""
    kind = "missing" if all(missing[other] for other in others) else "wrong"
    return f"{line} (also {kind}: {', '.join(others[:MAX_OTHERS])}{more})"


def missing_keys(
    error: ValidationError, document: Mapping[str, Any], schema: type[BaseModel]
) -> Iterator[str]:
    """The dotted keys that a document lacks; the arguments are described at `one_line_message`."""
    for detail in error.errors(include_url=False):
        if detail["type"] == "missing":
            yield _mistake(detail, document)
        elif detail["type"] == "union_tag_not_found":
            yield f"{_locate(detail['loc'], document)[0]}.{tags_of(schema, detail['loc'])[0]}"


def _dropped_keys(
    missing: Mapping[str, bool], document: Mapping[str, Any], emptied: Iterable[str]
) -> tuple[list[str], str] | None:
    """Required keys that a change of kind dropped, and their line; None if they are not first."""
    first = next(iter(missing))
    for kind in emptied:
        table, _, tag = kind.rpartition(".")
        required = [key for key in missing if missing[key] and key.startswith(f"{table}.")]
        if first in required:
            value = show(_locate((*table.split("."), tag), document)[1])
            also = ", ".join(required)
            return required, f"{kind} = {value}: drops the other keys of {table}; also set {also}"
    return None


def _mistake(detail: Any, document: Mapping[str, Any]) -> str:
    """The key that identifies one mistake: a list's for missing entries of it."""
    keep_last = detail["type"] in {"missing", "extra_forbidden"}
    location = detail["loc"]
    if detail["type"] == "missing" and isinstance(location[-1], int):
        location, keep_last = location[:-1], False
    return _locate(location, document, keep_last=keep_last)[0]


def _short_list(details: Any, document: Mapping[str, Any]) -> str:
    """A line for a list with too few entries, each of which pydantic reports as missing."""
    first = details[0]
    if first["type"] != "missing" or not isinstance(first["loc"][-1], int):
        return ""
    place = first["loc"][:-1]
    length = 1 + max(detail["loc"][-1] for detail in details if detail["loc"][:-1] == place)
    key, value = _locate(place, document)
    return f"{key} = {show(value)}: must have {length} entries"


def _describe(
    detail: Any, document: Mapping[str, Any], schema: type[BaseModel], details: Iterable[Any]
) -> str:
    kind, context = detail["type"], detail.get("ctx", {})
    if isinstance(context.get("error"), InvalidValueError):
        return str(context["error"])
    keep_last = kind in {"missing", "extra_forbidden"}
    key, value = _locate(detail["loc"], document, keep_last=keep_last)
    if kind == "extra_forbidden":
        *table, _ = detail["loc"]
        missing = [
            other["loc"][-1]
            for other in details
            if other["type"] == "missing" and [*other["loc"][:-1]] == table
        ]
        known = _known_keys(schema_of(schema), detail["loc"], key, missing)
        return f"{key} = {show(value)}: unknown key; {known}"
    if kind == "missing":
        return f"{key}: missing, and required"
    if kind in {"union_tag_invalid", "union_tag_not_found"}:
        if not isinstance(value, dict):
            return f"{key} = {show(value)}: must be a table"
        tag, tags = tags_of(schema, detail["loc"])
        allowed = ", ".join(tags)
        if tag not in value:
            return f"{key}.{tag}: missing; choose {allowed}"
        hint = did_you_mean(value[tag], tags) or _elsewhere(schema_of(schema), value[tag])
        return f"{key}.{tag} = {show(value[tag])}: {hint}choose {allowed}"
    if kind == "literal_error":
        expected = context["expected"].replace("'", "")
        return f"{key} = {show(value)}: choose {'false' if expected == 'False' else expected}"
    if kind in {"too_short", "too_long"}:
        length = context.get("min_length", context.get("max_length"))
        return f"{key} = {show(value)}: must have {length} entries"
    if kind == "tuple_type" and isinstance(value, dict):
        return f"{key}: must be a list of tables; write [[{key}]]"
    node = schema_of(schema).at(detail["loc"])
    if pi in {context.get("le"), -context.get("ge", 0.0)}:
        return f"{key} = {show(value)}: angles are in rad, from -3.14159 to 3.14159"
    if kind == "tuple_type":
        return f"{key} = {show(value)}: must be a list{_entries(node)}"
    if kind == "string_pattern_mismatch":
        words = _PATTERNS[context["pattern"]]
        if detail["loc"][-1] == "[key]":
            return f"{key}: the name must be {words}"
        return f"{key} = {show(value)}: must be {words}"
    unit = node.meaning_and_unit[1]
    is_quantity = isinstance(value, str) and re.match(r"[-+.]*\d", value)
    if kind == "float_type" and is_quantity and not re.match("$|-$|the |.*,", unit):
        return f"{key} = {show(value)}: must be a number in {unit}, without the unit"
    if kind in _PLAIN_TYPES:
        return f"{key} = {show(value)}: {_PLAIN_TYPES[kind]}"
    return f"{key} = {show(value)}: {detail['msg'].replace('Input should', 'must')}"


def _locate(
    location: tuple[Any, ...], document: Mapping[str, Any], *, keep_last: bool = False
) -> tuple[str, Any]:
    """Dotted key and value of a location, without tags; ``keep_last`` keeps the last part."""
    keys: list[str] = []
    value: Any = document
    tag: object = None
    for position, part in enumerate(location):
        if part == tag and tag is not None:  # also where a key has the same name
            tag = None
            continue
        in_table = isinstance(value, Mapping) and part in value
        in_list = isinstance(value, list | tuple) and isinstance(part, int) and part < len(value)
        if in_table or in_list:
            value = value[part]
            known = value if isinstance(value, Mapping) else {}
            tag = next((known[key] for key in TAG_KEYS if key in known), None)
        elif not (keep_last and position == len(location) - 1):
            continue
        keys.append(f"[{part}]" if isinstance(part, int) else f".{part}")
    key = "".join(keys).removeprefix(".").encode("unicode_escape").decode()
    return shortened(key) or "scenario", value


def tags_of(schema: type[BaseModel], location: tuple[Any, ...]) -> tuple[str, list[str]]:
    """The key that discriminates the tables of a union under a location, and its values."""
    tables = schema_of(schema).at(location).tables
    tag = next(table.tag for table in tables if table.tag)
    return tag, list(dict.fromkeys(kind for table in tables for kind in table.kinds))


def _known_keys(root: Node, location: tuple[Any, ...], key: str, missing: Sequence[str]) -> str:
    """The keys allowed instead of an unknown one, and a hint; ``missing`` are required ones."""
    name = key.rpartition(".")[2]
    union, table = root, root
    for part in location[:-1]:
        union, table = table, table.member(part)
    if len(table.tables) == 1:
        (table,) = table.tables
    names = sorted(table.properties)
    others = [one for one in union.tables if one is not union and name in one.properties]
    kinds = dict.fromkeys(kind for option in others for kind in option.kinds)
    within = "." + re.sub(r"\[\d+\]", "", key)
    elsewhere = _elsewhere(root, name, within)
    alike = [known for known in names if _shared_words(known, name) > ALIKE]
    if kinds and names:
        hint = f"only for {table.tag} {', '.join(kinds)}; "
    elif elsewhere and not did_you_mean(name, alike):
        hint = elsewhere
    else:
        hint = did_you_mean(name, alike) or did_you_mean(name, names)
        if not hint and len(missing) == 1:
            hint = f"did you mean {missing[0]}? "
    return f"{hint}known: {', '.join(names)}"


def _elsewhere(root: Node, name: object, within: str = "") -> str:
    """A suggestion of keys of a name in other tables, but for a key; empty if there are none."""
    found = [
        known
        for known in root.dotted_keys()
        if known.rpartition(".")[2] == name and f".{known}." not in within
    ]
    return f"did you mean {' or '.join(found[:3])}? " if found else ""


def _entries(node: Node) -> str:
    """The entries of a list, such as `` of 3 numbers``; empty if they are not plain."""
    kinds = {"number": "numbers", "integer": "whole numbers", "array": "lists"}
    for option in node.options:
        entries = option.entries
        value = entries[0].value if entries else {}
        kind = "names" if "enum" in value else kinds.get(value.get("type", ""))
        if kind:
            count = f"{len(entries)} " if "prefixItems" in option.value else ""
            return f" of {count}{kind}"
    return ""
