"""What the commands that analyze a scenario share: the scenario, its keys, and what they print."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from tiltsim.commands.figure_options import add_plot, check_plot, save_figure
from tiltsim.commands.options import add_json, add_overrides, add_quiet, add_trust
from tiltsim.commands.text import json_text, print_figure_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tiltsim.scenario.scenario import Scenario


def add_analysis(parser: argparse.ArgumentParser, figure: str, example: str) -> None:
    """Declare the scenario, ``--set``, ``--json``, ``--quiet``, ``--trust``, the figure's options.

    Args:
        parser: Of the command.
        figure: What ``--plot`` draws.
        example: A value of ``--set``.
    """
    parser.add_argument("scenario", metavar="SCENARIO", help="a TOML file or a library name")
    add_overrides(parser, "the scenario", example)
    add_json(parser)
    add_quiet(parser, "show no progress")
    add_trust(parser)
    add_plot(parser, figure)


def requested_scenarios(arguments: argparse.Namespace, *more: str) -> list[Scenario]:
    """The scenario and more, with the keys of ``--set``. Checks the options of the figure first."""
    from tiltsim.scenario.loading import load_scenario
    from tiltsim.scenario.override_keys import parse_override

    check_plot(arguments)
    overrides = dict(parse_override(text) for text in arguments.overrides)
    return [
        load_scenario(address, overrides, trusted=arguments.trust)
        for address in (arguments.scenario, *more)
    ]


def print_analysis(
    arguments: argparse.Namespace, report: Any, text: str, draw: Callable[[], Figure]
) -> None:
    """Save the figure, if one is requested, and print the analysis.

    Args:
        arguments: With those that `add_analysis` declares.
        report: For ``--json``.
        text: Without it.
        draw: Draws the figure.
    """
    if arguments.plot is not None:
        save_figure(draw, arguments.plot, arguments)
    print(json_text(report) if arguments.json else text)
    print_figure_path(arguments)
