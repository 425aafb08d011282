"""Options that several commands share."""

from __future__ import annotations

import argparse
import os
from typing import TypeAlias

from tiltsim.errors import InputError

Subparsers: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""The subcommands of the parser that `tiltsim.cli.build_parser` makes."""


def positive_integer(text: str) -> int:
    """An integer of at least 1, from the command line."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: must be an integer of at least 1")
    return int(text)


def add_jobs(parser: argparse.ArgumentParser) -> None:
    """Declare ``--jobs``."""
    parser.add_argument(
        "--jobs",
        type=positive_integer,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: the number of cores)",
    )


def assignment(text: str) -> str:
    """``KEY=VALUE``, from the command line."""
    if "=" not in text:
        raise InputError(f"--set {text}: write KEY=VALUE, as in controller.decoupler=exact")
    return text


def add_overrides(parser: argparse.ArgumentParser, target: str, example: str) -> None:
    """Declare ``--set``, which overrides keys of ``target``, with an example in its help."""
    parser.add_argument(
        "--set",
        action="append",
        type=assignment,  # before a value after a space counts as an unknown argument
        default=[],
        metavar="KEY=VALUE",
        dest="overrides",
        help=f"override a key of {target}, such as {example}; repeatable",
    )


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Declare ``--trust``, see `tiltsim.scenario.trust`."""
    parser.add_argument(
        "--trust",
        action="store_true",
        help="execute the Python controllers that files name; so does TILTSIM_TRUST=1",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """Declare ``--json``."""
    parser.add_argument("--json", action="store_true", help="print JSON")


def add_quiet(parser: argparse.ArgumentParser, text: str = "print nothing but errors") -> None:
    """Declare ``--quiet``, with another help text where it still prints results."""
    parser.add_argument("--quiet", action="store_true", help=text)


def add_vehicle(parser: argparse.ArgumentParser) -> None:
    """Declare ``--vehicle``, which `tiltsim.commands.angles.parse_vehicle` reads."""
    parser.add_argument(
        "--vehicle",
        metavar="VEHICLE",
        help="ar_drone_2 (default), luukkonen, KEY=VALUE,..., or a preset with KEY=VALUE,...",
    )


def add_controllers(parser: argparse.ArgumentParser, listed: str) -> None:
    """Declare ``--controllers`` and ``--controller``; see `tiltsim.commands.controllers`."""
    parser.add_argument("--controllers", metavar="A,B,...", help=listed)
    parser.add_argument(
        "--controller",
        action="append",
        default=[],
        metavar="NAME=TABLE",
        help="one with gains of its own, such as fast='{law=\"pid\", position_gain=2.0}', or your "
        "scalar function, FILE.py:FUNCTION; repeatable",
    )
