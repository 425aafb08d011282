"""``tiltsim attraction``: from how far a flight comes back."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.analysis import add_analysis, print_analysis, requested_scenarios
from tiltsim.commands.angles import allow_negative_lists
from tiltsim.commands.options import Subparsers
from tiltsim.commands.progress import Progress, show_progress
from tiltsim.commands.text import aligned, number
from tiltsim.errors import InputError
from tiltsim.linear.map_size import COARSE, REFINEMENTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.linear.attraction import Attraction

OPTIONS: Final = {"axes": "--axes", "coarse": "--coarse", "refinements": "--refine"}
"""What is typed for an argument of `tiltsim.attraction`."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly a scenario from a grid over two numbers of its initial state, roll and
    pitch unless others are given, refined where flights that come back border on those that do
    not; print which share comes back."""
    summary = "from which initial states a flight comes back"
    parser = subparsers.add_parser("attraction", help=summary, description=description)
    allow_negative_lists(parser)
    add_analysis(parser, "the map", "simulation.duration=15")
    add = parser.add_argument
    axes = "two of x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r (default: roll,pitch)"
    add("--axes", default="roll,pitch", metavar="A,B", help=axes)
    ranges = "of each axis, SI units (default: 1.5 rad, 5 m, 5 m/s, 10 rad/s either way)"
    add("--ranges", metavar="LOW:HIGH,LOW:HIGH", help=ranges)
    coarse = f"cells across before cells at the boundary are divided (default: {COARSE})"
    add("--coarse", type=int, default=COARSE, metavar="N", help=coarse)
    across = COARSE * 2**REFINEMENTS
    refine = f"how often these are divided (default: {REFINEMENTS}, {across} cells across)"
    add("--refine", type=int, default=REFINEMENTS, metavar="N", help=refine)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fly, draw, print."""
    (scenario,) = requested_scenarios(arguments)

    from tiltsim.linear.attraction import attraction

    first, _, second = arguments.axes.partition(",")
    ranges = _parse_ranges(arguments.ranges)
    with show_progress(shown=not arguments.quiet) as progress, _in_lines(progress):
        progress.begin("linear analysis")
        found = attraction(
            scenario,
            (first.strip(), second.strip()),
            ranges=ranges,
            coarse=arguments.coarse,
            refinements=arguments.refine,
            progress=partial(progress.tell, "flights"),
        )
    print_analysis(arguments, found.report(), _text(found), lambda: _draw(found))
    return 0


@contextmanager
def _in_lines(progress: Progress) -> Iterator[None]:
    """Within the block Python's warnings are lines, and mistakes name what was typed."""

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        progress.print(f"tiltsim: {message}", error=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always", RuntimeWarning)
        warnings.showwarning = show
        try:
            yield
        except InputError as error:
            name, _, rest = str(error).partition(" = ")
            known = OPTIONS.get(name)
            raise InputError(f"{known} {rest}" if known else str(error)) from None


def _draw(found: Attraction) -> Figure:
    from tiltsim.views.figures.attraction import attraction_figure

    return attraction_figure(found)


def _parse_ranges(
    text: str | None,
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    if text is None:
        return None, None
    try:
        (a, b), (c, d) = (map(float, part.split(":")) for part in text.split(","))
    except ValueError:
        raise InputError(f"--ranges {text}: write LOW:HIGH,LOW:HIGH") from None
    return (a, b), (c, d)


def _text(found: Attraction) -> str:
    report = found.report()
    labels = {
        "returned": "come back",
        "acceptable": "acceptable attitudes",
        "acceptable_returned": "of these come back",
        "unacceptable_returned": "of the others come back",
    }
    rows = [("flights", str(found.flights)), ("engine", str(found.engine))]
    if found.slowest is not None:
        name, rate = found.slowest
        rows.append(("slowest mode", f"{name}, exp(-{number(rate, '.3g')} t)"))
    rows += [
        (label, f"{number(100.0 * report[key], '.1f')} %")
        for key, label in labels.items()
        if report[key] is not None
    ]
    return "\n".join(aligned(rows))
