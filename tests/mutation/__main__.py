"""Mutation score of `controllers`: ``python -m tests.mutation --count 300 --seed 1``.

Each mutant (`tests.mutation.mutants`) runs in a fork of a process that has loaded the heavy
packages, against only the tests that execute its lines, quickest first, until one fails. Only tests
that run the source as Python count: compiled or on arrays, a mutant would be compared with itself.
Mutants that no test can tell from the original are listed with the reason in ``equivalent.toml``
and are not drawn.

Why a script: cosmic-ray writes every mutant to disk and starts the whole suite for it (a minute
each), mutmut and pytest-gremlins compile all mutants of a function into it behind a switch, which
the tests of the scalar source do not accept, and neither draws a seeded sample.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import importlib.abc
import importlib.util
import itertools
import json
import os
import random
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter, defaultdict
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before numpy loads

import hypothesis
import numpy  # noqa: F401  # loaded once for all forks, like the next five
import pytest
import scipy.integrate
import scipy.optimize
import scipy.signal
import scipy.spatial.transform  # noqa: F401
import sympy  # noqa: F401
from coverage import Coverage, CoverageData

from tests import tracing
from tests.mutation.mutants import Mutant, find_mutants

ROOT = Path(__file__).parents[2]
SOURCE_ROOT = ROOT / "controllers"
PACKAGE = "tiltsim_controllers"
TESTS = ("tests/controllers", "tests/laws", "tests/linear")
PYTEST = ["-q", "-o", "addopts=", "-p", "no:cacheprovider", "-p", "no:xdist", "--strict-markers"]
PYTEST += [
    "--hypothesis-seed=0",
    "--hypothesis-profile=mutation",
    "-m",
    "not slow and not viewer",
    "--no-header",
    "--tb=no",
]
PYTEST += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # hypothesis is loaded already
SHARE_AT_IMPORT = 0.4  # of the tests, by time, for a line that nearly all of them depend on
SURVIVED = {int(pytest.ExitCode.OK), int(pytest.ExitCode.NO_TESTS_COLLECTED)}


class TestMap:
    """Which tests execute which lines, and how long they take; as a pytest plugin it finds out."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self.skipped: set[str] = set()
        self.by_line: dict[str, dict[int, list[str]]] = {}
        self._coverage: Coverage | None = None

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        if self._coverage is not None:
            self._coverage.switch_context(nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed.add(report.nodeid)
        if report.skipped:
            self.skipped.add(report.nodeid)

    def measure(self, file: Path) -> int:
        """Run all tests under a tracer that sees every line."""
        tracing.BEGINNING = None
        data = file.with_suffix(".coverage")
        self._coverage = Coverage(data, source=[str(SOURCE_ROOT / PACKAGE)], config_file=False)
        self._coverage.start()
        code = pytest.main([*PYTEST, *TESTS], plugins=[self])
        self._coverage.stop()
        self._coverage.save()
        if code not in {pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED}:
            return int(code)
        contexts = CoverageData(data)
        contexts.read()
        for name in contexts.measured_files():
            lines = contexts.contexts_by_lineno(name)
            self.by_line[str(Path(name).relative_to(SOURCE_ROOT))] = lines
        data.unlink()
        self.write(file)
        return 0

    def confirm(self, file: Path) -> int:
        """Run the passed tests once more, as against a mutant: untraced, quickest first."""
        self.read(file)
        ranked = sorted(self.seconds, key=self.seconds.__getitem__)
        self.seconds.clear()
        pytest.main([*PYTEST, *TESTS], plugins=[self, Selection(ranked)])
        self.write(file)
        return 0

    def write(self, file: Path) -> None:
        """The times of the tests that passed, the lines, and the tests that failed."""
        passed = self.seconds.keys() - self.failed - self.skipped
        seconds = {test: self.seconds[test] for test in passed}
        file.write_text(json.dumps([seconds, self.by_line, sorted(self.failed)]))

    def read(self, file: Path) -> None:
        self.seconds, self.by_line, failed = json.loads(file.read_text())
        self.failed = set(failed)

    def tests_of(self, path: str, mutant: Mutant) -> list[str]:
        """Tests that execute the mutant's lines, quickest first.

        For lines that run at import: tests that execute the module otherwise, then the quick ones.
        """
        lines = self.by_line.get(path, {})
        found = {test for line in mutant.lines for test in lines.get(str(line), [])}
        if "" not in found:
            return sorted(found & self.seconds.keys(), key=self.seconds.__getitem__)
        own = {test for tests in lines.values() for test in tests}
        ranked = sorted(self.seconds, key=lambda test: (test not in own, self.seconds[test]))
        ends = itertools.accumulate(self.seconds[test] for test in ranked)
        limit = SHARE_AT_IMPORT * sum(self.seconds.values())
        return [test for test, end in zip(ranked, ends) if end <= limit]


class Selection:
    """A pytest plugin that keeps the tests named, in this order."""

    def __init__(self, tests: list[str]) -> None:
        self.rank = {test: index for index, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        kept = (item for item in items if item.nodeid in self.rank)
        items[:] = sorted(kept, key=lambda item: self.rank[item.nodeid])


class Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module from a syntax tree instead of its file."""

    def __init__(self, name: str, path: Path, tree: ast.Module) -> None:
        self.name, self.path, self.tree = name, path, tree

    def find_spec(self, fullname: str, path: object, target: object = None) -> ModuleSpec | None:
        if fullname != self.name:
            return None
        folder = [str(self.path.parent)] if self.path.name == "__init__.py" else None
        return importlib.util.spec_from_file_location(
            fullname, self.path, loader=self, submodule_search_locations=folder
        )

    def exec_module(self, module: object) -> None:
        exec(compile(self.tree, str(self.path), "exec"), module.__dict__)


class WithoutJax(PathFinder):
    """Finds no JAX, as where it is not installed."""

    @classmethod
    def find_spec(cls, fullname: str, path: object = None, target: object = None) -> object:
        return None if fullname == "jax" else super().find_spec(fullname, path, target)


def skip_what_is_compiled() -> None:
    """From now on in this process, tests that compile machine code or use JAX skip themselves."""

    from tiltsim.engines import machine_code

    def skip(*_: object, **__: object) -> None:
        pytest.skip("compiles")

    machine_code.MachineCode.__init__ = skip
    sys.meta_path[sys.meta_path.index(PathFinder)] = WithoutJax


def in_a_fork(work, seconds: float) -> int:
    """Start ``work()`` in a fork, silent, killed after some seconds; its process number."""
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds)  # kills the process
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        os.environ["XDG_CACHE_HOME"] = os.devnull  # compiled mutants must not be found by others
        skip_what_is_compiled()
        code = int(work())
    finally:
        os._exit(code)


def try_mutant(path: Path, tree: ast.Module, mutant: Mutant, tests: list[str]) -> int:
    """Run tests against a mutant; pytest's exit code."""
    mutant.apply()
    name = ".".join(path.relative_to(SOURCE_ROOT).with_suffix("").parts).removesuffix(".__init__")
    sys.meta_path.insert(0, Finder(name, path, tree))
    files = sorted({test.partition("::")[0] for test in tests})
    return int(pytest.main([*PYTEST, "-x", *files], plugins=[Selection(tests)]))


def measured_map() -> TestMap:
    """The map of the tests, kept between runs as long as no source changes."""
    content = hashlib.sha256()
    for folder in ("controllers", "tests", "tiltsim"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in {".py", ".toml", ".xml"}:
                content.update(path.read_bytes())
    file = Path(tempfile.gettempdir()) / f"tiltsim-mutation-{content.hexdigest()[:16]}.json"
    tests = TestMap()
    if not file.exists():
        print("running all tests twice, to see which lines each executes", flush=True)
        for work in (tests.measure, tests.confirm):
            child = in_a_fork(lambda work=work: work(file), 1800.0)
            if os.waitpid(child, 0)[1]:
                file.unlink(missing_ok=True)
                sys.exit(f"the tests in {', '.join(TESTS)} could not be run")
    tests.read(file)
    for test in sorted(tests.failed):
        print(f"left out, as it fails without any mutant: {test}")
    return tests


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=300, help="mutants to draw")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draw")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", help="text that the mutants' keys contain")
    parser.add_argument("--min-score", type=float, default=0.0, help="fail below this, percent")
    options = parser.parse_args()

    hypothesis.settings.register_profile(
        "mutation",
        database=None,
        deadline=None,
        phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate],
    )
    tests = measured_map()
    listed = tomllib.loads((Path(__file__).parent / "equivalent.toml").read_text())["equivalent"]
    equivalent = {entry["mutant"] for entry in listed}
    known = []
    for path in sorted((SOURCE_ROOT / PACKAGE).rglob("*.py")):
        tree = ast.parse(path.read_text())
        short = str(path.relative_to(SOURCE_ROOT / PACKAGE).with_suffix(""))
        known += [(path, tree, mutant) for mutant in find_mutants(short, tree)]
    stale = equivalent - {mutant.key for _, _, mutant in known}
    pool = [
        entry for entry in known if entry[2].key not in equivalent and options.only in entry[2].key
    ]
    drawn = random.Random(options.seed).sample(pool, min(options.count, len(pool)))
    print(f"{len(drawn)} of {len(pool)} mutants, seed {options.seed}", flush=True)

    running: dict[int, Mutant] = {}
    outcomes: dict[str, list[str]] = defaultdict(list)
    queue = drawn[::-1]
    timeouts, began = 0, time.monotonic()
    while queue or running:
        while queue and len(running) < options.jobs:
            path, tree, mutant = queue.pop()
            chosen = tests.tests_of(str(path.relative_to(SOURCE_ROOT)), mutant)
            limit = 30.0 + 5.0 * sum(tests.seconds[test] for test in chosen)
            work = (path, tree, mutant, chosen)
            running[in_a_fork(lambda work=work: try_mutant(*work), limit)] = mutant
        child, status = os.wait()
        mutant = running.pop(child)
        survived = os.WIFEXITED(status) and os.WEXITSTATUS(status) in SURVIVED
        timeouts += os.WIFSIGNALED(status)
        if survived:
            print(f"survived ({len(drawn) - len(queue)}) {mutant.key}", flush=True)
        outcomes[mutant.key.partition(":")[0]].append("survived" if survived else "killed")
    total = Counter(outcome for found in outcomes.values() for outcome in found)
    score = 100.0 * total["killed"] / max(1, total.total())
    for module, found in sorted(outcomes.items()):
        print(f"{module:40} {found.count('killed'):4} of {len(found):4}")
    for key in sorted(stale):
        print(f"no such mutant any more: {key}")
    by_time = f", {timeouts} of them by time" if timeouts else ""
    print(f"killed {score:.1f} % of {total.total()}{by_time} in {time.monotonic() - began:.0f} s")
    return int(score < options.min_score)


if __name__ == "__main__":
    sys.exit(main())
