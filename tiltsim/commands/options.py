"""Options that several commands share."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from tiltsim.commands.declaring import Option
from tiltsim.commands.text import json_text, print_line
from tiltsim.errors import InputError
from tiltsim.views import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.scenario.scenario import Scenario


def positive_integer(text: str) -> int:
    """An integer of at least 1."""
    if not text.isdecimal() or int(text) < 1:
        raise ValueError("must be an integer of at least 1")
    return int(text)


def names(text: str) -> list[str]:
    """Names separated by commas, each once."""
    listed = list(dict.fromkeys(filter(None, (name.strip() for name in text.split(",")))))
    if not listed:
        raise ValueError("name one at least")
    return listed


def _assignment(text: str) -> tuple[str, Any]:
    from tiltsim.scenario.documents import parse_override

    if "=" not in text:
        raise ValueError("write KEY=VALUE, as in controller.decoupler=exact")
    return parse_override(text)


def _label(text: str) -> tuple[str, str]:
    name, equals, label = text.partition("=")
    if not equals or not name:
        raise ValueError("must be NAME=TEXT")
    return name, label


_SET: Final = "override a key of the scenario, such as controller.decoupler=exact; repeatable"
_JOBS: Final = "processes (default: the number of cores)"
_TRUST: Final = "execute the Python controllers that files name; so does TILTSIM_TRUST=1"
_OWN: Final = (
    "a law with other gains, such as fast='{law=\"pid\", position_gain=2.0}', or your "
    "law of NumPy arrays, FILE.py:FUNCTION; repeatable"
)

Overrides = Annotated[tuple[tuple[str, Any], ...], Option("--set", _assignment, "KEY=VALUE", _SET)]
Jobs = Annotated[int, Option("--jobs", positive_integer, "N", _JOBS)]
Json = Annotated[bool, Option(help="print JSON")]
Quiet = Annotated[bool, Option(help="show no progress")]
Silent = Annotated[bool, Option(help="print nothing but errors")]
Trust = Annotated[bool, Option(help=_TRUST)]
OwnControllers = Annotated[tuple[str, ...], Option("--controller", str, "NAME=TABLE", _OWN)]
Names = Annotated[Sequence[str], Option("", names, "A,B,...")]

CORES: Final = os.cpu_count() or 1


def refuse_both(**given: object) -> None:
    """Raise `InputError` if more than one of these options is given."""
    first, *others = [f"--{name.replace('_', '-')}" for name, value in given.items() if value] or [
        ""
    ]
    if others:
        raise InputError(f"{others[0]}: not allowed with {first}")


@dataclass(frozen=True, kw_only=True)
class FigureOptions:
    """Size, style and words of a figure.

    Args:
        size (SIZE): such as 85mm, 85x60mm or 3.3x2.4in; without a height, as high as the content
            needs
        style (FILE): a matplotlib style file or the name of a style; a matplotlibrc is respected
            as well
        title (TEXT): instead of the figure's own; empty for none
        labels (NAME=TEXT): TEXT instead of NAME: of a flight, metric, panel, axis or line;
            repeatable
    """

    size: str | None = None
    style: Path | None = None
    title: str | None = None
    labels: Annotated[tuple[tuple[str, str], ...], Option("--label", _label)] = ()

    def save(self, draw: Callable[[], Figure], path: Path, *, is_named: bool = False) -> None:
        """Draw and save a figure in this size and style; ``is_named``: with title and labels."""
        style, layout = figures.style, figures.layout
        with style.paper_style(self.style, style.parse_size("--size", self.size)):
            figure = draw()
            if not is_named:
                layout.retitle(figure, self.title)
                layout.relabel(figure, dict(self.labels))
            style.save(figure, path)


@dataclass(frozen=True, kw_only=True)
class PlotOptions(FigureOptions):
    """The figure of a command that prints an analysis.

    Args:
        plot (FILE): also draw a figure: FILE.png, .svg or .pdf
    """

    plot: Path | None = None

    def __post_init__(self) -> None:
        self.check()

    def check(self, panels: Sequence[str] = ()) -> None:
        """Raise `InputError` for options without ``--plot``, and for a file of no use."""
        given = {
            "--size": self.size,
            "--style": self.style,
            "--title": self.title,
            "--label": self.labels or None,
            "--panels": panels or None,
        }
        for option, value in given.items():
            if value is not None and self.plot is None:
                raise InputError(f"{option}: needs --plot FILE")
        if self.plot is not None:
            prepare_figure("--plot", self.plot)

    def show(self, draw: Callable[[], Figure], report: Any, text: str, *, json: bool) -> None:
        """Save the figure, if one is requested, and print an analysis.

        Args:
            draw: Draws the figure.
            report: Printed as JSON.
            text: Printed without ``json``, with the path of the figure.
            json: Whether the output is JSON.
        """
        if self.plot is not None:
            self.save(draw, self.plot)
        print(json_text(report) if json else text)
        if self.plot is not None and not json:
            print_line(f"figure written to {self.plot}")


def prepare_figure(option: str, path: Path) -> None:
    """Raise `InputError` unless a figure can be written to ``path``."""
    from tiltsim.system.files import prepare_file

    prepare_file(option, path, figures.style.FORMATS)


def file_in(out: Path | None, beside: Path, name: str) -> Path:
    """The file of ``--out``, or ``name`` in that folder; without it ``name`` beside the input."""
    if out is None:
        return (beside if beside.is_dir() else beside.parent) / name
    return out if out.suffix and not out.is_dir() else out / name


def load_scenarios(
    addresses: Iterable[str], overrides: Iterable[tuple[str, Any]], trust: bool
) -> list[Scenario]:
    """The scenarios to analyze, with the keys of ``--set``."""
    from tiltsim.scenario.loading import load_scenario

    return [load_scenario(at, dict(overrides), trusted=trust) for at in addresses]
