"""Checking many scenarios: flown in parallel, and their results as JSON and JUnit XML."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, Final, Literal, get_args
from xml.etree import ElementTree

from tiltsim.errors import DONE, EXPECTATION_FAILED, INVALID_INPUT, VEHICLE_LOST, InputError
from tiltsim.flight.metrics import Verdict, check_expectations
from tiltsim.laws.assembling import loop_of
from tiltsim.resources import shipped_folder
from tiltsim.scenario.library import (
    closest_in_library,
    library_name,
    read_toml,
    scenario_files,
    selected_family,
)
from tiltsim.scenario.loading import load_scenario, variant_names
from tiltsim.scenario.own_parts import require_trust
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.simulate import simulate_to_end
from tiltsim.system.files import replacing
from tiltsim.system.processes import in_processes
from tiltsim.system.text import printable

Status = Literal["passed", "failed", "lost", "invalid", "crashed", "interrupted", "skipped"]

EXIT_CODES: Final[Mapping[Status, int]] = {
    "invalid": INVALID_INPUT,
    "crashed": INVALID_INPUT,
    "lost": VEHICLE_LOST,
    "failed": EXPECTATION_FAILED,
    "passed": DONE,
}
"""Exit codes of flown scenarios, the most severe first."""

_ELEMENTS: Final = {"passed": None, "failed": "failure", "lost": "failure", "skipped": "skipped"}
"""Elements of JUnit by status; any other status is an error."""


@dataclass(frozen=True)
class CheckResult:
    """The outcome of checking one scenario."""

    address: str
    status: Status
    message: str  # why it did not pass, in one line; empty if passed
    verdicts: tuple[Verdict, ...] = ()
    wall_time: float = 0.0  # s
    metrics: Mapping[str, float | bool] = field(default_factory=dict)

    @property
    def without_expectations(self) -> bool:
        """Whether the flight was completed but has nothing to check."""
        return self.status == "passed" and not self.verdicts


def not_flown(address: str, status: Literal["interrupted", "skipped"]) -> CheckResult:
    """The result of a scenario that an interrupt or the end of the check left out."""
    reason = "interrupted" if status == "interrupted" else "the check ended at a failure"
    return CheckResult(address, status, f"not flown: {reason}")


def exit_code(results: Iterable[CheckResult]) -> int:
    """The most severe exit code of some results (2 > 3 > 1 > 0)."""
    found = {result.status for result in results}
    return next((code for status, code in EXIT_CODES.items() if status in found), DONE)


def json_document(results: list[CheckResult]) -> dict[str, Any]:
    """Results as `docs/command_line.md` documents them."""
    counts = Counter(result.status for result in results)
    return {
        "summary": {
            "scenarios": len(results),
            **{status: counts[status] for status in get_args(Status)},
            "exit_code": None if counts["interrupted"] else exit_code(results),
            "wall_time": sum(result.wall_time for result in results),
        },
        "scenarios": [
            {
                "address": result.address,
                "status": result.status,
                "exit_code": EXIT_CODES.get(result.status),
                "message": result.message,
                "wall_time": result.wall_time,
                "metrics": dict(result.metrics),
                "expectations": [_expectation(verdict) for verdict in result.verdicts],
            }
            for result in results
        ],
    }


def _expectation(verdict: Verdict) -> dict[str, Any]:
    keys = ("min", "max", "equals", "published")
    return {
        "metric": verdict.expectation.metric,
        "measured": verdict.measured,
        "holds": verdict.holds,
        **{key: getattr(verdict.expectation, key) for key in keys},
    }


def write_junit(results: list[CheckResult], path: Path) -> None:
    """Write results as JUnit XML, which CI services read; metrics are properties of a case."""
    elements = Counter(_ELEMENTS.get(result.status, "error") for result in results)
    suite = ElementTree.Element(
        "testsuite",
        name="tiltsim check",
        tests=str(len(results)),
        failures=str(elements["failure"]),
        errors=str(elements["error"]),
        skipped=str(elements["skipped"]),
        time=f"{sum(result.wall_time for result in results):.3f}",
    )
    for result in results:
        _add_case(suite, result)
    root = ElementTree.Element("testsuites")
    root.append(suite)
    tree = ElementTree.ElementTree(root)
    ElementTree.indent(tree)
    with replacing(path) as temporary:
        tree.write(temporary, encoding="utf-8", xml_declaration=True)


def _add_case(suite: ElementTree.Element, result: CheckResult) -> None:
    add = ElementTree.SubElement
    folder, _, name = printable(result.address).rpartition("/")
    case = add(suite, "testcase", classname=folder, name=name, time=f"{result.wall_time:.3f}")
    if result.metrics:
        properties = add(case, "properties")
        for metric, value in result.metrics.items():
            text = str(value).lower() if isinstance(value, bool) else repr(value)
            add(properties, "property", name=metric, value=text)
    element = _ELEMENTS.get(result.status, "error")
    if element is not None:
        add(case, element, type=result.status, message=printable(result.message))


def collect(paths: Iterable[str], word: str = "") -> list[str]:
    """Addresses of all scenarios under files and folders, families expanded into variants.

    A path that does not exist is looked up in the library; ``word`` selects as `selected_family`
    does. Raises `InputError` if a path is nowhere, a folder has no scenario, or none is selected.
    """
    addresses: list[str] = []
    for path in paths:
        name, _, variant = path.partition("#")
        place = _find(name)
        files = scenario_files(place)
        if not files:
            raise InputError(f"{path}: no scenario file (*.toml) in this folder")
        for file in files:
            base = name if variant else library_name(file)
            selected = _selected(file, base, word)
            if not variant:
                addresses += selected
            elif not word or {path, base} & {*selected}:
                addresses.append(path)
    if word and not addresses:
        raise InputError(f"-k {word}: in no address, title or source of the scenarios")
    return list(dict.fromkeys(addresses))


def _selected(file: Path, base: str, word: str) -> list[str]:
    try:
        document = read_toml(file)
        variant_names(file, document)
    except InputError:
        document = {}  # the file is checked like the others, and reported as invalid
    family = selected_family(base, document, word)
    return [entry.address for entry in family.scenarios] if family else []


def shard(addresses: list[str], number: int, count: int) -> list[str]:
    """Part ``number``, from 1, of ``count`` disjoint parts of scenarios, together all of them.

    They are dealt out in turn, so that a family, whose flights take equally long, is in all parts.
    """
    return addresses[number - 1 :: count]


def _find(name: str) -> Path:
    if not name:
        raise InputError("the name of a scenario is empty; see tiltsim list")
    library = shipped_folder("scenarios")
    for place in (Path(name), library / name, library / f"{name}.toml"):
        if place.exists():
            return place
    hint = closest_in_library(name)
    raise InputError(
        f"{name}: no such file or folder, here or in the library ({hint}see tiltsim list)"
    )


def check_one(loaded: tuple[str, Scenario]) -> CheckResult:
    """Fly a scenario, given with its address, and check its expectations; errors are results."""
    start = perf_counter()
    address, scenario = loaded
    try:
        require_trust(scenario)
        flight = simulate_to_end(scenario)
    except InputError as error:
        return CheckResult(address, "invalid", str(error))
    metrics = flight.metrics()
    verdicts = tuple(check_expectations(scenario, metrics))
    # A scenario that may end early has an expectation on `diverged`.
    may_end_early = any(v.expectation.metric == "diverged" for v in verdicts)
    failed = [v for v in verdicts if not v.holds]
    status: Status = "failed" if failed else "passed"
    message = "; ".join(
        f"{v.expectation.metric} = {v.measured_text}, expected {v.bounds}" for v in failed
    )
    if flight.end.kind != "completed" and not may_end_early:
        status, message = "lost", flight.end.message
    seconds, found = perf_counter() - start, metrics.of_all_vehicles()
    return CheckResult(address, status, message, verdicts, seconds, found)


def check_all(
    addresses: list[str], jobs: int, overrides: Mapping[str, Any], *, trusted: bool = False
) -> Iterator[CheckResult]:
    """Check scenarios on several processes; yield each result as it becomes known.

    Invalid ones come first, before any is flown. If a process dies, only the scenario that it was
    flying is reported as crashed. An interrupt from the keyboard, or closing the iterator, ends all
    processes at once.

    Args:
        addresses: Addresses of scenarios, as from `collect`.
        jobs: Number of processes.
        overrides: Values by dotted key, for every scenario.
        trusted: Whether to execute Python code that scenarios name.
    """
    scenarios = {}
    for address in addresses:
        try:
            scenario = load_scenario(address, overrides, trusted=trusted)
            require_trust(scenario)
            loop_of(scenario)
            scenarios[address] = scenario
        except InputError as error:
            yield CheckResult(address, "invalid", str(error))
    jobs = min(jobs, len(scenarios))
    loaded = [*scenarios.items()]
    if jobs <= 1:
        yield from map(check_one, loaded)
        return
    # The longest first, so that none of them is still running when all others have finished.
    by_length = sorted(loaded, key=lambda one: -one[1].simulation.steps)
    for (address, _), future in in_processes(check_one, by_length, jobs):
        yield _result(address, future)


def _result(address: str, future: Future[CheckResult]) -> CheckResult:
    error = future.exception()
    if error is not None:
        return CheckResult(address, "crashed", f"{type(error).__name__}: {error}")
    return future.result()
