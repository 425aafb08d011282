"""The command line: one subcommand per function of `tiltsim.commands`, each a thin layer."""

import argparse
import atexit
import gc
import os
import re
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from io import TextIOWrapper
from traceback import walk_tb
from typing import Any, Final, NoReturn

from tiltsim.arrays.xla_flags import let_xla_merge_loops
from tiltsim.commands.declaring import call, declare
from tiltsim.errors import DONE, INTERRUPTED, INVALID_INPUT, TERMINATED, InputError
from tiltsim.system.interrupts import terminations_as_interrupts, was_interrupted
from tiltsim.system.text import printable, without_long_words

COMMANDS: Final = """\
fly:
  new          write a vehicle and a scenario to start from
  run          fly one scenario
  check        fly all scenarios under some paths and check their expectations
  sweep        fly a scenario along axes: grids, random sets, stability boundaries
  list         list the scenario library
  autopilot    write the files that a firmware needs to fly a vehicle

look:
  view         show flights in the Rerun viewer
  plot         draw a flight, several, or a sweep as a figure
  video        render a video of a flight

analyze:
  gait         analyze the singularities of a gait or of a multirotor's tilt angles
  stability    poles of a rest point or multipliers of a periodic flight
  attraction   from which initial states a flight comes back
  compare      fly scenarios under several controllers
  arena        score controllers on fixed tasks
  fleet        list the vehicles that ship as MJCF files

logs:
  export       write a flight as MCAP, ULog or CSV
  import       read a log of a real vehicle or of another tool
  replay       fly a model on the rotor speeds and tilts of a log
  identify     find parameters of a vehicle in a log

thesis:
  map          draw the Two Color Map and check a path on it
  singularity  compare the quadrotor's published and exact determinants
  concepts     draw the vehicle, gaits, decouplers and singularities explained in the docs
  report       compare the whole library with the published claims on one HTML page

tool:
  schema       print the keys of the scenario file, or its JSON Schema
  bench        measure the speed of the closed loop relative to bare MuJoCo

exit codes: 0 done, 1 an expectation failed, 2 invalid input, 3 vehicle lost"""
"""The end of ``tiltsim --help``; a command is ``run`` of the module of its name, or of `SHARED`."""

SHARED: Final = {
    "compare": ("compare", "arena"),
    "files": ("new", "list", "fleet", "autopilot", "schema"),
    "look": ("view", "plot", "video"),
    "logs": ("export", "import", "replay", "identify"),
    "many": ("check", "sweep", "bench"),
    "stability": ("stability", "attraction"),
    "thesis": ("map", "singularity", "concepts", "report"),
}
"""Modules of several commands, each its function ``run_NAME``."""

LONGEST_MESSAGE: Final = 1000
"""Characters of a message, which may show a name or value of any length."""


def _one_line(message: object) -> str:
    text = printable(without_long_words(str(message))[:LONGEST_MESSAGE])
    return text if len(text) < LONGEST_MESSAGE else f"{text[:LONGEST_MESSAGE]}..."


class Parser(argparse.ArgumentParser):
    """Reports a mistake in one line, like every other mistake."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        # Accept -0.5,0.5 as a value, not an option, as argparse does for plain -0.5.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        """Print the line, with the closest name of a command or choice, and exit."""
        wrong = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)$", message)
        if wrong:
            from tiltsim.scenario.messages import did_you_mean

            hint = did_you_mean(wrong[1], re.findall(r"[\w-]+", wrong[2]))
            message = message.replace("(choose", f"({hint}choose")
        self.exit(INVALID_INPUT, f"tiltsim: {_one_line(message)} (see {self.prog} --help)\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse unknown arguments at once, so that a command names its own ``--help``."""
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            from tiltsim.scenario.messages import did_you_mean

            hint = did_you_mean(unknown[0], self._option_string_actions)
            self.error(f"unrecognized arguments: {' '.join(unknown)}; {hint}".rstrip("; "))
        return known, unknown


class _Version(argparse.Action):
    """Reads the version only when requested: reading package metadata costs start-up time."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"tiltsim {version('tiltsim')}")
        parser.exit()


def build_parser(only: str | None = None) -> argparse.ArgumentParser:
    """The parser of the command line.

    Args:
        only: The command whose arguments are declared; by default the arguments of all
            commands, which imports all modules of `tiltsim.commands`.
    """
    parser = Parser(
        prog="tiltsim",
        usage="%(prog)s [-h] [--version] COMMAND ...",
        description="A MuJoCo testbed for thrust-vectoring vehicles: fly scenarios, check flights.",
        epilog=COMMANDS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    subparsers = parser.add_subparsers(
        prog="tiltsim", metavar="COMMAND", required=True, help=argparse.SUPPRESS
    )
    for name in re.findall(r"^  (\w+)", COMMANDS, re.MULTILINE):
        subparser = subparsers.add_parser(name)
        if only in {None, name}:
            declare(subparser, command(name))
    return parser


def command(name: str) -> Callable[..., int]:
    """The function of a command, from its module."""
    shared = next((module for module, names in SHARED.items() if name in names), None)
    module = import_module(f"tiltsim.commands.{shared or name}")
    return getattr(module, f"run_{name}" if shared else "run")


OPENGL_USERS: Final = ("mujoco", "dm_control._render")
"""Packages that fail to load if the OpenGL library that MUJOCO_GL names is missing."""

GARBAGE_THRESHOLD: Final = 50_000
"""New objects that make a garbage collection worth its time."""


def reduce_garbage_collection() -> None:
    """Make garbage collections rare, and skip the one at exit.

    A short command makes little garbage and loads hundreds of modules; searching these repeatedly,
    and once more at exit, took a quarter of the time of a flight of 40 s.
    """
    gc.set_threshold(GARBAGE_THRESHOLD)
    atexit.register(gc.freeze)


def main(arguments: list[str] | None = None) -> int:
    """Run one command, by default the command of ``sys.argv``, and return its exit code."""
    if arguments is None:
        reduce_garbage_collection()
        let_xla_merge_loops()
        # Python's own format also prints a line of the code.
        warnings.formatwarning = lambda message, *_: f"tiltsim: warning: {_one_line(message)}\n"
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as Python does for standard error
    with terminations_as_interrupts() as terminated:
        code = _run(arguments)
    return TERMINATED if code == INTERRUPTED and terminated() else code


def _run(arguments: list[str] | None) -> int:
    """Parse and run; every mistake becomes one line and an exit code."""
    try:
        words = sys.argv[1:] if arguments is None else arguments
        parsed = build_parser(next((word for word in words if word[:1] != "-"), "")).parse_args(
            words
        )
        return int(call(parsed.command, parsed))
    except InputError as error:
        return _refuse(error)
    except KeyboardInterrupt:
        return _end_interrupted()
    except BrokenPipeError:
        # The reader (head, less) has ended: discard the rest of the output.
        sys.stderr.close()
        return DONE
    except OSError as error:
        from tiltsim.system.files import reason

        place = "." if isinstance(error, FileNotFoundError) else "output"
        return _refuse(f"{error.filename or place}: {reason(error)}")
    except Exception as error:
        if was_interrupted() or _comes_from_interrupt(error):
            return _end_interrupted()
        if not (_raised_while_loading_mujoco(error) and "MUJOCO_GL" in os.environ):
            raise
        library, line = os.environ["MUJOCO_GL"], str(error).strip().partition("\n")[0]
        return _refuse(
            f"MUJOCO_GL = {library!r}: MuJoCo cannot be loaded with it ({line}); choose an "
            "installed one of egl, osmesa and glfw, or unset it"
        )


def _refuse(mistake: object) -> int:
    """Report invalid input in one line."""
    print(f"tiltsim: {_one_line(mistake)}", file=sys.stderr)
    return INVALID_INPUT


def _end_interrupted() -> int:
    print("tiltsim: interrupted", file=sys.stderr)
    return INTERRUPTED


def _comes_from_interrupt(error: BaseException | None) -> bool:
    """Whether an interrupt became another error on its way, as in the import of compiled code."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _raised_while_loading_mujoco(error: Exception) -> bool:
    """Whether an error comes from an import that looks for the library named by MUJOCO_GL."""
    return any(
        frame.f_code.co_name == "<module>" and frame.f_globals["__name__"] in OPENGL_USERS
        for frame, _ in walk_tb(error.__traceback__)
    )
