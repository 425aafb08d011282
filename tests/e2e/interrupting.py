"""Signals at random moments of sweeps.

``python -m tests.e2e.interrupting --engine native --count 500 --seed 1`` sends many.
"""

from __future__ import annotations

import argparse
import faulthandler
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path
from random import Random
from tempfile import mkdtemp
from time import monotonic

MEANT = {signal.SIGINT: 130, signal.SIGTERM: 143}

PATIENCE = 60.0
"""Time (s) within which an interrupted sweep ends: longer than XLA's compiler takes."""

SWEEPS = {
    "native": ("ch04_tracking/setpoint#rho_065_modified", "mujoco", 20.0, 40, 8),
    "jax": ("ch10_state_drift/planned_direction", "thesis", 0.1, 6, 3),  # compiled in a second
}
"""For an engine: scenario, plant, duration (s) of a flight, flights, flights per chunk."""

SWEEP = """
scenario = "{scenario}"
chunk_size = {chunk}
[set]
"simulation.engine" = "{engine}"
"simulation.plant" = "{plant}"
"simulation.duration" = {duration}
[[axis]]
type = "linspace"
key = "initial.velocity[0]"
start = -600.0
stop = 600.0
count = {flights}
[[axis]]
type = "normal"
key = "initial.attitude[2]"
mean = 0.0
standard_deviation = 0.01
[sample]
count = 1
seed = 1
"""
"""A sweep; in MuJoCo, many of its flights diverge, of which MuJoCo warns."""


def sweep_file(folder, engine):
    """The sweep of an engine."""
    scenario, plant, duration, flights, chunk = SWEEPS[engine]
    values = {"scenario": scenario, "engine": engine, "plant": plant, "duration": duration}
    file = folder / f"{engine}.toml"
    file.write_text(SWEEP.format(**values, flights=flights, chunk=chunk), encoding="utf-8")
    return file


def _as_console_script(arguments, output):
    """Body of a forked process: the command, its output in a file."""
    from tiltsim.__main__ import main

    signal.signal(signal.SIGINT, signal.default_int_handler)
    with output.open("wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    faulthandler.enable(2)
    sys.argv = ["tiltsim", *arguments]
    sys.exit(main())


class _Fresh:
    """The command in a new interpreter, with the methods of multiprocessing's processes."""

    def __init__(self, arguments, output):
        with output.open("wb") as file:
            command = [sys.executable, "-X", "faulthandler", "-m", "tiltsim", *arguments]
            self._process = subprocess.Popen(command, stdout=file, stderr=file)
        self.pid = self._process.pid

    def join(self, timeout=None):
        """Wait for the end."""
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            return

    def kill(self):
        """Kill it."""
        self._process.kill()

    @property
    def exitcode(self):
        """Exit code, or None."""
        return self._process.poll()


class Interrupting:
    """Runs a sweep that signals interrupt until it is finished, and then the next.

    Args:
        folder: For files and results.
        engine: Engine of the flights, a key of `SWEEPS`.
        seed: Seed of signals and moments.
    """

    def __init__(self, folder, engine, seed):
        self._folder, self._random = folder, Random(f"{engine}:{seed}")
        self._file = sweep_file(folder, engine)
        self._output = folder / f"{engine}.txt"
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["tests.e2e.loaded"])
        self._sweeps = 0
        self.counts = Counter()
        self.slowest = 0.0
        # The first one fills the cache of native code.
        self._seconds = {fresh: self._run(self._start(fresh=fresh)) for fresh in (True, False)}
        self._expected = (self._out / "sweep.parquet").read_bytes()

    def _start(self, *, fresh, continued=False):
        if not continued:
            self._sweeps += 1
            self._out = self._folder / f"{self._file.stem}{self._sweeps}"
        given = ["sweep", str(self._file), "--out", str(self._out)]
        if fresh:
            return _Fresh(given, self._output)
        process = self._context.Process(target=_as_console_script, args=(given, self._output))
        process.start()
        return process

    def _run(self, process):
        began = monotonic()
        process.join()
        assert process.exitcode == 0, self._output.read_text()
        return monotonic() - began

    def interrupt(self):
        """Send one signal to the sweep; return the mistake, or an empty text."""
        random = self._random
        number, fresh = random.choice(list(MEANT)), random.random() < 0.2
        continued = (self._out / "sweep.toml").exists() or (self._out / "parts").exists()
        continued = continued and not (self._out / "sweep.parquet").exists()
        process = self._start(fresh=fresh, continued=continued)
        process.join(random.uniform(0.0, 1.1 * self._seconds[fresh]))
        if process.exitcode is None:
            os.kill(process.pid, number)
            self.counts[number.name, "continued" if continued else "begun"] += 1
        sent = monotonic()
        process.join(PATIENCE)
        self.slowest = max(self.slowest, monotonic() - sent)
        if process.exitcode is None:
            os.kill(process.pid, signal.SIGABRT)  # the fault handler prints where it is
            process.join(PATIENCE)
            process.kill()
            where = self._output.read_text(errors="replace")
            return f"{number.name}: runs on for {PATIENCE} s\n{where}"
        return self._mistake(number, process.exitcode)

    def _mistake(self, number, code):
        text = self._output.read_text(errors="replace")
        self.counts[f"exit code {code}"] += 1
        shown = f"{number.name}: exit code {code}: {text}"
        if "Traceback" in text or "Exception ignored" in text:
            return shown
        if code == 0:
            whole = (self._out / "sweep.parquet").read_bytes() == self._expected
            shutil.rmtree(self._out)
            return "" if whole else f"other rows: {shown}"
        if code == MEANT[number]:
            return "" if "tiltsim: interrupted" in text.splitlines()[-1] else shown
        outside = text in {"", "tiltsim: interrupted\n"} or "written to" in text
        return "" if code == -number and outside else shown  # while Python itself begins or ends


def interrupt_sweeps(engine, count, seed, report=lambda mistake, sweeps: None):
    """Send ``count`` signals; return the mistakes and the number of each outcome."""
    folder = Path(mkdtemp(prefix="interrupting"))
    mistakes = []
    try:
        sweeps = Interrupting(folder, engine, seed)
        while sum(n for key, n in sweeps.counts.items() if isinstance(key, tuple)) < count:
            mistake = sweeps.interrupt()
            if mistake:
                mistakes.append(mistake)
            report(mistake, sweeps)
    finally:
        shutil.rmtree(folder)
    return mistakes, sweeps


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engine", choices=SWEEPS, default="native")
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    def show(mistake, sweeps):
        """Print a mistake, and the outcomes so far."""
        counted = f"{dict(sweeps.counts)}; slowest end {sweeps.slowest:.1f} s"
        sys.stdout.write(f"{mistake}\n{counted}\n" if mistake else f"{counted}\n")
        sys.stdout.flush()

    found, _ = interrupt_sweeps(options.engine, options.count, options.seed, show)
    sys.exit(f"{len(found)} mistakes" if found else 0)
