"""Results of `tiltsim check`, and the files that other programs read: JSON and JUnit XML."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, get_args
from xml.etree import ElementTree

from tiltsim.exit_codes import DONE, EXPECTATION_FAILED, INVALID_INPUT, VEHICLE_LOST
from tiltsim.flight.expectations import Verdict
from tiltsim.system.files import replacing
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
