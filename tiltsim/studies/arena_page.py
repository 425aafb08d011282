"""The arena's page in Markdown."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from tiltsim.studies.arena import Standing, are_rivals, beaten, standings
from tiltsim.studies.comparison import refusal
from tiltsim.studies.scores import HALF, INTERACTION, errors_of, task_of
from tiltsim.system.text import in_words

UNITS: Final = {
    "position_error": "m",
    "yaw_error": "rad",
    "rms_force_error": "N",
    "peak_force": "N",
    "final_swing": "rad",
}
"""Units of the errors that scores are made of."""


def arena_page(rows: Mapping[str, Sequence[Mapping[str, Any]]], made: Sequence[str]) -> str:
    """How often baselines win, all totals, a table for each vehicle, and every refusal.

    Args:
        rows: Rows of each vehicle.
        made: Sentences on versions, seeds and gains.
    """
    every = {vehicle: standings(chosen) for vehicle, chosen in rows.items()}
    kinds = ("tuned", "default") if is_tuned(rows) else ("default",)
    lines = ["# Arena", "", *_baselines_win(every, kinds), "## All tasks", "", *totals(every)]
    for vehicle, ranked in every.items():
        title = vehicle.replace("_", " ").capitalize()
        lines += ["", f"## {title}", "", *_table(ranked), *_errors(rows[vehicle], ranked)]
    lines += _refusals(row for flown in rows.values() for row in flown)
    return "\n".join([*lines, "", *made, ""])


def is_tuned(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> bool:
    """Whether any flight has tuned gains."""
    return any(row["gains"] == "tuned" for chosen in rows.values() for row in chosen)


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


def totals(every: Mapping[str, Sequence[Standing]]) -> Iterator[str]:
    """Vehicles as rows, controllers as columns."""
    names = list(dict.fromkeys(one.controller for ranked in every.values() for one in ranked))
    yield "| | " + " | ".join(f"`{name}`" for name in names) + " |"
    yield "| --- |" + " --: |" * len(names)
    for vehicle, ranked in every.items():
        cells = {one.controller: cell(one.total, one.tuned_total) for one in ranked}
        yield f"| {vehicle} | " + " | ".join(cells.get(name, "") for name in names) + " |"


def _table(ranked: Sequence[Standing]) -> Iterator[str]:
    """Tasks as rows, controllers as columns."""
    yield "| task | " + " | ".join(f"`{standing.controller}`" for standing in ranked) + " |"
    yield "| --- |" + " --: |" * len(ranked)
    for task in ranked[0].scores if ranked else ():
        cells = " | ".join(cell(one.scores[task], one.tuned[task]) for one in ranked)
        yield f"| `{task}` | {cells} |"
    yield "| all tasks | " + " | ".join(cell(s.total, s.tuned_total) for s in ranked) + " |"


def _errors(rows: Sequence[Mapping[str, Any]], ranked: Sequence[Standing]) -> Iterator[str]:
    """Errors of flights with contacts or loads: tasks as rows, controllers as columns."""
    names = [standing.controller for standing in ranked]
    flown = {(row["scenario"], row["controller"]): row for row in rows}
    tasks = dict.fromkeys(address for address, _ in flown if address in INTERACTION)
    if tasks:
        yield from ("", "| error | " + " | ".join(f"`{name}`" for name in names) + " |")
        yield "| --- |" + " --: |" * len(names)
    for address in tasks:
        of = [flown[address, name] for name in names]
        for measure in dict.fromkeys((*HALF, *INTERACTION[address].halves)):
            ended = (row["end"] == "completed" for row in of)
            values = [
                f"{errors_of(row, [measure])[measure]:.3f}" if done else "-"
                for row, done in zip(of, ended, strict=True)
            ]
            words = f"`{task_of(of[0])}`: {in_words(measure)}, {UNITS[measure]}"
            yield f"| {words} | {' | '.join(values)} |"


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
