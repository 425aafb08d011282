"""Work that is spread over processes, where one failure ends the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from tiltsim.errors import InputError
from tiltsim.system.processes import in_processes

Task = TypeVar("Task")
Result = TypeVar("Result")


def results(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    jobs: int,
    describe: Callable[[Task], str],
) -> Iterator[tuple[Task, Result]]:
    """Yield every task with its result, as they finish.

    Parameters
    ----------
    work
        Called once per task; picklable unless ``jobs`` is 1.
    tasks
        The work to do.
    jobs
        Processes; with 1, or a single task, everything runs in this one.
    describe
        Names a task in the message of an error.

    Raises
    ------
    InputError
        If a task fails in a process, or the process dies.
    """
    if jobs == 1 or len(tasks) < 2:
        yield from ((task, work(task)) for task in tasks)
        return
    for task, future in in_processes(work, tasks, jobs):
        error = future.exception()
        if error is not None:
            raise InputError(f"{describe(task)}: {type(error).__name__}: {error}") from error
        yield task, future.result()
