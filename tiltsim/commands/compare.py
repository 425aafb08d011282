"""``tiltsim compare``: the same flights under several controllers."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.options import (
    Subparsers,
    add_controllers,
    add_jobs,
    add_json,
    add_overrides,
    add_quiet,
    add_trust,
)
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import json_text, number, print_line, require_flown, table

if TYPE_CHECKING:
    from tiltsim.studies.comparison import Compared

COLUMNS: Final = {
    "rms_position_error": ("rms error (m)", ".3g", 1.0),
    "max_position_error": ("largest (m)", ".3g", 1.0),
    "final_position_error": ("final (m)", ".3g", 1.0),
    "rms_rotor_acceleration": ("rotors (rad/s²)", ".0f", 1.0),
    "tilt_travel": ("tilts (rad)", ".1f", 1.0),
    "min_singularity_margin": ("margin (rad)", ".2f", 1.0),
    "min_rotor_speed": ("slowest (rad/s)", ".0f", 1.0),
    "saturated_fraction": ("saturated (%)", ".1f", 100.0),
    "max_latency": ("latency (ms)", ".0f", 1000.0),
    "max_mass_factor": ("mass ×", ".2f", 1.0),
    "min_thrust_factor": ("thrust ×", ".2f", 1.0),
    "max_inertia_factor": ("inertia ×", ".1f", 1.0),
    "time_per_call": ("call (µs)", ".0f", 1e6),
    "compiled_time_per_call": ("compiled (µs)", ".1f", 1e6),
}
"""Measures in the table: heading, form and factor."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly scenarios under several controllers, and compare tracking error, effort,
    smallest margin, and the largest latency and errors of mass, thrust and inertia that each
    survives: flights that end regularly, in the last second within 1 m of the reference; with +,
    nothing beyond was tried, lost where a flight fails without any error, refused where the law
    cannot be sampled. The times of a call are those of a control step in Python and compiled."""
    parser = subparsers.add_parser(
        "compare", help="fly scenarios under several controllers", description=description
    )
    add = parser.add_argument
    add("scenarios", nargs="+", metavar="SCENARIO", help="files, folders or names of the library")
    add_controllers(parser, "laws, with their default gains; given: the scenario's own controller")
    add("--nominal", action="store_true", help="leave out what each survives, forty flights each")
    add("--out", type=Path, metavar="DIR", help="also write comparison.json and comparison.png")
    add_overrides(parser, "all flights", "simulation.duration=10")
    add_jobs(parser)
    add_json(parser)
    add_quiet(parser, "show no progress")
    add_trust(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fly, print, draw."""
    from tiltsim.commands.controllers import chosen_controllers
    from tiltsim.scenario.override_keys import parse_override
    from tiltsim.studies.checking import collect
    from tiltsim.studies.comparison import compare, refusal
    from tiltsim.system.files import prepare_folder

    if arguments.out is not None:
        prepare_folder(arguments.out)
    controllers = chosen_controllers(arguments)
    addresses, compared = collect(arguments.scenarios), []
    flown = compare(
        addresses,
        controllers,
        dict(map(parse_override, arguments.overrides)),
        searches=not arguments.nominal,
        jobs=arguments.jobs,
        trusted=arguments.trust,
    )
    try:
        with show_progress(shown=not arguments.quiet) as progress:
            total = len(addresses) * len(controllers)
            progress.begin("comparisons", total)
            for one in flown:
                compared.append(one)
                progress.tell("comparisons", len(compared), total)
    finally:  # what is flown is shown, even if the rest is interrupted
        if compared:
            _show(compared, arguments)
    require_flown([refusal(one.row) for one in compared])
    return 0


def _show(compared: list[Compared], arguments: argparse.Namespace) -> None:
    """Print the rows, and write them with their figure into the folder."""
    rows = [one.row for one in compared]
    if arguments.json:
        print(json_text(rows))
    else:
        _print(rows, searched=not arguments.nominal)
    if arguments.out is None:
        return
    from tiltsim.system.files import replacing
    from tiltsim.views.figures import style
    from tiltsim.views.figures.controllers_compared import comparison_figure

    with replacing(arguments.out / "comparison.json") as file:
        file.write_text(json_text(rows) + "\n", encoding="utf-8")
    style.save(comparison_figure(compared), arguments.out / "comparison.png")
    if not arguments.json:
        print_line(f"comparison written to {arguments.out}")


def _print(rows: list[dict[str, Any]], *, searched: bool) -> None:
    """A table for every scenario, and below it why flights ended or were refused."""
    from tiltsim.studies.comparison import SEARCHES

    with_searches = (*SEARCHES, "compiled_time_per_call")
    shown = [key for key in COLUMNS if searched or key not in with_searches]
    header = ("controller", *(COLUMNS[key][0] for key in shown))
    for scenario in dict.fromkeys(row["scenario"] for row in rows):
        chosen = [row for row in rows if row["scenario"] == scenario]
        cells = [(row["controller"], *(_cell(row, key) for key in shown)) for row in chosen]
        print_line(scenario)
        print(table(header, cells, frozenset(range(1, len(header)))))
        for row in chosen:
            if row["end"] != "completed":
                print_line(f"{row['controller']}: {row['refused'] or row['end']}")
            elif row["latency_refused"]:
                print_line(f"{row['controller']}: {row['latency_refused']}")
        print_line("")


def _cell(row: dict[str, Any], key: str) -> str:
    from tiltsim.studies.comparison import is_last_tried, why_none

    _, form, factor = COLUMNS[key]
    if row[key] is None:
        return why_none(row, key)
    return number(factor * row[key], form) + "+" * is_last_tried(row, key)
