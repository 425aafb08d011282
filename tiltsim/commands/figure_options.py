"""Options of all commands that draw: where to, how large, in which style and with which words."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure


def add_plot(parser: argparse.ArgumentParser, figure: str, *, panels: bool = False) -> None:
    """Declare ``--plot``, which draws a ``figure``, and the options of figures."""
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help=f"draw {figure}: FILE.png, .svg or .pdf"
    )
    add_figure_options(parser, panels=panels)


def add_figure_options(parser: argparse.ArgumentParser, *, panels: bool = True) -> None:
    """Declare size, style, title, labels and, of a figure that has some, panels."""
    group = parser.add_argument_group("figure")
    add = group.add_argument
    size = "such as 85mm, 85x60mm or 3.3x2.4in; without a height, as high as the content needs"
    add("--size", metavar="SIZE", help=size)
    style = "a matplotlib style file or the name of a style; a matplotlibrc is respected, too"
    add("--style", type=Path, metavar="FILE", help=style)
    add("--title", metavar="TEXT", help="instead of the figure's own; empty for none")
    label = "TEXT instead of NAME: of a flight, metric, panel, axis or line; repeatable"
    add("--label", action=_Label, default={}, metavar="NAME=TEXT", dest="labels", help=label)
    if panels:
        these = "the panels to draw, in this order"
        add("--panels", type=_names, default=(), metavar="A,B,...", help=these)


class _Label(argparse.Action):
    """Collects ``NAME=TEXT``."""

    def __call__(self, parser, namespace, values, option_string=None):  # type: ignore[no-untyped-def]
        name, equals, text = str(values).partition("=")
        if not equals or not name:
            parser.error(f"{option_string} {values}: must be NAME=TEXT")
        namespace.labels = {**namespace.labels, name: text}


def _names(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def prepare_figure(option: str, path: Path | None) -> None:
    """Raise `InputError` unless a figure, if one is requested, can be written to ``path``."""
    if path is not None:
        from tiltsim.system.files import prepare_file
        from tiltsim.views.figures.style import FORMATS

        prepare_file(option, path, FORMATS)


def check_plot(arguments: argparse.Namespace, *, has_panels: bool = False) -> None:
    """Raise `InputError` for options of a figure without a figure, and for a file of no use.

    ``has_panels`` tells whether the figure has panels to choose from.
    """
    from tiltsim.errors import InputError

    options = {
        "--size": arguments.size,
        "--style": arguments.style,
        "--title": arguments.title,
        "--label": arguments.labels or None,
        "--panels": getattr(arguments, "panels", ()) or None,
    }
    for option, value in options.items():
        if value is not None and arguments.plot is None:
            raise InputError(f"{option}: needs --plot FILE")
    if options["--panels"] and not has_panels:
        raise InputError("--panels: this figure has no panels to choose from")
    prepare_figure("--plot", arguments.plot)


def save_figure(
    draw: Callable[[], Figure], path: Path, arguments: argparse.Namespace, *, is_named: bool = False
) -> None:
    """Draw a figure in the requested size and style and save it.

    Args:
        draw: Draws it.
        path: The file.
        arguments: With those that `add_figure_options` declares.
        is_named: Whether `draw` has applied title and labels.
    """
    from tiltsim.views.figures.adjusting import relabel, retitle
    from tiltsim.views.figures.style import paper_style, parse_size, save

    with paper_style(arguments.style, parse_size("--size", arguments.size)):
        figure = draw()
        if not is_named:
            retitle(figure, arguments.title)
            relabel(figure, arguments.labels)
        save(figure, path)
