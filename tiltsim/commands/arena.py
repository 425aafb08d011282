"""``tiltsim arena``: fixed tasks under every controller, with scores."""

from __future__ import annotations

import argparse
from pathlib import Path

from tiltsim.commands.options import Subparsers, add_jobs, add_json, add_quiet
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import json_text, print_line


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly the tasks of scenarios/arena under every controller that fits the vehicle,
    installed packages included, and score them: 100 for no error, 50 for a root mean square error
    of 0.1 m or 0.1 rad of yaw (steps: a quarter of the step), 0 if the flight ends early, - if the
    task refuses the controller."""
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
    add(
        "--controllers",
        default="",
        metavar="A,B,...",
        help="laws, or given, the scenarios' own; default: all that fit",
    )
    add("--vehicles", default="", metavar="A,B,...", help="files of the tasks; default: all")
    add_jobs(parser)
    add_json(parser)
    add_quiet(parser, "show no progress")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fly, score, write."""
    from dataclasses import asdict

    from tiltsim.report.made import Made
    from tiltsim.studies.arena import (
        arena_page,
        chosen_vehicles,
        fitting,
        fly_tasks,
        score,
        standings,
    )
    from tiltsim.system.files import prepare_folder, replacing
    from tiltsim.views.figures import style
    from tiltsim.views.figures.arena_scores import arena_figure

    controllers = _names(arguments.controllers)
    tasks = chosen_vehicles(_names(arguments.vehicles))
    prepare_folder(arguments.out)
    rows: dict[str, list[dict[str, object]]] = {vehicle: [] for vehicle in tasks}
    total = sum(len(each) * len(controllers or fitting(each)) for each in tasks.values())
    with show_progress(shown=not arguments.quiet) as progress:
        progress.begin("flights", total)
        for vehicle, one in fly_tasks(tasks, controllers, arguments.jobs):
            rows[vehicle].append(one.row | {"score": score(one.row)})
            progress.tell("flights", sum(map(len, rows.values())), total)
    made = Made.now()
    document = json_text({"made": asdict(made), "vehicles": rows})
    page = arena_page(rows, made.sentence)
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
    return 0


def _names(text: str) -> list[str]:
    return list(dict.fromkeys(filter(None, (name.strip() for name in text.split(",")))))
