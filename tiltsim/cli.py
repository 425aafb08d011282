"""The command line: one subcommand a module of `tiltsim.commands`, each a thin layer."""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from typing import Final

from tiltsim.errors import InputError

COMMANDS: Final = ("run", "check", "list", "gait", "map", "singularity", "bench", "schema")
INPUT_ERROR: Final = 2
INTERRUPTED: Final = 130


class _Version(argparse.Action):
    """Looks the version up only when asked: reading package metadata costs start-up time."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"tiltsim {version('tiltsim')}")
        parser.exit()


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="tiltsim",
        description="A MuJoCo testbed for thrust-vectoring vehicles: fly scenarios, judge flights.",
        epilog="exit codes: 0 done, 1 an expectation failed, 2 invalid input, 3 flight lost",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in COMMANDS:
        import_module(f"tiltsim.commands.{name}").add_parser(subparsers)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run one command and return its exit code."""
    parsed = build_parser().parse_args(arguments)
    try:
        return int(parsed.run(parsed))
    except InputError as error:
        print(f"tiltsim: {error}", file=sys.stderr)
        return INPUT_ERROR
    except KeyboardInterrupt:
        print("tiltsim: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader (head, less) has gone; the rest of the output is nobody's.
        sys.stderr.close()
        return 0


if __name__ == "__main__":
    sys.exit(main())
