"""Chunks on a Dask cluster: an existing scheduler, its workers anywhere."""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Iterator
from typing import Any, Final

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.sweeps.flying import Part, fly_sweep_chunk, installed_versions

CONNECT_TIMEOUT: Final = 10.0  # s


def fly_on_cluster(
    definition: str, numbers: list[int], address: str, engine: EngineName | None
) -> Iterator[Part]:
    """Fly chunks on the workers of a Dask scheduler, yielding each when it is finished.

    Workers may come and go. Raises `InputError` where Dask is not installed, the scheduler does
    not answer or has no workers, or workers cannot fly the sweep as this machine would.
    """
    client = _connect(address)
    with client:
        yield from _fly(client, definition, numbers, address, engine)


def _connect(address: str) -> Any:
    if not re.fullmatch(r"((tcp|tls|ucx|wss?)://)?[^/]*[\w\]]:\d+", address):
        raise InputError(
            f"--cluster {address}: no scheduler's address; write one such as tcp://192.168.0.1:8786"
        )
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            f"--cluster {address}: needs Dask; install it with: pip install 'tiltsim[cluster]'"
        ) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error).partition("\n")[0] or "no answer"
        raise InputError(f"--cluster {address}: no scheduler to be reached: {reason}") from None
    if not client.scheduler_info()["workers"]:
        client.close()
        raise InputError(
            f"--cluster {address}: the scheduler has no workers; start some: dask worker {address}"
        )
    return client


def _fly(
    client: Any, definition: str, numbers: list[int], address: str, engine: EngineName | None
) -> Iterator[Part]:
    from distributed import as_completed

    digest = hashlib.sha256(definition.encode()).hexdigest()[:16]
    waiting = list(reversed(numbers))

    def submit() -> Any:
        number = waiting.pop()
        return client.submit(
            *(fly_sweep_chunk, definition, number, engine),
            key=f"tiltsim-{digest}-{number}",
        )

    first = [submit() for _ in range(min(len(waiting), _window(client)))]
    flying = as_completed(first, loop=client.loop)
    for future in flying:
        try:
            part = future.result()
        except Exception as error:
            raise InputError(
                f"--cluster {address}: a worker failed: {type(error).__name__}: "
                f"{str(error).partition(chr(10))[0]}"
            ) from error
        _compare_versions(part, address)
        future.release()
        while waiting and flying.count() < _window(client):
            flying.add(submit())
        yield part


def _window(client: Any) -> int:
    """Chunks to have under way: two a thread, so that none waits and none piles up."""
    workers = client.scheduler_info()["workers"].values()
    return 2 * max(1, sum(int(worker["nthreads"]) for worker in workers))


def _compare_versions(part: Part, address: str) -> None:
    for name, here in installed_versions().items():
        there = part.versions[name]
        if there != here:
            raise InputError(
                f"--cluster {address}: a worker runs {name} {there}, this machine {here}; install "
                "the same versions"
            )
