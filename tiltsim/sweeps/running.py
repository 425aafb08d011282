"""Running a sweep: flies its chunks in this process, in several, or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.plants.engine_choice import MIN_STEPS_TO_COMPILE
from tiltsim.scenario.trust import is_trusted, require_trust, with_trust
from tiltsim.sweeps.checks import check_points
from tiltsim.sweeps.chunks import ChunkWork, FinishedChunk
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.folder import open_sweep_folder
from tiltsim.sweeps.points import SweepPoints
from tiltsim.system.processes import ProcessDiedError, in_processes

MAX_DEATHS: Final = 3
"""Number of times in a row that all processes may die without finishing a chunk."""


def run_sweep(
    definition: SweepDefinition,
    out: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    report: Callable[[int], None] = lambda rows: None,
    trusted: bool = False,
) -> Path:
    """Fly the chunks of a sweep that are not yet finished.

    Args:
        definition: The sweep, from `tiltsim.sweeps.loading.load_sweep`.
        out: Its folder; see `tiltsim.sweeps.folder`.
        jobs: Processes on this machine.
        cluster: Address of a Dask scheduler whose workers fly instead.
        report: Called with the number of finished rows, at the start and after every chunk.
        trusted: Whether to execute Python code that scenarios name.

    Returns:
        The finished dataset, which does not depend on interruptions or on the machines.

    Raises:
        InputError: See `open_sweep_folder`; also if the cluster cannot be used or processes keep
            dying.
    """
    points = SweepPoints(definition)
    with open_sweep_folder(out, points) as folder:
        done = folder.finished()
        rows = sum(len(points.chunk(number)) for number in done)
        report(rows)
        todo = [number for number in range(points.chunks) if number not in done]
        if todo:
            for part in _fly(points, todo, jobs, cluster, trusted):
                folder.save(part)
                rows += part.rows
                report(rows)
        if todo or not folder.is_joined:
            folder.join()
        return folder.dataset


def _fly(
    points: SweepPoints, numbers: list[int], jobs: int, cluster: str | None, trusted: bool
) -> Iterator[FinishedChunk]:
    trusted = is_trusted(trusted)
    examples = [with_trust(example, trusted) for example in check_points(points)]
    for example in examples:
        require_trust(example)
    count = sum(len(points.chunk(number)) for number in numbers)
    steps = count * max(example.simulation.steps for example in examples)
    engine: EngineName | None = "native" if steps >= MIN_STEPS_TO_COMPILE else None
    work = ChunkWork(points.definition.to_json(), engine, trusted)
    if cluster is not None:
        from tiltsim.sweeps.cluster import fly_on_cluster

        return fly_on_cluster(work, numbers, cluster)
    if jobs == 1 or len(numbers) == 1:
        return map(work, numbers)
    return fly_on_processes(work, numbers, jobs)


def fly_on_processes(work: ChunkWork, numbers: list[int], jobs: int) -> Iterator[FinishedChunk]:
    """Fly chunks on several processes, yielding each when it is finished.

    A process that dies is replaced, and its chunk flown again. Raises `InputError` if processes
    keep dying.
    """
    waiting, deaths, most = numbers, 0, MAX_DEATHS * min(jobs, len(numbers))
    while waiting:
        died: list[int] = []
        for number, future in in_processes(work, waiting, jobs):
            if not isinstance(future.exception(), ProcessDiedError):
                deaths = 0
                yield future.result()
                continue
            died.append(number)
            deaths += 1
            if deaths == most:
                raise InputError(
                    f"--jobs {jobs}: processes keep dying while they fly chunk {min(died)}; is "
                    "there too little memory? Finished chunks are kept"
                )
        waiting = sorted(died)
