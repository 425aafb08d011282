"""The versions that made a report, and how to cite it."""

import os
import platform
import subprocess
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final, Self

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
        if git("ls-files", "--error-unmatch", "made.py") != "made.py":
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
