"""Flying chunks on a Dask cluster: an existing scheduler with workers anywhere."""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Iterator
from concurrent.futures import CancelledError
from typing import Any, Final, cast

from tiltsim.errors import InputError
from tiltsim.sweeps.chunks import ChunkWork, FinishedChunk
from tiltsim.sweeps.rows import installed_versions

CONNECT_TIMEOUT: Final = 10.0  # s


def fly_on_cluster(work: ChunkWork, numbers: list[int], address: str) -> Iterator[FinishedChunk]:
    """Fly chunks on the workers of a Dask scheduler, yielding each when it is finished.

    Workers may come and go. Raises `InputError` if Dask is not installed, the scheduler does not
    answer or has no workers, or a worker fails or has other versions of the packages.
    """
    client = _connect(address)
    with client:
        yield from _fly(client, work, numbers, address)


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


def _fly(client: Any, work: ChunkWork, numbers: list[int], address: str) -> Iterator[FinishedChunk]:
    from distributed import as_completed
    from distributed.comm import CommClosedError

    digest = hashlib.sha256(work.definition_json.encode()).hexdigest()[:16]
    waiting = list(reversed(numbers))

    def submit() -> Any:
        number = waiting.pop()
        key = f"tiltsim-{digest}-{number}"
        return client.submit(work, number, key=key)

    try:
        first = [submit() for _ in range(min(len(waiting), _window(client)))]
        submitted = as_completed(first, loop=client.loop)
        for future in submitted:
            part = _result(future, address)
            _compare_versions(part, address)
            future.release()
            while waiting and submitted.count() < _window(client):
                submitted.add(submit())
            yield part
    except (CancelledError, CommClosedError) as error:
        raise InputError(
            f"--cluster {address}: the scheduler no longer answers; finished flights are kept, and "
            "the same command continues"
        ) from error


def _result(future: Any, address: str) -> FinishedChunk:
    """The result of a chunk; without the scheduler, Dask's errors of a lost connection."""
    from distributed.comm import CommClosedError

    try:
        return cast("FinishedChunk", future.result())
    except (CancelledError, CommClosedError):
        raise
    except Exception as error:
        raise InputError(
            f"--cluster {address}: a worker failed: {type(error).__name__}: "
            f"{str(error).partition(chr(10))[0]}"
        ) from error


def _window(client: Any) -> int:
    """Number of chunks to have submitted: two per thread, so that no thread waits for work."""
    workers = client.scheduler_info()["workers"].values()
    return 2 * max(1, sum(int(worker["nthreads"]) for worker in workers))


def _compare_versions(part: FinishedChunk, address: str) -> None:
    for name, here in installed_versions().items():
        there = part.versions[name]
        if there != here:
            raise InputError(
                f"--cluster {address}: a worker runs {name} {there}, this machine {here}; install "
                "the same versions"
            )
