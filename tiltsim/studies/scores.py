"""Scores of flights, 0 to 100, from the errors that count in their tasks."""

from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, Final, NamedTuple

STEP: Final = 0.25
"""Share of a step that is the root mean square of a first-order response in 1 s over 8 s."""


class Aim(NamedTuple):
    """The errors that count in a task."""

    halves: Mapping[str, float] = {}
    """Errors that alone halve the score, beside `HALF` or in place of its values: m, rad and N, by
    measures of a row of ``compare``."""
    contact: float = 0.0
    """Time (s) for which the vehicle has to touch an object; less is a share of the score, so that
    a vehicle that never touches has none."""


HALF: Final = {"position_error": 0.1, "yaw_error": 0.1}
"""Root mean square errors of position (m) and yaw (rad), each of which alone halves the score."""

AIMS: Final = {
    "step": Aim({"position_error": STEP}),
    "yaw_step": Aim({"yaw_error": 1.571 * STEP}),
    "latency": Aim({"position_error": 0.3 * STEP}),
    "late_step": Aim({"position_error": 0.3 * STEP}),
}
"""Tasks with other errors than `HALF`: steps, whose error begins with the step itself."""

INTERACTION: Final = {
    "interaction/push#hold": Aim({"rms_force_error": 0.5}, contact=4.5),
    "interaction/push#slide": Aim({"rms_force_error": 0.5}, contact=12.0),
    "interaction/door": Aim(contact=1.0),
    "interaction/platform": Aim({"peak_force": 25.0}, contact=2.0),
    "interaction/carry#cable": Aim({"final_swing": 0.1}),
    "interaction/carry#step": Aim({"position_error": STEP, "final_swing": 0.3}),
    "interaction/carry#step_damped": Aim({"position_error": STEP, "final_swing": 0.1}),
}
"""Tasks with contacts and loads by address. A tenth of the force of a push, the weight of a
hexarotor at the impact of a landing, and 0.1 rad of swing in the last second halve their scores; in
``step``, where the law alone damps the load, half of the swing that a fast law leaves."""


def score(row: Mapping[str, Any]) -> float | None:
    """The score of a row of `compare`, 0 to 100.

    It is ``s = 100 / (1 + sum of error / half)``, times the share of the contact that the task
    needs, of which a vehicle that stays where it began has none: ``100 (s - idle) / (100 - idle)``,
    at least 0. The position's error is the greater of the root mean square of the flight and the
    mean of its last second, so that a vehicle that falls at the end does not gain from the time
    before.

    None if the task refuses the controller, 0 if the flight ends early.
    """
    if row["end"] == "refused":
        return None
    if row["end"] != "completed":
        return 0.0
    aim = INTERACTION.get(row["scenario"]) or AIMS.get(task_of(row), Aim())
    halves = {**HALF, **aim.halves}
    reached = _share(errors_of(row, halves), halves)
    if aim.contact:
        reached *= min(1.0, row["time_in_contact"] / aim.contact)
    stays = {"position_error": row["idle_position_error"], "yaw_error": row["idle_yaw_error"]}
    idle = _share(stays, halves)
    if idle < 1.0 - 1e-6:
        reached = max(0.0, reached - idle) / (1.0 - idle)
    return float(100.0 * reached)


def errors_of(row: Mapping[str, Any], measures: Iterable[str]) -> dict[str, float]:
    """The errors of a completed flight that count; infinite where one was not measured.

    Args:
        row: A row of `compare`.
        measures: Their names, see `Aim`.
    """
    position = max(row["rms_position_error"], row["final_position_error"])
    known = {**row, "position_error": position, "yaw_error": row["rms_yaw_error"]}
    return {name: inf if known[name] is None else known[name] for name in measures}


def _share(errors: Mapping[str, float], halves: Mapping[str, float]) -> float:
    """The score of errors, 0 to 1, each of which alone halves it where it is as its ``half``."""
    return 1.0 / (1.0 + sum(error / halves[name] for name, error in errors.items()))


def task_of(row: Mapping[str, Any]) -> str:
    """Name of the task of a row."""
    return task_at(str(row["scenario"]))


def task_at(address: str) -> str:
    """Name of the task at an address: its variant, or its file where that has none."""
    file, _, variant = address.partition("#")
    return variant or file.rpartition("/")[2]
