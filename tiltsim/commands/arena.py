"""``tiltsim arena``: fixed tasks under every controller, with scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

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
from tiltsim.commands.text import (
    Progress,
    json_text,
    print_line,
    require_flown,
    show_progress,
    write_text,
)
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim.studies.arena import Vehicle

Tables = dict[str, dict[str, Mapping[str, Any]]]  # tables of controllers, by vehicle and name
GAINS_FILE: Final = {"limited": "limited_gains.json", "unlimited": "tuned_gains.json"}
"""Gains of the shipped tasks by league, and the file that ``--tune`` writes."""

Count = Annotated[int | None, Option(read=positive_integer)]


def run(
    *,
    out: Path = Path("arena"),
    controllers: Names = (),
    own: OwnControllers = (),
    league: Literal["limited", "unlimited", "interaction"] = "limited",
    vehicles: Names = (),
    tasks: Names = (),
    tune: Count = None,
    seed: Count = None,
    gains: Path | None = None,
    jobs: Jobs = CORES,
    json: Json = False,
    quiet: Quiet = False,
    trust: Trust = False,
) -> int:
    """Fly fixed tasks under every controller that fits, and score them.

    The limited league has rotor limits, lag, latency, noise and model errors, and baselines with
    observers and mixers; in the unlimited one all that fit, also of packages, fly without; in the
    one of interaction vehicles push, open a door, land and carry loads. Scores: 100 for no error,
    50 for an rms error of 0.1 m, 0.1 rad of yaw, a quarter of a step, 0.5 N of a push, or a last
    swing of 0.1 rad; 0 for an idle vehicle and an early end, - where a task refuses the controller.

    Args:
        out (DIR): folder for arena.csv, arena.json, arena.png and arena.md (default: arena)
        controllers: laws, or given, the scenarios' own; default without --controller: all that fit
        league: limited, unlimited or interaction (default: limited)
        vehicles: default: all
        tasks: names such as circle; default: all
        tune (N): first search each controller's gains with at most N flights on other tasks, and
            write them to limited_gains.json or tuned_gains.json
        seed (S): seed of that search (default: 1)
        gains (FILE): tuned gains that --tune wrote; default: the gains of scenarios/arena
    """
    from dataclasses import asdict

    from tiltsim.commands.compare import chosen_controllers
    from tiltsim.report.made import Made
    from tiltsim.resources import shipped_folder
    from tiltsim.studies.arena import FOLDER, OURS, chosen_vehicles, fly_matches, matches
    from tiltsim.studies.comparison import refusal
    from tiltsim.studies.tuning import read_tuning
    from tiltsim.system.files import prepare_folder

    if tune is not None and gains is not None:
        raise InputError("--gains: not with --tune, which searches gains itself")
    if tune is None and seed is not None:
        raise InputError("--seed: only with --tune")
    if tune is not None and league not in GAINS_FILE:
        raise InputError(f"--tune: not in the league of {league}, which has no tuning tasks")
    given = chosen_controllers(controllers, own)
    chosen = chosen_vehicles(vehicles, league, tasks)
    tables = _tables(chosen, given, league)
    prepare_folder(out)
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in chosen}
    with show_progress(shown=not quiet) as progress:
        if tune is not None:
            budget = {"flights": tune, "seed": seed or 1}
            searched = _tables(chosen, given, league, without=(OURS,) * (league == "limited"))
            tuning = _tuned(out / GAINS_FILE[league], chosen, searched, budget, jobs, progress)
        elif gains is not None or league in GAINS_FILE:
            tuning = read_tuning(gains or shipped_folder("scenarios") / FOLDER / GAINS_FILE[league])
        else:
            tuning = {"gains": {}}
        tuned = _tables_of(tuning, tables)
        flights = matches(league, chosen, tables, tuned, trusted=trust)
        progress.begin("flights", len(flights))
        for name, row in fly_matches(flights, jobs):
            rows[name].append(row)
            progress.tell("flights", sum(map(len, rows.values())), len(flights))
    made = Made.now()
    document = json_text({"made": asdict(made), "vehicles": rows})
    page = _written(out, rows, [made.sentence, _sentence(tuning, league)], league)
    write_text(out / "arena.json", document)
    print(document if json else page)
    if not json:
        print_line(f"arena written to {out}")
    require_flown([refusal(row) for flown in rows.values() for row in flown])
    return 0


def _tables(
    chosen: Mapping[str, Vehicle],
    given: Mapping[str, Mapping[str, Any]],
    league: str,
    without: Sequence[str] = (),
) -> Tables:
    """Tables of the named controllers, or of all in a league, by vehicle and name."""
    from tiltsim.studies.arena import tables_of

    found: Tables = {}
    for name, vehicle in chosen.items():
        known = tables_of(vehicle, league)
        named = {one: known.get(one, table) for one, table in given.items()} or known
        found[name] = {one: table for one, table in named.items() if one not in without}
    return found


def _written(
    out: Path, rows: Mapping[str, list[dict[str, Any]]], made: list[str], league: str
) -> str:
    """Write page, table and picture of a league into a folder; returns the page."""
    from tiltsim.studies.arena import standings
    from tiltsim.studies.arena_page import arena_page, by_world, league_page, league_table
    from tiltsim.views.figures import style
    from tiltsim.views.figures.comparisons import arena_figure, panels_of, tasks_of, vehicles_of

    if league == "limited":
        page, panels = league_page(rows, made), {}
        for world, of in by_world(rows).items():
            every = {vehicle: standings(flown) for vehicle, flown in of.items()}
            together = standings([row for flown in of.values() for row in flown])
            panels[f"{world}: tasks, mean of the vehicles"] = tasks_of(together)
            panels[f"{world}: vehicles"] = vehicles_of(every)
    else:
        page = arena_page(rows, made)
        panels = panels_of({vehicle: standings(flown) for vehicle, flown in rows.items()})
    write_text(out / "arena.md", page)
    write_text(out / "arena.csv", league_table(rows))
    style.save(arena_figure(panels), out / "arena.png")
    return page


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


def _sentence(tuning: Mapping[str, Any], league: str) -> str:
    from tiltsim.studies.arena import SEEDS, WORLDS

    seeds = max((SEEDS[world] for world in WORLDS[league]), key=len)
    if not tuning["gains"]:
        return f"Seeds of the tasks: {', '.join(map(str, seeds))}."
    made = tuning["made"]
    at = f" at commit {made['commit']}" if made["commit"] else ""
    return (
        f"Seeds of the tasks: {', '.join(map(str, seeds))}. Tuned gains: a search of "
        f"{tuning['flights']} flights each with seed {tuning['seed']}, of {made['date']}{at}."
    )
