"""``tiltsim compare``: the same flights under several controllers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands import text
from tiltsim.commands.declaring import mistakes_in
from tiltsim.commands.options import (
    CORES,
    Jobs,
    Json,
    Names,
    Overrides,
    OwnControllers,
    Quiet,
    Trust,
)
from tiltsim.commands.text import show_progress
from tiltsim.views import figures

if TYPE_CHECKING:
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


def run(
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
            print(text.json_text(rows))
        elif rows:
            searched = (*SEARCHES, "compiled_time_per_call")
            _print(rows, [key for key in MEASURES if not (nominal and key in searched)])
        if rows and out is not None:
            text.write_text(out / "comparison.json", text.json_text(rows))
            drawn = figures.comparisons.comparison_figure(compared)
            figures.style.save(drawn, out / "comparison.png")
            if not json:
                text.print_line(f"comparison written to {out}")
    text.require_flown([refusal(one.row) for one in compared])
    return 0


def _print(rows: list[dict[str, Any]], shown: list[str]) -> None:
    """A table for every scenario, and below it why flights ended or were refused."""
    from tiltsim.studies.comparison import CONTACTS

    for scenario in dict.fromkeys(row["scenario"] for row in rows):
        chosen = [row for row in rows if row["scenario"] == scenario]
        unknown = [key for key in CONTACTS if all(row[key] is None for row in chosen)]
        columns: text.Columns = {
            "controller": ("controller", ""),
            **{MEASURES[k][0]: (partial(_cell, k), ">") for k in shown if k not in unknown},
        }
        text.print_line(scenario)
        print(text.table(columns, chosen))
        for row in chosen:
            if row["end"] != "completed":
                text.print_line(f"{row['controller']}: {row['refused'] or row['end']}")
            elif row["latency_refused"]:
                text.print_line(f"{row['controller']}: {row['latency_refused']}")
        text.print_line("")


def _cell(key: str, row: dict[str, Any]) -> str:
    from tiltsim.studies.comparison import is_last_tried, why_none

    _, form, factor = MEASURES[key]
    if row[key] is None:
        return why_none(row, key)
    return text.number(factor * row[key], form) + "+" * is_last_tried(row, key)


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
