"""Results that the report stores in a folder, so that a second report takes seconds.

Files are named by a digest of everything that their content depends on: the resolved scenario
(without titles and expectations), the files that it names, the sources of the core and of the
models, and the versions of the packages that compute.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

import tiltsim_controllers
from tiltsim.errors import InputError
from tiltsim.folders import FLYING
from tiltsim.resources import shipped_folder
from tiltsim.scenario.loading import named_files
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.system.files import replacing
from tiltsim.system.processes import in_processes

Task = TypeVar("Task")
Result = TypeVar("Result")


def store(path: Path, content: bytes) -> None:
    """Write a file completely or not at all."""
    with replacing(path) as draft:
        draft.write_bytes(content)


def flight_key(scenario: Scenario) -> str:
    """Digest of everything that the numbers of a flight depend on."""
    content = scenario.model_dump(mode="json", exclude=set(DESCRIPTIVE))
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    digest.update(sources_digest(sorted(named_files(content))))
    digest.update(code_digest())
    return digest.hexdigest()[:24]


@cache
def code_digest() -> bytes:
    """Digest of the sources of core and models, and of the versions of the numeric packages."""
    versions = [version(name) for name in ("tiltsim", "mujoco", "numpy", "llvmlite")]
    package = Path(__file__).parents[1]
    own = [file for name in FLYING for file in (package / name).rglob("*.py")]
    controllers = Path(tiltsim_controllers.__file__).parent.rglob("*.py")
    sources = [*own, *controllers, *shipped_folder("mjcf").rglob("*.xml")]
    return sources_digest(sources, *versions)


def sources_digest(sources: list[Path], *more: str) -> bytes:
    """Digest of the names and contents of files, in any order and place, and of more strings."""
    files = (hashlib.sha256(f.name.encode() + f.read_bytes()).digest() for f in sources)
    return hashlib.sha256(repr(more).encode() + b"".join(sorted(files))).digest()


def results(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    jobs: int,
    describe: Callable[[Task], str],
) -> Iterator[tuple[Task, Result]]:
    """Yield every task with its result, as they finish; one failure ends the work.

    Args:
        work: Called once per task; picklable unless ``jobs`` is 1.
        tasks: The work to do.
        jobs: Processes; with 1, or a single task, everything runs in this one.
        describe: Names a task in the message of an error.

    Raises:
        InputError: If a task fails in a process, or the process dies.
    """
    if jobs == 1 or len(tasks) < 2:
        yield from ((task, work(task)) for task in tasks)
        return
    for task, future in in_processes(work, tasks, jobs):
        error = future.exception()
        if error is not None:
            raise InputError(f"{describe(task)}: {type(error).__name__}: {error}") from error
        yield task, future.result()
