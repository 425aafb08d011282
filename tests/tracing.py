"""Coverage of the beginning of every test, the part that still sees new lines.

Another case of the same test sees few: its beginning is shorter.

Its tracer makes flights in Python five times slower, importing, compiling and drawing twice.
Pausing it can only lower the coverage that is reported, never raise it.
"""

from __future__ import annotations

import signal
import sys
from contextlib import contextmanager
from importlib.machinery import SourceFileLoader

import pytest

OURS = {"tiltsim", "tiltsim_controllers", "tests"}
BEGINNING = 0.25  # CPU s of every fixture and every test, the first time
AGAIN = 0.04  # with other parameters


class TracedBeginnings:
    """Stops coverage after the first moments of a test, and starts it again for the next.

    Args:
        coverage: Running measurement.
    """

    def __init__(self, coverage):
        self._coverage, self._seen = coverage, set()
        # An interrupt that a test raises while this lock is held would block all tests after it.
        coverage._collector.data_lock = None
        signal.signal(signal.SIGPROF, lambda *_: coverage.stop())
        signal.siginterrupt(signal.SIGPROF, False)

    @contextmanager
    def _beginning(self, function):
        # A new tracer: the old one keeps a stack of the frames that it has seen entered.
        self._coverage.stop()
        self._coverage.start()
        signal.setitimer(signal.ITIMER_PROF, AGAIN if function in self._seen else BEGINNING)
        self._seen.add(function)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        with self._beginning(fixturedef.func):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        with self._beginning(item.function):
            return (yield)


@contextmanager
def others_imported_untraced():
    """Hide from tracers the modules of other packages that are imported within."""
    load = SourceFileLoader.exec_module

    def exec_module(loader, module):
        tracer = sys.gettrace()
        if module.__name__.partition(".")[0] not in OURS:
            sys.settrace(None)
        try:
            load(loader, module)
        finally:
            sys.settrace(tracer)

    SourceFileLoader.exec_module = exec_module
    try:
        yield
    finally:
        SourceFileLoader.exec_module = load
