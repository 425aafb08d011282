"""Running a sweep in one call, in this process, in several, or on a Dask cluster."""

import hashlib
import logging
import re
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.plants.plant import MIN_STEPS_TO_COMPILE
from tiltsim.scenario.own_parts import is_trusted, require_trust, with_trust
from tiltsim.sweeps.chunks import ChunkWork, FinishedChunk
from tiltsim.sweeps.dataset import SweepResults, load_results, open_sweep_folder
from tiltsim.sweeps.definition import SweepDefinition, installed_versions
from tiltsim.sweeps.loading import check_points, load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.system.arguments import Report, reported, true_or_false, whole_number
from tiltsim.system.processes import ProcessDiedError, in_processes
from tiltsim.system.text import short_repr

MAX_DEATHS: Final = 3
"""Number of times in a row that all processes may die without finishing a chunk."""

CONNECT_TIMEOUT: Final = 10.0  # s


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
        out: Its folder; see `tiltsim.sweeps.dataset`.
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


def fly_on_cluster(work: ChunkWork, numbers: list[int], address: str) -> Iterator[FinishedChunk]:
    """Fly chunks on the workers of a Dask scheduler, yielding each when it is finished.

    Workers may come and go. Raises `InputError` if Dask is not installed, the scheduler does not
    answer or has no workers, or a worker fails or has other versions of the packages.
    """
    client = _connect(address)
    from distributed import as_completed
    from distributed.comm import CommClosedError

    digest = hashlib.sha256(work.definition_json.encode()).hexdigest()[:16]
    waiting = list(reversed(numbers))

    def submit() -> Any:
        number = waiting.pop()
        key = f"tiltsim-{digest}-{number}"
        return client.submit(work, number, key=key)

    try:
        with client:
            first = [submit() for _ in range(min(len(waiting), _window(client)))]
            submitted = as_completed(first, loop=client.loop)
            for future in submitted:
                try:
                    part: FinishedChunk = future.result()
                except (CancelledError, CommClosedError):
                    raise  # the scheduler is lost
                except Exception as error:
                    failed = f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"
                    raise InputError(f"--cluster {address}: a worker failed: {failed}") from error
                for name, here in installed_versions().items():
                    if (there := part.versions[name]) != here:
                        raise InputError(
                            f"--cluster {address}: a worker runs {name} {there}, this machine "
                            f"{here}; install the same versions"
                        )
                future.release()
                while waiting and submitted.count() < _window(client):
                    submitted.add(submit())
                yield part
    except (CancelledError, CommClosedError) as error:
        raise InputError(
            f"--cluster {address}: the scheduler no longer answers; finished flights are kept, and "
            "the same command continues"
        ) from error


def _connect(address: str) -> Any:
    if not re.fullmatch(r"((tcp|tls|ucx|wss?)://)?[^/]*[\w\]]:\d+", address):
        raise InputError(
            f"--cluster {address}: not a scheduler address, such as tcp://192.168.0.1:8786"
        )
    try:
        from distributed import Client
    except ImportError as error:
        reason = f"cannot load Dask: {str(error).partition(chr(10))[0]}"
        if error.name in {"distributed", "dask"}:
            reason = "needs Dask; install it with: pip install 'tiltsim[cluster]'"
        raise InputError(f"--cluster {address}: {reason}") from error
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error).partition("\n")[0] or "no answer"
        raise InputError(f"--cluster {address}: cannot reach a scheduler: {reason}") from None
    if not client.scheduler_info()["workers"]:
        client.close()
        raise InputError(
            f"--cluster {address}: the scheduler has no workers; start some: dask worker {address}"
        )
    return client


def _window(client: Any) -> int:
    """Number of chunks to have submitted: two per thread, so that no thread waits for work."""
    workers = client.scheduler_info()["workers"].values()
    return 2 * max(1, sum(int(worker["nthreads"]) for worker in workers))


def sweep(
    source: str | PathLike[str] | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    out: str | PathLike[str] | None = None,
    jobs: int = 1,
    progress: Report | bool | None = None,
    trusted: bool = False,
) -> SweepResults:
    """Fly a scenario along axes.

    Args:
        source: A TOML file, the name of a sweep in the library, or the tables of a file as a dict
            (docs/sweeps.md), whose ``scenario`` is an address, a table or a `tiltsim.Scenario`.
        overrides: Values by dotted key of the scenario, on top of ``[set]``.
        out: A folder for the rows, which a later call with the same sweep continues; default: the
            rows are in memory only.
        jobs: Processes. With several, a script has to call this under
            ``if __name__ == "__main__":``, as for any use of processes in Python.
        progress: True for a bar; or a function, called with the number of finished rows.
        trusted: Whether to execute Python files that scenarios name.

    Returns:
        One row for each point; see `SweepResults.to_pandas` and `SweepResults.to_arrow`.

    Raises:
        InputError: In one line: the sweep, the key, the value and the allowed values.
    """
    jobs, trusted = whole_number("jobs", jobs), true_or_false("trusted", trusted)
    if out is not None and not isinstance(out, str | PathLike):
        raise InputError(f"out = {short_repr(out)}: must be the name of a folder")
    definition = load_sweep(source, overrides)
    points = SweepPoints(definition)
    if points.sweep.keep_flights and out is None:
        raise InputError(f"{definition.address}: keep_flights = true: needs out, a folder for them")
    with (
        reported(progress, "flights", len(points)) as report,
        TemporaryDirectory(prefix="tiltsim-sweep-") as temporary,
    ):
        folder = Path(temporary if out is None else out)
        run_sweep(definition, folder, jobs=jobs, report=report, trusted=trusted)
        return load_results(folder, scenarios=True)
