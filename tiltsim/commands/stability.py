"""``tiltsim stability``: whether a rest point or a periodic orbit is stable."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING

from tiltsim.commands.figure_options import add_plot, check_plot, save_figure
from tiltsim.commands.options import Subparsers, add_json, add_overrides
from tiltsim.commands.text import aligned, json_text, number, print_figure_path, table

if TYPE_CHECKING:
    from tiltsim.linear.stability import Stability


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Print the poles of a scenario's rest point, or the Floquet multipliers of its
    periodic orbit, with the states that take part in each mode: controller, gait, servos, rotors,
    sampling and latency included, on the plant of the scenario."""
    summary = "poles of a rest point or multipliers of a periodic flight"
    parser = subparsers.add_parser("stability", help=summary, description=description)
    parser.add_argument("scenario", metavar="SCENARIO", help="a TOML file or a library name")
    add_overrides(parser, "the scenario", "gait.period=1.5")
    add_json(parser)
    add_plot(parser, "the poles or multipliers")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Analyze, draw, print."""
    from tiltsim.scenario.loading import load_scenario
    from tiltsim.scenario.override_keys import parse_override

    check_plot(arguments)
    overrides = dict(parse_override(text) for text in arguments.overrides)
    scenario = load_scenario(arguments.scenario, overrides)

    from tiltsim.linear.stability import stability

    found = stability(scenario)
    if arguments.plot is not None:
        from tiltsim.views.figures.stability import stability_figure

        save_figure(partial(stability_figure, found), arguments.plot, arguments)
    if arguments.json:
        print(json_text(found.report()))
    else:
        print(stability_text(found))
        print_figure_path(arguments)
    return 0


def stability_text(found: Stability) -> str:
    """The analysis in lines."""
    kind = "rest point" if found.period is None else f"orbit of {number(found.period)} s"
    verdict = "stable" if found.stable else "unstable"
    if found.neutral:
        verdict += f", {found.neutral} neutral: disturbed along them, it does not come back"
    rows = [("kind", kind), ("verdict", verdict), ("residual", number(found.residual, ".2g"))]
    if found.multipliers is not None:
        largest = found.multipliers[0]
        rows.append(("largest multiplier", f"{complex(largest):.5g}, size {abs(largest):.5g}"))
    header = ["mode", "frequency (rad/s)", "damping", "count", "states"]
    modes = [
        (
            mode.name,
            number(mode.frequency, ".5g"),
            number(mode.damping, ".4f"),
            str(mode.count),
            ", ".join(mode.states[:6]) + (", ..." if len(mode.states) > 6 else ""),
        )
        for mode in found.modes
    ]
    return "\n".join([*aligned(rows), "", table(header, modes, frozenset({1, 2, 3}))])
