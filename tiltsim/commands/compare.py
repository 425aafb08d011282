"""``tiltsim compare`` and ``arena``: flights, or fixed tasks, under several controllers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from tiltsim.commands.declaring import Option, mistakes_in
from tiltsim.commands.options import (
    CORES,
    Jobs,
    Json,
    Names,
    Overrides,
    OwnControllers,
    Quiet,
    Trust,
    positive_integer,
)
from tiltsim.commands.text import (
    Columns,
    Progress,
    json_text,
    number,
    print_line,
    require_flown,
    show_progress,
    table,
    write_text,
)
from tiltsim.errors import InputError
from tiltsim.views import figures

if TYPE_CHECKING:
    from tiltsim.studies.arena import Vehicle
    from tiltsim.studies.comparison import Compared

MEASURES: Final = {
    "rms_position_error": ("rms error (m)", ".3g", 1.0),
    "max_position_error": ("largest (m)", ".3g", 1.0),
    "final_position_error": ("final (m)", ".3g", 1.0),
    "rms_rotor_acceleration": ("rotors (rad/s²)", ".0f", 1.0),
    "tilt_travel": ("tilts (rad)", ".1f", 1.0),
    "min_singularity_margin": ("margin (rad)", ".2f", 1.0),
    "min_rotor_speed": ("slowest (rad/s)", ".0f", 1.0),
    "saturated_fraction": ("saturated (%)", ".1f", 100.0),
    "rms_force_error": ("force (N)", ".3g", 1.0),
    "peak_force": ("peak (N)", ".3g", 1.0),
    "time_in_contact": ("contact (s)", ".1f", 1.0),
    "final_swing": ("swing (rad)", ".3g", 1.0),
    "max_latency": ("latency (ms)", ".0f", 1000.0),
    "max_mass_factor": ("mass ×", ".2f", 1.0),
    "min_thrust_factor": ("thrust ×", ".2f", 1.0),
    "max_inertia_factor": ("inertia ×", ".1f", 1.0),
    "time_per_call": ("call (µs)", ".0f", 1e6),
    "compiled_time_per_call": ("compiled (µs)", ".1f", 1e6),
}
"""Measures in the table: heading, form and factor."""


def run_compare(
    scenarios: tuple[str, ...],
    *,
    controllers: Names = (),
    own: OwnControllers = (),
    nominal: bool = False,
    out: Path | None = None,
    overrides: Overrides = (),
    jobs: Jobs = CORES,
    json: Json = False,
    quiet: Quiet = False,
    trust: Trust = False,
) -> int:
    """Fly scenarios under several controllers, and compare their errors, effort and robustness.

    Robustness is the largest latency and the largest errors of mass, thrust and inertia that each
    survives: flights that end regularly, in the last second within 1 m of the reference; with +,
    nothing beyond was tried, lost where a flight fails without any error, refused where the law
    cannot be sampled. The times of a call are measured for a control step in Python and compiled.

    Args:
        scenarios (SCENARIO): files, folders or names of the library
        controllers: laws, with their default gains; given: the scenario's own controller
        nominal: leave out the search for robustness, forty flights each
        out (DIR): also write comparison.json and comparison.png
    """
    from tiltsim.studies.checking import collect
    from tiltsim.studies.comparison import SEARCHES, compare, refusal
    from tiltsim.system.files import prepare_folder

    if out is not None:
        prepare_folder(out)
    tables = chosen_controllers(controllers, own)
    addresses = collect(scenarios)
    compared: list[Compared] = []
    changes = dict(overrides)
    flown = compare(addresses, tables, changes, searches=not nominal, jobs=jobs, trusted=trust)
    try:
        with show_progress(shown=not quiet) as progress:
            total = len(addresses) * len(tables)
            progress.begin("comparisons", total)
            for one in flown:
                compared.append(one)
                progress.tell("comparisons", len(compared), total)
    finally:  # finished flights are shown, even if the rest is interrupted
        rows = [one.row for one in compared]
        if rows and json:
            print(json_text(rows))
        elif rows:
            searched = (*SEARCHES, "compiled_time_per_call")
            _print(rows, [key for key in MEASURES if not (nominal and key in searched)])
        if rows and out is not None:
            write_text(out / "comparison.json", json_text(rows))
            drawn = figures.comparisons.comparison_figure(compared)
            figures.style.save(drawn, out / "comparison.png")
            if not json:
                print_line(f"comparison written to {out}")
    require_flown([refusal(one.row) for one in compared])
    return 0


def _print(rows: list[dict[str, Any]], shown: list[str]) -> None:
    """A table for every scenario, and below it why flights ended or were refused."""
    from tiltsim.studies.comparison import CONTACTS

    for scenario in dict.fromkeys(row["scenario"] for row in rows):
        chosen = [row for row in rows if row["scenario"] == scenario]
        unknown = [key for key in CONTACTS if all(row[key] is None for row in chosen)]
        columns: Columns = {
            "controller": ("controller", ""),
            **{MEASURES[k][0]: (partial(_cell, k), ">") for k in shown if k not in unknown},
        }
        print_line(scenario)
        print(table(columns, chosen))
        for row in chosen:
            if row["end"] != "completed":
                print_line(f"{row['controller']}: {row['refused'] or row['end']}")
            elif row["latency_refused"]:
                print_line(f"{row['controller']}: {row['latency_refused']}")
        print_line("")


def _cell(key: str, row: dict[str, Any]) -> str:
    from tiltsim.studies.comparison import is_last_tried, why_none

    _, form, factor = MEASURES[key]
    if row[key] is None:
        return why_none(row, key)
    return number(factor * row[key], form) + "+" * is_last_tried(row, key)


def chosen_controllers(laws: Sequence[str], own: Sequence[str]) -> dict[str, Mapping[str, Any]]:
    """The tables of ``--controllers`` and ``--controller``, by name. Raises `InputError`."""
    from tiltsim.studies.comparison import controller_tables

    chosen = controller_tables(laws)
    for given in own:
        with mistakes_in(f"--controller {given}"):
            name, table = _own(given)
            if name in chosen:
                raise ValueError(f"{name} is there twice; choose another name")
            chosen[name] = table
    return chosen


def _own(text: str) -> tuple[str, dict[str, Any]]:
    """Name and table of a ``--controller``. Raises ValueError for an unknown law or key."""
    from tiltsim.scenario.controller import CONTROLLERS
    from tiltsim.scenario.documents import parse_override
    from tiltsim.scenario.messages import choose

    if "=" not in text and ".py:" in text:
        return text.rpartition(":")[2], {"law": "numpy", "function": _absolute(text)}
    name, table = parse_override(text) if text.find("=") > 0 else (text, None)
    if not isinstance(table, dict) or not isinstance(table.get("law"), str):
        raise ValueError('write NAME={law="pid", KEY=VALUE, ...} or FILE.py:FUNCTION')
    law = table["law"]
    if law not in CONTROLLERS:
        raise ValueError(f"law: {choose(law, CONTROLLERS)}")
    known = CONTROLLERS[law].model_fields
    for key in table:
        if key not in known:
            raise ValueError(f"{key}: {choose(key, known)}")
    if isinstance(table.get("function"), str):
        table["function"] = _absolute(table["function"])
    return name, table


def _absolute(function: str) -> str:
    """A function of a file of the working folder, for scenarios of other folders."""
    from tiltsim.system.files import is_file

    file, colon, name = function.rpartition(":")
    if file and not is_file(Path(file)):
        raise ValueError(f"{file}: no such file")
    return f"{Path(file).resolve()}{colon}{name}" if file else function


Tables = dict[str, dict[str, Mapping[str, Any]]]  # tables of controllers, by vehicle and name
GAINS_FILE: Final = {"limited": "limited_gains.json", "unlimited": "tuned_gains.json"}
"""Gains of the shipped tasks by league, and the file that ``--tune`` writes."""

Count = Annotated[int | None, Option(read=positive_integer)]


def run_arena(
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

    from tiltsim.report.making import Made
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

    from tiltsim.report.making import Made
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
