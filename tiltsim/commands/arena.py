"""``tiltsim arena``: fixed tasks under every controller, with scores."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.options import (
    Subparsers,
    add_controllers,
    add_jobs,
    add_json,
    add_quiet,
    add_trust,
    positive_integer,
)
from tiltsim.commands.progress import Progress, show_progress
from tiltsim.commands.text import json_text, print_line, require_flown
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim.studies.arena import Vehicle

Tables = dict[str, dict[str, Mapping[str, Any]]]
"""Tables of controllers, by vehicle and name."""

GAINS_FILE: Final = "tuned_gains.json"
"""Of the shipped tasks, and what ``--tune`` writes."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly the tasks of scenarios/arena under every controller that fits the vehicle,
    installed packages included, with default and with tuned gains, and score them: 100 for no
    error, 50 for a root mean square error of 0.1 m or 0.1 rad of yaw (steps: a quarter of the
    step), 0 if the flight ends early, - if the task refuses the controller."""
    parser = subparsers.add_parser(
        "arena", help="score controllers on fixed tasks", description=description
    )
    add = parser.add_argument
    add(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="for arena.json, arena.png and arena.md",
    )
    listed = "laws, or given, the scenarios' own; default without --controller: all that fit"
    add_controllers(parser, listed)
    add("--vehicles", metavar="A,B,...", help="default: all")
    add(
        "--tune",
        type=positive_integer,
        metavar="N",
        help=f"first search each controller's gains with at most N flights on other tasks, and "
        f"write them to {GAINS_FILE}",
    )
    add("--seed", type=positive_integer, metavar="S", help="of that search (default: 1)")
    add(
        "--gains",
        type=Path,
        metavar="FILE",
        help="tuned gains that --tune wrote; default: those of the page, scenarios/arena",
    )
    add_jobs(parser)
    add_json(parser)
    add_quiet(parser, "show no progress")
    add_trust(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Tune, fly, score, write."""
    from dataclasses import asdict

    from tiltsim.commands.controllers import chosen_controllers, names
    from tiltsim.report.made import Made
    from tiltsim.studies.arena import chosen_vehicles, fitting, fly_tasks, standings
    from tiltsim.studies.arena_page import arena_page
    from tiltsim.studies.comparison import controller_tables, refusal
    from tiltsim.system.files import prepare_folder, replacing
    from tiltsim.views.figures import style
    from tiltsim.views.figures.arena_scores import arena_figure

    if arguments.tune is not None and arguments.gains is not None:
        raise InputError("--gains: not with --tune, which searches gains anew")
    if arguments.tune is None and arguments.seed is not None:
        raise InputError("--seed: only with --tune, whose search it is of")
    own = chosen_controllers(arguments)
    vehicles = chosen_vehicles(names("--vehicles", arguments.vehicles))
    tables = {
        name: dict(own) or controller_tables(fitting(vehicle)) for name, vehicle in vehicles.items()
    }
    prepare_folder(arguments.out)
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in vehicles}
    with show_progress(shown=not arguments.quiet) as progress:
        tuning = _tuning(arguments, vehicles, tables, progress)
        tuned = _tuned_tables(tuning, tables)
        total = sum(
            len(vehicle.tasks) * (len(tables[name]) + len(tuned[name]))
            for name, vehicle in vehicles.items()
        )
        progress.begin("flights", total)
        flown = fly_tasks(vehicles, tables, tuned, arguments.jobs, trusted=arguments.trust)
        for vehicle, row in flown:
            rows[vehicle].append(row)
            progress.tell("flights", sum(map(len, rows.values())), total)
    made = Made.now()
    document = json_text({"made": asdict(made), "vehicles": rows})
    page = arena_page(rows, [made.sentence, _sentence(tuning)])
    for name, text in (("arena.json", document + "\n"), ("arena.md", page)):
        with replacing(arguments.out / name) as file:
            file.write_text(text, encoding="utf-8")
    every = {vehicle: standings(chosen) for vehicle, chosen in rows.items()}
    style.save(arena_figure(every), arguments.out / "arena.png")
    if arguments.json:
        print(document)
    else:
        print(page)
        print_line(f"arena written to {arguments.out}")
    require_flown([refusal(row) for chosen in rows.values() for row in chosen])
    return 0


def _tuning(
    arguments: argparse.Namespace,
    vehicles: Mapping[str, Vehicle],
    tables: Tables,
    progress: Progress,
) -> dict[str, Any]:
    """Tuned gains: searched and written, or read."""
    from dataclasses import asdict

    from tiltsim.report.made import Made
    from tiltsim.resources import shipped_folder
    from tiltsim.studies.arena import FOLDER
    from tiltsim.studies.tuning import read_tuning, tune_all, tuning_document
    from tiltsim.system.files import replacing

    if arguments.tune is None:
        shipped = shipped_folder("scenarios") / FOLDER / GAINS_FILE
        return read_tuning(arguments.gains or shipped)
    total, found = sum(map(len, tables.values())), {}
    progress.begin("searches", total)
    made = asdict(Made.now())
    budget = {"flights": arguments.tune, "seed": arguments.seed or 1}
    tuning: dict[str, Any] = {}
    for search, result in tune_all(vehicles, tables, **budget, jobs=arguments.jobs):
        found[search] = result
        progress.tell("searches", len(found), total)
        tuning = tuning_document(found, **budget, made=made)
        with replacing(arguments.out / GAINS_FILE) as file:  # an interrupt keeps what is found
            file.write_text(json_text(tuning) + "\n", encoding="utf-8")
    return tuning


def _tuned_tables(tuning: Mapping[str, Any], tables: Tables) -> Tables:
    """Of the controllers with these very tables for which gains were searched."""
    return {
        vehicle: {
            name: tuning["gains"][vehicle][name]["table"]
            for name, table in chosen.items()
            if name in tuning["gains"].get(vehicle, {})
            and tuning["gains"][vehicle][name]["of"] == dict(table)
        }
        for vehicle, chosen in tables.items()
    }


def _sentence(tuning: Mapping[str, Any]) -> str:
    made = tuning["made"]
    at = f" at commit {made['commit']}" if made["commit"] else ""
    return (
        f"All tasks have `simulation.seed = 1`. Tuned gains: a search of {tuning['flights']} "
        f"flights each with seed {tuning['seed']}, of {made['date']}{at}."
    )
