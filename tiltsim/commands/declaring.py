"""Commands as functions: parameters become arguments, and docstrings the text of ``--help``.

Parameters before ``*`` are positional arguments, and those after it options. Their types say how
often an argument is given and how it is read:

- ``bool`` is a flag, ``Literal`` a choice; ``None`` as a default says nothing about the type;
- ``tuple[X, ...]`` is a repeatable option, or all remaining positional arguments;
- ``tuple[X, X, X]`` is an option with three values;
- a dataclass is a group of options, which several commands may share.

The docstring's section ``Args`` has a line ``name (METAVAR): help`` for each argument.
"""

import argparse
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from inspect import Parameter, cleandoc, signature
from types import NoneType
from typing import Annotated, Any, Final, Literal, NamedTuple, get_args, get_origin, get_type_hints

from tiltsim.errors import InputError


class Option(NamedTuple):
    """Annotation of a parameter: facts that its name, type and docstring do not tell.

    Args:
        flag: The option, if it is not called like the parameter.
        read: Converts a value; raises ValueError that names the allowed values. Default: the type.
        metavar, help: For an option that several commands share.
    """

    flag: str = ""
    read: Callable[[str], Any] | None = None
    metavar: str = ""
    help: str = ""


_ARGUMENT: Final = re.compile(r"^    (\w+)(?: \((.+?)\))?: (.*(?:\n     .*)*)", re.MULTILINE)
"""A line ``name (METAVAR): help`` and the lines that continue it."""


class _Argument(NamedTuple):
    name: str
    kind: Any
    option: Option
    default: Any
    is_option: bool

    def add_to(self, parser: Any) -> None:
        """Declare the argument in a parser or in a group of one."""
        option, kind, is_needed = self.option, self.kind, self.default is Parameter.empty
        flags = (option.flag or f"--{self.name.replace('_', '-')}",) if self.is_option else ()
        settings: dict[str, Any] = {"help": option.help, "dest": self.name}
        if not is_needed:
            settings["default"] = self.default
        elif self.is_option:
            settings["required"] = True
        if kind is bool:
            parser.add_argument(*flags, action="store_true", **settings)
            return
        if _is_open(kind):
            kind = get_args(kind)[0]
            many = {"action": "append", "default": []}
            settings |= many if flags else {"nargs": "+" if is_needed else "*"}
        elif not flags and not is_needed:
            settings["nargs"] = "?"
        if get_origin(kind) is tuple and option.read is None:
            settings["nargs"] = "+" if _is_open(kind) else len(get_args(kind))
            kind = get_args(kind)[0]
        names = tuple(option.metavar.split())
        settings["metavar"] = names if len(names) > 1 else option.metavar or None
        if get_origin(kind) is Literal:
            settings["choices"], kind = get_args(kind), str
        settings["type"] = kind if option.read is None else partial(self._read, *flags)
        parser.add_argument(*flags, **settings)

    def _read(self, flag: str, text: str) -> Any:
        assert self.option.read is not None
        with mistakes_in(f"{flag} {text or repr(text)}"):
            return self.option.read(text)


@contextmanager
def mistakes_in(place: str) -> Iterator[None]:
    """Within the block a ValueError becomes an `InputError` that names the place."""
    try:
        yield
    except ValueError as error:
        raise InputError(f"{place}: {error}") from None


def _is_open(kind: Any) -> bool:
    """Whether a type is a tuple of any length."""
    return get_origin(kind) is tuple and get_args(kind)[-1] is Ellipsis


def _documented(function: Callable[..., Any]) -> dict[str, tuple[str, str]]:
    """The metavar and help of each argument that docstrings describe, base classes included."""
    found: dict[str, tuple[str, str]] = {}
    for holder in reversed(getattr(function, "__mro__", (function,))):
        section = cleandoc(holder.__doc__ or "").partition("\n\nArgs:\n")[2]
        for name, metavar, text in _ARGUMENT.findall(section):
            found[name] = (metavar, " ".join(text.split()))
    return found


def _parts(function: Callable[..., Any]) -> dict[str, _Argument | type]:
    """The arguments and groups of options of a command or group, by parameter."""
    documented = _documented(function)
    hints = get_type_hints(function, include_extras=True)
    parts: dict[str, _Argument | type] = {}
    for name, parameter in signature(function).parameters.items():
        kind, option = hints[name], Option()
        if hasattr(kind, "__dataclass_fields__"):
            parts[name] = kind
            continue
        if get_origin(kind) is Annotated:
            kind, option = get_args(kind)
        if name in documented:
            metavar, text = documented[name]
            option = option._replace(metavar=metavar or option.metavar, help=text)
        if NoneType in get_args(kind):
            kind = get_args(kind)[0]
        is_option = parameter.kind is Parameter.KEYWORD_ONLY
        parts[name] = _Argument(name, kind, option, parameter.default, is_option)
    return parts


def declare(parser: argparse.ArgumentParser, run: Callable[..., int]) -> None:
    """Give an empty parser the arguments and the docstring of a command, all annotated.

    The docstring's section ``Note`` is printed below the options. The parsed arguments are for
    `call`, and the command is one of them.
    """
    text = cleandoc(run.__doc__ or "").partition("\n\nArgs:\n")[0]
    parser.description, _, parser.epilog = text.partition("\n\nNote:\n")
    parser.set_defaults(command=run)

    def add(parts: dict[str, _Argument | type], place: Any) -> None:
        for name, part in parts.items():
            if isinstance(part, type):
                add(_parts(part), parser.add_argument_group(name))
            else:
                part.add_to(place)

    add(_parts(run), parser)


def call(function: Callable[..., Any], given: argparse.Namespace) -> Any:
    """Call a command, or make a group of options, with the arguments of its parser."""
    values: dict[str, Any] = {}
    for name, part in _parts(function).items():
        if isinstance(part, type):
            values[name] = call(part, given)
        else:
            values[name] = _as_tuples(getattr(given, name))
    return function(**values)


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value
