"""The pages of the arena in Markdown, and the table of all flights as CSV."""

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import StringIO
from statistics import mean, median
from typing import Any, Final

from tiltsim.studies.arena import LIMITED, OURS, Standing, are_rivals, beaten, best, standings
from tiltsim.studies.comparison import CONTACTS, refusal
from tiltsim.studies.scores import HALF, INTERACTION, errors_of, task_of
from tiltsim.system.text import in_words

Rows = Mapping[str, Sequence[Mapping[str, Any]]]  # rows of flights, by vehicle

UNITS: Final = {
    "position_error": "m",
    "yaw_error": "rad",
    "rms_force_error": "N",
    "peak_force": "N",
    "final_swing": "rad",
}
"""Units of the errors that scores are made of."""


def arena_page(rows: Rows, made: Sequence[str]) -> str:
    """How often baselines win, all totals, a table for each vehicle, and every refusal.

    Args:
        rows: Rows of each vehicle.
        made: Sentences on versions, seeds and gains.
    """
    every = {vehicle: standings(chosen) for vehicle, chosen in rows.items()}
    tuned = any(row["gains"] == "tuned" for chosen in rows.values() for row in chosen)
    kinds = ("tuned", "default") if tuned else ("default",)
    lines = ["# Arena", "", *_baselines_win(every, kinds), "## All tasks", "", *_totals(every)]
    for vehicle, ranked in every.items():
        title = vehicle.replace("_", " ").capitalize()
        lines += ["", f"## {title}", "", *_tasks(ranked), *_contacts(rows[vehicle], ranked)]
    lines += _refusals(row for flown in rows.values() for row in flown)
    return "\n".join([*lines, "", *made, ""])


def _baselines_win(every: Mapping[str, Sequence[Standing]], kinds: Sequence[str]) -> Iterator[str]:
    """In how many tasks, of the vehicles that baselines and others flew."""
    rivals = {vehicle: ranked for vehicle, ranked in every.items() if are_rivals(ranked)}
    tasks = sum(len(ranked[0].scores) for ranked in rivals.values())
    for gains in kinds if rivals else ():
        won = {vehicle: beaten(ranked, gains) for vehicle, ranked in rivals.items()}
        shares = (f"{vehicle} {number}" for vehicle, number in won.items())
        yield (
            f"With {gains} gains a baseline beats all other controllers that flew in "
            f"{sum(won.values())} of {tasks} tasks: {', '.join(shares)}."
        )
        yield ""


def _table(first: str, heads: Iterable[str], lines: Mapping[str, Iterable[str]]) -> list[str]:
    """A table with a first column and columns of numbers; ``lines`` are its rows by name."""
    line = " | ".join
    heads = [*heads]
    shown = [f"| {name} | {line(cells)} |" for name, cells in lines.items()]
    return [
        f"| {first}".rstrip() + f" | {line(heads)} |",
        "| --- |" + " --: |" * len(heads),
        *shown,
    ]


def _totals(every: Mapping[str, Sequence[Standing]]) -> list[str]:
    """Vehicles as rows, controllers as columns."""
    names = list(dict.fromkeys(one.controller for ranked in every.values() for one in ranked))
    lines = {}
    for vehicle, ranked in every.items():
        cells = {one.controller: cell(one.total, one.tuned_total) for one in ranked}
        lines[vehicle] = [cells.get(name, "") for name in names]
    return _table("", map("`{}`".format, names), lines)


def _tasks(ranked: Sequence[Standing]) -> list[str]:
    """Tasks as rows, controllers as columns."""
    lines = {
        f"`{task}`": [cell(one.scores[task], one.tuned[task]) for one in ranked]
        for task in (ranked[0].scores if ranked else ())
    }
    lines["all tasks"] = [cell(one.total, one.tuned_total) for one in ranked]
    return _table("task", (f"`{one.controller}`" for one in ranked), lines)


def _contacts(rows: Sequence[Mapping[str, Any]], ranked: Sequence[Standing]) -> list[str]:
    """Errors of flights with contacts or loads: tasks as rows, controllers as columns."""
    names = [standing.controller for standing in ranked]
    flown = {(row["scenario"], row["controller"]): row for row in rows}
    lines = {}
    for address in dict.fromkeys(address for address, _ in flown if address in INTERACTION):
        of = [flown[address, name] for name in names]
        for measure in dict.fromkeys((*HALF, *INTERACTION[address].halves)):
            lines[f"`{task_of(of[0])}`: {in_words(measure)}, {UNITS[measure]}"] = [
                f"{errors_of(row, [measure])[measure]:.3f}" if row["end"] == "completed" else "-"
                for row in of
            ]
    return ["", *_table("error", map("`{}`".format, names), lines)] if lines else []


def _refusals(rows: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """A line for every reason why tasks refuse a controller."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for row in rows:
        if (reason := refusal(row)) is not None:
            found.setdefault((row["controller"], reason), {})[task_of(row)] = None
    yield from ("", "## Refused", "") if found else ()
    for (name, reason), tasks in found.items():
        yield f"- `{name}` in {', '.join(f'`{task}`' for task in tasks)}: {reason}"


def cell(default: float | None, tuned: float | None) -> str:
    """Two scores as text, one where they are the same."""
    before, after = shown(default), shown(tuned)
    return before if before == after else f"{before} → {after}"


def shown(value: float | None) -> str:
    """A score as text."""
    return "-" if value is None else f"{value:.0f}"


TIE: Final = 0.5  # difference of scores below which two controllers tie

DISTURBED: Final = ("circle", "figure_eight", "gust", "wind", "weak_rotor")
"""Tasks in which errors come from a disturbance or a moving reference alone."""

COLUMNS: Final = (
    "controller",
    "gains",
    "world",
    "seed",
    "end",
    "score",
    "rms_position_error",
    "final_position_error",
    "rms_yaw_error",
    "rms_rotor_acceleration",
    "peak_rotor_speed",
    "saturated_fraction",
    *CONTACTS,
)
"""Columns of the table of flights after vehicle and task, unrounded; SI units."""


def league_table(rows: Rows) -> str:
    """All flights as CSV."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["vehicle", "task", *COLUMNS])
    for vehicle, flown in rows.items():
        writer.writerows(
            [vehicle, task_of(row), *(row.get(column) for column in COLUMNS)] for row in flown
        )
    return text.getvalue()


def by_world(rows: Rows) -> dict[str, dict[str, list[Mapping[str, Any]]]]:
    """The rows of each world, by vehicle."""
    worlds = dict.fromkeys(row["world"] for flown in rows.values() for row in flown)
    return {
        world: {
            vehicle: [row for row in flown if row["world"] == world]
            for vehicle, flown in rows.items()
        }
        for world in worlds
    }


def league_page(rows: Rows, made: Sequence[str]) -> str:
    """Who wins, totals, errors, effort and losses, for each world.

    Args:
        rows: Rows of each vehicle.
        made: Sentences on versions, seeds and gains.
    """
    lines = ["# Arena, limited league"]
    for world, flown in by_world(rows).items():
        every = {vehicle: standings(of) for vehicle, of in flown.items()}
        lines += ["", f"## With {_named(world)}", "", *_verdict(every, flown), *_totals(every)]
        lines += ["", *_errors(flown), "", *_effort(flown)]
    return "\n".join([*lines, "", *made, ""])


def _named(world: str) -> str:
    return f"an {world}" if world[0] in "aeiou" else f"a {world}"


def _verdict(every: Mapping[str, Sequence[Standing]], flown: Rows) -> Iterator[str]:
    """Against the best baseline of each task; nothing where not both flew."""
    pairs = {
        (vehicle, task): (_of(ranked, OURS).tuned[task] or 0.0, *_rival(ranked, task))
        for vehicle, ranked in every.items()
        if len({one.controller == OURS for one in ranked}) > 1
        for task in ranked[0].scores
    }
    if not pairs:
        return
    won = sum(ours > theirs + TIE for ours, _, theirs in pairs.values())
    lost: dict[str, list[float]] = {}
    for (_, task), (ours, _, theirs) in pairs.items():
        if theirs > ours + TIE:
            lost.setdefault(task, []).append(theirs - ours)
    errors = [
        [_rms(flown[vehicle], task, one) for one in (name, OURS)]
        for (vehicle, task), (_, name, _) in pairs.items()
        if task in DISTURBED
    ]
    ratios = [mean(theirs) / mean(ours) for theirs, ours in errors if theirs and ours]
    reached = mean(ours for ours, _, _ in pairs.values())
    rival = mean(theirs for _, _, theirs in pairs.values())
    tied = len(pairs) - won - (losses := sum(map(len, lost.values())))
    yield (
        f"`{OURS}`, at one default setting, wins {won} of {len(pairs)} tasks against the best "
        f"baseline of each task, ties in {tied} (within {TIE} points) and loses {losses}. "
        f"Mean score {reached:.1f}, against {rival:.1f} of the best baseline of each task."
    )
    if ratios:
        yield (
            f"On curves, in wind and with a weak rotor the best baseline's error is "
            f"{median(ratios):.1f} times as large (median; {min(ratios):.1f} to {max(ratios):.1f})."
        )
    where = (f"`{task}` with {len(by)}, by up to {max(by):.1f}" for task, by in lost.items())
    yield f"Lost tasks, vehicles and points: {'; '.join(where)}." if lost else "It loses nowhere."
    yield ""


def _of(ranked: Sequence[Standing], name: str) -> Standing:
    return next(one for one in ranked if one.controller == name)


def _rival(ranked: Sequence[Standing], task: str) -> tuple[str, float]:
    return best([one for one in ranked if one.controller != OURS], task, "tuned")


def _rms(rows: Sequence[Mapping[str, Any]], task: str, name: str) -> list[float]:
    """Errors of a controller in a task that it completes, m."""
    return [
        row["rms_position_error"]
        for row in rows
        if (task_of(row), row["controller"], row["end"]) == (task, name, "completed")
    ]


def _errors(flown: Rows) -> list[str]:
    """Tasks as rows, vehicles as columns: errors of `OURS` and of the best baseline."""
    every, lines = {vehicle: standings(rows) for vehicle, rows in flown.items()}, {}
    for task in dict.fromkeys(task_of(row) for rows in flown.values() for row in rows):
        cells = []
        for vehicle, rows in flown.items():
            rivals = [one for one in every[vehicle] if one.controller != OURS]
            name, score = best(rivals, task, "tuned") if rivals else ("", None)
            errors = (_rms(rows, task, one) for one in (OURS, name))
            texts = [f"{mean(found):.3f}" if found else "-" for found in errors]
            cells.append(" / ".join(texts) + (f" `{name}` {shown(score)}" if name else ""))
        lines[f"`{task}`"] = cells
    return [
        f"Position error (rms, m, mean of seeds) of `{OURS}` / of the baseline with the best "
        "score, with its score:",
        "",
        *_table("task", flown, lines),
    ]


def _is_near(row: Mapping[str, Any]) -> bool:
    """Whether a flight ends within a meter of its reference, mean of the last second."""
    return bool(row["final_position_error"] <= 1.0)


def _effort(flown: Rows) -> list[str]:
    """Controllers as rows: rotor accelerations, peak speeds, saturation and losses."""
    heads, lines = ("rotor acceleration, rad/s^2", "peak speed", "at a limit", "lost"), {}
    for name in dict.fromkeys(row["controller"] for rows in flown.values() for row in rows):
        of = [(v, row) for v, rows in flown.items() for row in rows if row["controller"] == name]
        done = [(v, row) for v, row in of if row["end"] == "completed" and _is_near(row)]
        lost = len([row for _, row in of if row["end"] != "refused"]) - len(done)
        numbers = ["-"] * 3
        if done:
            effort = median(row["rms_rotor_acceleration"] for _, row in done)
            peak = median(row["peak_rotor_speed"] / LIMITED.get(v, 1.0) for v, row in done)
            limited = mean(row["saturated_fraction"] or 0.0 for _, row in done)
            numbers = [f"{effort:.0f}", f"{peak:.2f}", f"{100.0 * limited:.1f} %"]
        lines[f"`{name}`"] = [*numbers, f"{lost} of {len(of)}"]
    return _table("controller", heads, lines)
