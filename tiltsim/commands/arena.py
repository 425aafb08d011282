"""``tiltsim arena``: fixed tasks under every controller, with scores."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import (
    CORES,
    Jobs,
    Json,
    Names,
    OwnControllers,
    Quiet,
    Trust,
    positive_integer,
)
from tiltsim.commands.progress import Progress, show_progress
from tiltsim.commands.text import json_text, print_line, require_flown, write_text
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim.studies.arena import Vehicle

Tables = dict[str, dict[str, Mapping[str, Any]]]  # tables of controllers, by vehicle and name
GAINS_FILE: Final = "tuned_gains.json"
"""Gains of the shipped tasks, and the file that ``--tune`` writes."""

Count = Annotated[int | None, Option(read=positive_integer)]


def run(
    *,
    out: Path = Path("arena"),
    controllers: Names = (),
    own: OwnControllers = (),
    vehicles: Names = (),
    tune: Count = None,
    seed: Count = None,
    gains: Path | None = None,
    jobs: Jobs = CORES,
    json: Json = False,
    quiet: Quiet = False,
    trust: Trust = False,
) -> int:
    """Fly the tasks of scenarios/arena under every controller that fits, and score them.

    Controllers of installed packages are included; gains are default and tuned. Scores: 100 for no
    error, 50 for a root mean square error of 0.1 m or 0.1 rad of yaw (steps: a quarter of the
    step), 0 if the flight ends early, - if the task refuses the controller.

    Args:
        out (DIR): folder for arena.json, arena.png and arena.md (default: arena)
        controllers: laws, or given, the scenarios' own; default without --controller: all that fit
        vehicles: default: all
        tune (N): first search each controller's gains with at most N flights on other tasks, and
            write them to tuned_gains.json
        seed (S): seed of that search (default: 1)
        gains (FILE): tuned gains that --tune wrote; default: the gains of scenarios/arena
    """
    from dataclasses import asdict

    from tiltsim.commands.controllers import chosen_controllers
    from tiltsim.report.made import Made
    from tiltsim.resources import shipped_folder
    from tiltsim.studies.arena import FOLDER, chosen_vehicles, fitting, fly_tasks, standings
    from tiltsim.studies.arena_page import arena_page
    from tiltsim.studies.comparison import controller_tables, refusal
    from tiltsim.studies.tuning import read_tuning
    from tiltsim.system.files import prepare_folder
    from tiltsim.views.figures import style
    from tiltsim.views.figures.arena_scores import arena_figure

    if tune is not None and gains is not None:
        raise InputError("--gains: not with --tune, which searches gains itself")
    if tune is None and seed is not None:
        raise InputError("--seed: only with --tune")
    given = chosen_controllers(controllers, own)
    chosen = chosen_vehicles(vehicles)
    tables: Tables = {
        name: given or controller_tables(fitting(vehicle)) for name, vehicle in chosen.items()
    }
    prepare_folder(out)
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in chosen}
    with show_progress(shown=not quiet) as progress:
        if tune is not None:
            budget = {"flights": tune, "seed": seed or 1}
            tuning = _tuned(out / GAINS_FILE, chosen, tables, budget, jobs, progress)
        else:
            tuning = read_tuning(gains or shipped_folder("scenarios") / FOLDER / GAINS_FILE)
        tuned = _tables_of(tuning, tables)
        total = sum(
            len(vehicle.tasks) * (len(tables[name]) + len(tuned[name]))
            for name, vehicle in chosen.items()
        )
        progress.begin("flights", total)
        for vehicle, row in fly_tasks(chosen, tables, tuned, jobs, trusted=trust):
            rows[vehicle].append(row)
            progress.tell("flights", sum(map(len, rows.values())), total)
    made = Made.now()
    document = json_text({"made": asdict(made), "vehicles": rows})
    page = arena_page(rows, [made.sentence, _sentence(tuning)])
    write_text(out / "arena.json", document)
    write_text(out / "arena.md", page)
    every = {vehicle: standings(flown) for vehicle, flown in rows.items()}
    style.save(arena_figure(every), out / "arena.png")
    print(document if json else page)
    if not json:
        print_line(f"arena written to {out}")
    require_flown([refusal(row) for flown in rows.values() for row in flown])
    return 0


def _tuned(
    file: Path,
    vehicles: Mapping[str, Vehicle],
    tables: Tables,
    budget: dict[str, int],
    jobs: int,
    progress: Progress,
) -> dict[str, Any]:
    """Search gains, and write them into a file after each search: an interrupt keeps them."""
    from dataclasses import asdict

    from tiltsim.report.made import Made
    from tiltsim.studies.tuning import tune_all, tuning_document

    total, found = sum(map(len, tables.values())), {}
    progress.begin("searches", total)
    made = asdict(Made.now())
    tuning: dict[str, Any] = {}
    for search, result in tune_all(vehicles, tables, **budget, jobs=jobs):
        found[search] = result
        progress.tell("searches", len(found), total)
        tuning = tuning_document(found, **budget, made=made)
        write_text(file, json_text(tuning))
    return tuning


def _tables_of(tuning: Mapping[str, Any], tables: Tables) -> Tables:
    """Tuned tables of the controllers for which, with these very tables, gains were searched."""
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
