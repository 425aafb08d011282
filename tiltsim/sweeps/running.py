"""Running a sweep: chunks to this process, to several, or to a cluster, until all are finished."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.shared_engine import shared_engine
from tiltsim.sweeps.definition import Definition
from tiltsim.sweeps.flying import Part, fly_sweep_chunk
from tiltsim.sweeps.folder import open_sweep_folder
from tiltsim.sweeps.plan import Plan
from tiltsim.system.processes import ProcessDiedError, in_processes

MAX_DEATHS: Final = 3
"""So many times in a row may all processes die before a single chunk gets finished."""

Report = Callable[[int], None]


def run_sweep(
    definition: Definition,
    out: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    report: Report = lambda rows: None,
) -> Path:
    """Fly what is not yet finished of a sweep.

    Parameters
    ----------
    definition
        The sweep, from `tiltsim.sweeps.loading.load_sweep`.
    out
        Its folder; see `tiltsim.sweeps.folder`.
    jobs
        Processes on this machine.
    cluster
        Address of a Dask scheduler whose workers fly instead.
    report
        Called with the number of rows that are finished, at first and after every chunk.

    Returns
    -------
    pathlib.Path
        The finished dataset. It is the same however often the sweep was killed and continued, and
        wherever it was flown.

    Raises
    ------
    InputError
        As `open_sweep_folder`, or if the cluster cannot be used or processes keep dying.
    """
    plan = Plan(definition)
    with open_sweep_folder(out, plan) as folder:
        done = folder.finished()
        rows = sum(len(plan.chunk(number)) for number in done)
        report(rows)
        todo = [number for number in range(plan.chunks) if number not in done]
        if todo:
            for part in _fly(plan, todo, jobs, cluster):
                folder.keep(part)
                rows += part.rows
                report(rows)
        if todo or not folder.is_joined:
            folder.join()
        return folder.dataset


def _fly(plan: Plan, numbers: list[int], jobs: int, cluster: str | None) -> Iterator[Part]:
    definition = plan.definition.to_json()
    examples = plan.check()
    points = sum(len(plan.chunk(number)) for number in numbers)
    steps = points * max(example.simulation.steps for example in examples)
    if cluster is not None:
        from tiltsim.sweeps.cluster import fly_on_cluster

        return fly_on_cluster(definition, numbers, cluster, worthwhile_engine(steps))
    engine = shared_engine(examples, steps)
    if jobs == 1 or len(numbers) == 1:
        return (fly_sweep_chunk(definition, number, engine) for number in numbers)
    return fly_on_processes(definition, numbers, jobs, engine)


def worthwhile_engine(steps: int) -> EngineName | None:
    """The engine for flights of ``steps`` in all, without compiling anything here."""
    examples: Sequence[Scenario] = ()
    return shared_engine(examples, steps)


def fly_on_processes(
    definition: str, numbers: list[int], jobs: int, engine: EngineName | None
) -> Iterator[Part]:
    """Fly chunks on several processes, yielding each when it is finished.

    A process that dies is replaced, and its chunk flown again. Raises InputError where that does
    not help.
    """
    work = partial(_fly_chunk, definition=definition, engine=engine)
    waiting, deaths, most = numbers, 0, MAX_DEATHS * min(jobs, len(numbers))
    while waiting:
        lost: list[int] = []
        for number, future in in_processes(work, waiting, jobs):
            if not isinstance(future.exception(), ProcessDiedError):
                deaths = 0
                yield future.result()
                continue
            lost.append(number)
            deaths += 1
            if deaths == most:
                raise InputError(
                    f"--jobs {jobs}: processes keep dying while they fly chunk {min(lost)}; is "
                    "there too little memory? What is finished is kept"
                )
        waiting = sorted(lost)


def _fly_chunk(number: int, definition: str, engine: EngineName | None) -> Part:
    return fly_sweep_chunk(definition, number, engine)
