"""``tiltsim attraction``: from how far a flight comes back."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import Json, Overrides, PlotOptions, Quiet, Trust, load_scenarios
from tiltsim.commands.text import Progress, aligned, number, show_progress
from tiltsim.errors import InputError
from tiltsim.linear import COARSE, REFINEMENTS
from tiltsim.views import figures

if TYPE_CHECKING:
    from tiltsim.linear.attraction import Attraction

OPTIONS: Final = {"axes": "--axes", "coarse": "--coarse", "refinements": "--refine"}
"""Options by the arguments of `tiltsim.attraction` that they set."""

SHARES: Final = {
    "returned": "come back",
    "acceptable": "acceptable attitudes",
    "acceptable_returned": "of these come back",
    "unacceptable_returned": "of the others come back",
}


def _ranges(text: str) -> tuple[tuple[float, float], tuple[float, float]]:
    try:
        (a, b), (c, d) = (map(float, part.split(":")) for part in text.split(","))
    except ValueError:
        raise ValueError("write LOW:HIGH,LOW:HIGH") from None
    return (a, b), (c, d)


def run(
    scenario: str,
    *,
    axes: str = "roll,pitch",
    ranges: Annotated[Any, Option(read=_ranges)] = (None, None),
    coarse: int = COARSE,
    refine: int = REFINEMENTS,
    overrides: Overrides = (),
    json: Json = False,
    quiet: Quiet = False,
    trust: Trust = False,
    figure: PlotOptions,
) -> int:
    """Fly a scenario from a grid of initial states, and print which share comes back.

    The grid is over two numbers, roll and pitch unless others are given, refined where flights that
    come back border on flights that do not.

    Args:
        scenario (SCENARIO): a TOML file or a library name
        axes (A,B): two of x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r (default: roll,pitch)
        ranges (LOW:HIGH,LOW:HIGH): range of each axis, SI units (default: 1.5 rad, 5 m, 5 m/s or
            10 rad/s either way)
        coarse (N): cells across before cells at the boundary are divided (default: %(default)s)
        refine (N): how often these are divided in four (default: %(default)s)
    """
    figure.check()
    (loaded,) = load_scenarios([scenario], overrides, trust)

    from tiltsim.linear.attraction import attraction

    first, _, second = axes.partition(",")
    with show_progress(shown=not quiet) as progress, _in_lines(progress):
        progress.begin("linear analysis")
        found = attraction(
            loaded,
            (first.strip(), second.strip()),
            ranges=ranges,
            coarse=coarse,
            refinements=refine,
            progress=partial(progress.tell, "flights"),
        )

    figure.show(
        lambda: figures.stability.attraction_figure(found), found.report(), _text(found), json=json
    )
    return 0


@contextmanager
def _in_lines(progress: Progress) -> Iterator[None]:
    """Within the block Python's warnings are lines, and mistakes name the options."""

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        progress.print(f"tiltsim: {message}", error=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always", RuntimeWarning)
        warnings.showwarning = show
        try:
            yield
        except InputError as error:
            name, _, rest = str(error).partition(" = ")
            raise InputError(f"{OPTIONS[name]} {rest}" if name in OPTIONS else str(error)) from None


def _text(found: Attraction) -> str:
    report = found.report()
    rows = [("flights", str(found.flights)), ("engine", str(found.engine))]
    if found.slowest is not None:
        name, rate = found.slowest
        rows.append(("slowest mode", f"{name}, exp(-{number(rate, '.3g')} t)"))
    rows += [
        (label, f"{number(100.0 * report[key], '.1f')} %")
        for key, label in SHARES.items()
        if report[key] is not None
    ]
    return "\n".join(aligned(rows))
