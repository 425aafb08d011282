"""Makes a report from paths of scenarios, and says which versions made it and how to cite it."""

import os
import platform
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Final, Self

from tiltsim.report.claim_rows import analyze, criteria, failures, make_rows
from tiltsim.report.content import Report
from tiltsim.report.findings import FINDINGS
from tiltsim.report.flights import compare, fly, report_entries
from tiltsim.report.pictures import draw_all
from tiltsim.resources import shipped_folder
from tiltsim.studies.checking import collect


def make_report(
    paths: list[str],
    folder: Path,
    jobs: int,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> Report:
    """Fly, compute and draw everything that a report shows.

    Args:
        paths: Files, folders or library names, as in `tiltsim.studies.checking.collect`. With none,
            the report is complete: all scenarios, all claims, and the findings.
        folder: Where flights, computed values and drawings are stored.
        jobs: Processes.
        progress: Called with the unit of the count, the number done, and the total.

    Raises:
        InputError: If a scenario is invalid, or a process dies.
    """
    whole = not paths
    entries = report_entries(collect(paths or [str(shipped_folder("scenarios"))]))
    flights = fly(entries, folder, jobs, partial(progress, "flights"))
    values = analyze(folder, partial(progress, "computed claims")) if whole else {}
    rows = make_rows(entries, flights, values, whole=whole)
    drawing = partial(progress, "figures")
    return Report(
        criteria=criteria(rows, flights) if whole else (),
        entries=entries,
        flights=flights,
        rows=rows,
        failures=failures(entries, flights),
        comparisons=compare(entries, flights),
        drawings=draw_all(entries, flights, folder, jobs, drawing, whole=whole),
        findings=FINDINGS if whole else (),
    )


PACKAGES: Final = ("tiltsim", "mujoco", "numpy", "llvmlite", "scipy")


@dataclass(frozen=True)
class Made:
    """Date, commit, versions and machine of a report."""

    date: str  # ISO 8601, UTC
    commit: str  # of the checkout; empty for an installed package, "+" for uncommitted changes
    versions: dict[str, str]
    machine: str

    @classmethod
    def now(cls) -> Self:
        """The versions in this process."""
        versions = {name: version(name) for name in PACKAGES}
        return cls(
            date=datetime.now(UTC).date().isoformat(),
            commit=_commit(Path(__file__).parent),
            versions=versions | {"Python": platform.python_version()},
            machine=f"{_processor()}, {os.cpu_count()} cores, {platform.system()}",
        )

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        versions = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        commit = f" at commit {self.commit}" if self.commit else ""
        return f"Made on {self.date} with {versions}{commit} on {self.machine}."

    @property
    def bibtex(self) -> str:
        """An entry for a bibliography."""
        commit = f", commit {self.commit}" if self.commit else ""
        return "\n".join(
            (
                "@misc{tiltsim-reproduction-report,",
                "  title = {tiltsim: a reproduction report on ``Advanced Feedback Linearization",
                "           Control for Tiltrotor UAVs''},",
                "  author = {{The tiltsim developers}},",
                f"  year = {{{self.date[:4]}}},",
                f"  note = {{Version {self.versions['tiltsim']}{commit}, made on {self.date};",
                "          cite a row by its id, such as ch4-rest}",
                "}",
            )
        )


def _commit(folder: Path) -> str:
    def git(*arguments: str) -> str:
        done = subprocess.run(
            ("git", "-C", str(folder), *arguments),
            capture_output=True, text=True, timeout=10.0, check=True,
        )  # fmt: skip
        return done.stdout.strip()

    try:
        if git("ls-files", "--error-unmatch", "making.py") != "making.py":
            return ""
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "--short=12", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return ""


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(": ")[2]
    except OSError:
        pass
    return platform.processor() or platform.machine()
