"""Settings of all tests."""

from __future__ import annotations

import gc
import signal
import sys

import pytest
from hypothesis import settings

from tests.tracing import trace_few_rows, trace_seldom

# A busy machine may take long for an example; nothing that is tested depends on it.
settings.register_profile("tiltsim", deadline=None)
settings.load_profile("tiltsim")

# Importing and compiling leave much to look through and little to free: every search for cycles
# among all that the session keeps would take a tenth of its time.
gc.disable()

# A shell has processes in its background ignore the keyboard, which tests press.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    """Under coverage, most steps of a flight run without its tracer."""
    runs_tests = hasattr(session.config, "workerinput") or not session.config.getoption("-n", None)
    if runs_tests and sys.gettrace() is not None:
        trace_seldom()


def pytest_collection_finish():
    """From here on, cycles are searched for again, among what is new and not quite as often."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def pytest_collection_modifyitems(items):
    """Order the tests, and choose the tests that coverage traces.

    The longest of the slow tests begin first, and tests that wait for the viewer: at the end, one
    process would run them alone.
    """
    if sys.gettrace() is not None:
        trace_few_rows(items)

    def is_late(item):
        slow = item.get_closest_marker("slow")
        long = slow is not None and slow.kwargs.get("longest")
        return not (long or item.get_closest_marker("viewer"))

    items.sort(key=is_late)
