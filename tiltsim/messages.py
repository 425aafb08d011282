"""Wording of mistakes: every one becomes a line with the key, the value and what is allowed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, Final, get_args

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError


class InvalidValueError(ValueError):
    """A value that is well formed but not allowed, with the key it stands under."""

    def __init__(self, key: str, value: object, allowed: str) -> None:
        super().__init__(f"{key} = {show(value)}: {allowed}")


_PLAIN_TYPES: Final = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be a string",
    "tuple_type": "must be a list",
    "finite_number": "must be a finite number",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
}


def show(value: object) -> str:
    """A value as the user wrote it, cut where it is long."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 80 else text[:77] + "..."


def one_line(error: ValidationError, document: Mapping[str, Any], schema: type[BaseModel]) -> str:
    """The first mistake in one line, and how many more there are."""
    details = error.errors(include_url=False)
    line = _describe(details[0], document, schema)
    more = len(details) - 1
    return f"{line} (and {more} more)" if more else line


def _describe(detail: Any, document: Mapping[str, Any], schema: type[BaseModel]) -> str:
    kind, context = detail["type"], detail.get("ctx", {})
    if isinstance(context.get("error"), InvalidValueError):
        return str(context["error"])
    key, value = _locate(detail["loc"], document)
    if kind == "extra_forbidden":
        return f"{key} = {show(value)}: unknown key; {_known_keys(schema, detail['loc'], key)}"
    if kind == "missing":
        return f"{key}: missing, and required"
    if kind in {"union_tag_invalid", "union_tag_not_found"}:
        tag = value.get("type") if isinstance(value, dict) else value
        allowed = context.get("expected_tags", "a table with a type").replace("'", "")
        return f"{key}.type = {show(tag)}: choose {allowed}"
    if kind == "literal_error":
        return f"{key} = {show(value)}: choose {context['expected'].replace(chr(39), '')}"
    if kind in {"too_short", "too_long"}:
        length = context.get("min_length", context.get("max_length"))
        return f"{key} = {show(value)}: must have {length} entries"
    if kind in _PLAIN_TYPES:
        return f"{key} = {show(value)}: {_PLAIN_TYPES[kind]}"
    return f"{key} = {show(value)}: {detail['msg'].replace('Input should', 'must')}"


def _locate(location: tuple[Any, ...], document: Mapping[str, Any]) -> tuple[str, Any]:
    """Dotted key and value of an error's location, without the union tags that pydantic adds."""
    keys: list[str] = []
    value: Any = document
    for position, part in enumerate(location):
        in_table = isinstance(value, Mapping) and part in value
        in_list = isinstance(value, list | tuple) and isinstance(part, int) and part < len(value)
        if in_table or in_list:
            value = value[part]
        elif position < len(location) - 1:
            continue
        keys.append(str(part))
    return ".".join(keys) or "scenario", value


def _known_keys(schema: Any, location: tuple[Any, ...], key: str) -> str:
    """The keys allowed where an unknown one stood, the closest first if one is close."""
    for part in location[:-1]:
        schema = _member(schema, part)
    names = sorted(schema.model_fields) if hasattr(schema, "model_fields") else []
    close = get_close_matches(key.rpartition(".")[2], names, n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    return f"{hint}known: {', '.join(names)}"


def _member(schema: Any, part: object) -> Any:
    """The table type found in a table type under a key, through unions by their tag."""
    if hasattr(schema, "model_fields") and part in schema.model_fields:
        return schema.model_fields[part].annotation
    if isinstance(part, int):
        return get_args(schema)[0]
    for option in get_args(schema):
        fields = getattr(option, "model_fields", {})
        if "type" in fields and part in get_args(fields["type"].annotation):
            return option
        if part == "table" and fields:
            return option
        found = _member(option, part) if get_args(option) else None
        if found is not None:
            return found
    return schema
