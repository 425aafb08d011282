"""The arena: fixed tasks for every vehicle, flown by every controller, and their scores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.resources import shipped_folder
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.messages import choose
from tiltsim.studies.checking import collect
from tiltsim.studies.comparison import GIVEN, Compared, compare

FOLDER: Final = "arena"
"""Of the library: one file for each vehicle, one variant for each task."""

BASELINES: Final = ("geometric", "pid", "indi", "lqr")
"""Laws of the literature, against which the thesis's and ours stand."""

HALF: Final = (0.1, 0.1)
"""Root mean square errors of position (m) and yaw (rad), each of which alone halves the score."""

STEP: Final = 0.25
"""Share of a step that is the root mean square of a first-order response in 1 s over 8 s."""

HALF_OF: Final = {
    "step": (STEP, 0.1),
    "yaw_step": (0.1, 1.571 * STEP),
    "latency": (0.3 * STEP, 0.1),
}
"""Tasks with other errors than `HALF`: steps, whose error begins with the step itself."""


@dataclass(frozen=True)
class Standing:
    """The scores of one controller on the tasks of one vehicle.

    Attributes:
        controller: Its law, or `GIVEN`.
        scores: By task, 0 to 100; None where the controller does not fit the task.
    """

    controller: str
    scores: Mapping[str, float | None]

    @property
    def total(self) -> float:
        """Mean over all tasks; a task that the controller does not fit counts as zero."""
        return mean(score or 0.0 for score in self.scores.values())

    @property
    def of_flown(self) -> float | None:
        """Mean over the tasks that the controller fits."""
        flown = [score for score in self.scores.values() if score is not None]
        return mean(flown) if flown else None


def vehicles() -> dict[str, list[str]]:
    """Addresses of the tasks, by vehicle."""
    found: dict[str, list[str]] = {}
    for address in collect([str(shipped_folder("scenarios") / FOLDER)]):
        found.setdefault(address.partition("#")[0].rpartition("/")[2], []).append(address)
    return found


def chosen_vehicles(names: Sequence[str]) -> dict[str, list[str]]:
    """Those named, or all. Raises InputError if one does not exist."""
    known = vehicles()
    for name in names:
        if name not in known:
            raise InputError(f"--vehicles {name}: {choose(name, sorted(known))}")
    return {name: tasks for name, tasks in known.items() if name in names or not names}


def fitting(tasks: Sequence[str]) -> list[str]:
    """Controllers for the vehicle of tasks: their own, and all laws that follow positions."""
    scenario = load_scenario(tasks[0])
    own, model = scenario.controller, scenario.vehicle.model
    laws = [
        law
        for law, table in CONTROLLERS.items()
        if law not in ("python", "scalar")
        and model in table.vehicle_models
        and "position" in table.reference_kinds
    ]
    default = load_scenario(tasks[0], {"controller": {"law": own.law}}).controller
    return laws if own == default else [GIVEN, *laws]


def fly_tasks(
    tasks: Mapping[str, Sequence[str]], controllers: Sequence[str], jobs: int
) -> Iterator[tuple[str, Compared]]:
    """Fly the tasks of every vehicle; yields them with the vehicle's name.

    Args:
        tasks: Addresses by vehicle.
        controllers: Laws, or `GIVEN`; those that `fitting` finds if empty.
        jobs: Processes.

    Raises:
        InputError: If a controller does not exist.
    """
    for vehicle, addresses in tasks.items():
        names = controllers or fitting(addresses)
        for compared in compare(addresses, names, {}, searches=False, jobs=jobs):
            yield vehicle, compared


def score(row: Mapping[str, Any]) -> float | None:
    """Of a row of `compare`: ``100 / (1 + e_position / half + e_yaw / half)``.

    None if the task refuses the controller, 0 if the flight ends early.
    """
    if row["end"] == "refused":
        return None
    if row["end"] != "completed":
        return 0.0
    position, yaw = HALF_OF.get(task_of(row), HALF)
    return float(100.0 / (1.0 + row["rms_position_error"] / position + row["rms_yaw_error"] / yaw))


def task_of(row: Mapping[str, Any]) -> str:
    """Name of the task of a row."""
    return str(row["scenario"]).partition("#")[2]


def standings(rows: Sequence[Mapping[str, Any]]) -> list[Standing]:
    """Of the rows of one vehicle, the best first."""
    scores: dict[str, dict[str, float | None]] = {}
    for row in rows:
        scores.setdefault(row["controller"], {})[task_of(row)] = score(row)
    every = [Standing(name, by_task) for name, by_task in scores.items()]
    return sorted(every, key=lambda standing: -standing.total)


def beaten(every: Sequence[Standing]) -> list[str]:
    """A line for each task in which a baseline stands before all of the thesis's laws and ours."""
    lines = []
    for task in every[0].scores if every else ():
        best: dict[bool, tuple[float, str]] = {}
        for standing in every:
            reached = (standing.scores[task] or 0.0, standing.controller)
            kind = standing.controller in BASELINES
            best[kind] = max(best.get(kind, reached), reached)
        if len(best) == 2 and best[True][0] > best[False][0]:
            (high, winner), (low, loser) = best[True], best[False]
            lines.append(f"`{task}`: `{winner}` {high:.0f} against {low:.0f} (`{loser}`)")
    return lines


def arena_page(rows: Mapping[str, Sequence[Mapping[str, Any]]], made: str) -> str:
    """The page in Markdown: where baselines win, a table for each vehicle, and refusals.

    Args:
        rows: Of each vehicle.
        made: Sentence on versions.
    """
    every = {vehicle: standings(chosen) for vehicle, chosen in rows.items()}
    lines = [
        "# Arena",
        "",
        "A baseline beats the thesis's laws and ours, the best of them, in:",
        "",
    ]
    for vehicle, ranked in every.items():
        lines += [f"- {vehicle}, {line}" for line in beaten(ranked)] or [f"- {vehicle}: none"]
    for vehicle, ranked in every.items():
        lines += ["", f"## {vehicle.capitalize()}", "", *_table(ranked)]
        refused = dict.fromkeys(
            f"- `{row['controller']}`: {row['refused'].partition(': ')[2]}"
            for row in rows[vehicle]
            if row["end"] == "refused"
        )
        lost = [
            f"- `{row['controller']}` in `{task_of(row)}`: {row['end']}"
            for row in rows[vehicle]
            if row["end"] not in ("completed", "refused")
        ]
        lines += ["", "Refused (-):", "", *refused] * bool(refused)
        lines += ["", "Ended early (0):", "", *lost] * bool(lost)
    return "\n".join([*lines, "", made, ""])


def _table(ranked: Sequence[Standing]) -> Iterator[str]:
    """Tasks as rows, controllers as columns."""
    yield "| task | " + " | ".join(f"`{standing.controller}`" for standing in ranked) + " |"
    yield "| --- |" + " --: |" * len(ranked)
    for task in ranked[0].scores if ranked else ():
        yield f"| `{task}` | " + " | ".join(shown(s.scores[task]) for s in ranked) + " |"
    yield "| all tasks | " + " | ".join(f"**{s.total:.0f}**" for s in ranked) + " |"
    yield "| tasks that it fits | " + " | ".join(shown(s.of_flown) for s in ranked) + " |"


def shown(value: float | None) -> str:
    """A score as text."""
    return "-" if value is None else f"{value:.0f}"
