"""Headless checks: fly many scenarios, evaluate their expectations, write JUnit XML."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, Literal
from xml.etree import ElementTree

from tiltsim.errors import InputError
from tiltsim.flight.expectations import Verdict, check_expectations
from tiltsim.plants.trust import require_trust
from tiltsim.resources import shipped_folder
from tiltsim.scenario.library import closest_in_library, library_name, read_toml, scenario_files
from tiltsim.scenario.loading import load_scenario, variant_names
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.shared_engine import compile_together, with_compiled
from tiltsim.simulation.simulate import simulate
from tiltsim.system.files import replacing
from tiltsim.system.processes import in_processes
from tiltsim.system.text import printable

Status = Literal["passed", "failed", "lost", "invalid", "crashed", "interrupted"]


@dataclass(frozen=True)
class CheckResult:
    """The outcome of checking one scenario."""

    address: str
    status: Status
    message: str  # why it did not pass, in one line; empty if passed
    verdicts: tuple[Verdict, ...] = ()
    wall_time: float = 0.0  # s


def collect(paths: Iterable[str]) -> list[str]:
    """Addresses of all scenarios under files and folders, families expanded into variants.

    A path that does not exist is looked up in the library. Raises `InputError` if it is not there
    either, or if a folder contains no scenario.
    """
    addresses: list[str] = []
    for path in paths:
        name, _, variant = path.partition("#")
        place = _find(name)
        if variant:
            addresses.append(path)
            continue
        files = scenario_files(place)
        if not files:
            raise InputError(f"{path}: no scenario file (*.toml) in this folder")
        for file in files:
            base = library_name(file)
            try:
                names = variant_names(file, read_toml(file))
            except InputError:
                names = []  # the file is checked like the others, and reported as invalid
            addresses += [f"{base}#{member}" for member in names] or [base]
    return list(dict.fromkeys(addresses))


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


def check_one(
    address: str,
    overrides: Mapping[str, Any],
    compiled: frozenset[str] = frozenset(),
    *,
    trusted: bool = False,
) -> CheckResult:
    """Fly one scenario and evaluate its expectations; errors become part of the result.

    Args:
        address: Of the scenario.
        overrides: Values by dotted key.
        compiled: Loops to fly natively, of `compile_together`.
        trusted: Whether to execute Python code that the scenario names.
    """
    start = perf_counter()
    try:
        scenario = load_scenario(address, overrides)
        require_trust(scenario, trusted)
        flight = simulate(with_compiled(scenario, compiled))
    except InputError as error:
        return CheckResult(address, "invalid", str(error))
    if flight.end.kind == "interrupted":
        raise KeyboardInterrupt
    verdicts = tuple(check_expectations(scenario, flight.metrics()))
    wall_time = perf_counter() - start
    # A scenario that may end early has an expectation on `diverged`.
    may_end_early = any(v.expectation.metric == "diverged" for v in verdicts)
    if flight.end.kind != "completed" and not may_end_early:
        return CheckResult(address, "lost", flight.end.message, verdicts, wall_time)
    failed = [v for v in verdicts if not v.holds]
    message = "; ".join(
        f"{v.expectation.metric} = {_number(v.measured)}, expected {v.bounds}" for v in failed
    )
    return CheckResult(address, "failed" if failed else "passed", message, verdicts, wall_time)


def _number(value: float | bool | None) -> str:
    if value is None:
        return "missing"
    return str(value).lower() if isinstance(value, bool) else f"{value:.6g}"


def check_all(
    addresses: list[str],
    jobs: int,
    overrides: Mapping[str, Any],
    report: Callable[[CheckResult], None],
    *,
    trusted: bool = False,
) -> list[CheckResult]:
    """Check scenarios on several processes.

    If a process dies, only the scenario that it was flying is reported as crashed. An interrupt
    from the keyboard ends all processes at once.

    Args:
        addresses: Of scenarios, as from `collect`.
        jobs: Number of processes.
        overrides: Values by dotted key, for every scenario.
        report: Called with each result as it becomes known.
        trusted: Whether to execute Python code that scenarios name.

    Returns:
        In the order of the addresses.
    """
    scenarios = _valid(addresses, overrides)
    jobs = min(jobs, len(addresses))
    compiled = compile_together(list(scenarios.values()), jobs)
    if jobs == 1:
        results = []
        for address in addresses:
            results.append(check_one(address, overrides, compiled, trusted=trusted))
            report(results[-1])
        return results
    by_address: dict[str, CheckResult] = {}
    work = partial(check_one, overrides=overrides, compiled=compiled, trusted=trusted)
    # The longest first, so that none of them is still running when all others have finished.
    steps = {address: scenario.simulation.steps for address, scenario in scenarios.items()}
    by_length = sorted(addresses, key=lambda address: -steps.get(address, 0))
    for address, future in in_processes(work, by_length, jobs):
        by_address[address] = _result(address, future)
        report(by_address[address])
    return [by_address[address] for address in addresses]


def _result(address: str, future: Future[CheckResult]) -> CheckResult:
    error = future.exception()
    if error is not None:
        return CheckResult(address, "crashed", f"{type(error).__name__}: {error}")
    return future.result()


def _valid(addresses: list[str], overrides: Mapping[str, Any]) -> dict[str, Scenario]:
    scenarios = {}
    for address in addresses:
        try:
            scenarios[address] = load_scenario(address, overrides)
        except InputError:
            continue  # reported when it is checked
    return scenarios


def interrupted_result(address: str) -> CheckResult:
    """The result of a scenario that was not finished before an interrupt."""
    return CheckResult(address, "interrupted", "not flown: interrupted")


def write_junit(results: list[CheckResult], path: Path) -> None:
    """Write results as JUnit XML, which CI services read."""
    failures = sum(result.status in {"failed", "lost"} for result in results)
    errors = sum(result.status in {"invalid", "crashed", "interrupted"} for result in results)
    suite = ElementTree.Element(
        "testsuite",
        name="tiltsim check",
        tests=str(len(results)),
        failures=str(failures),
        errors=str(errors),
        time=f"{sum(result.wall_time for result in results):.3f}",
    )
    for result in results:
        folder, _, name = printable(result.address).rpartition("/")
        message = printable(result.message)
        case = ElementTree.SubElement(
            suite, "testcase", classname=folder, name=name, time=f"{result.wall_time:.3f}"
        )
        if result.status in {"failed", "lost"}:
            ElementTree.SubElement(case, "failure", type=result.status, message=message)
        elif result.status != "passed":
            ElementTree.SubElement(case, "error", type=result.status, message=message)
    root = ElementTree.Element("testsuites")
    root.append(suite)
    tree = ElementTree.ElementTree(root)
    ElementTree.indent(tree)
    with replacing(path) as temporary:
        tree.write(temporary, encoding="utf-8", xml_declaration=True)
