"""Settings of all tests."""

from __future__ import annotations

import gc
import os
import signal
import sys

import pytest
from coverage import Coverage
from hypothesis import settings

from tests import tracing

# As the command line does, before numpy loads; every core has a process already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A busy machine may take long for an example; nothing that is tested depends on it.
settings.register_profile("tiltsim", deadline=None)
settings.load_profile("tiltsim")

# Importing and compiling leave much to look through and little to free: every search for cycles
# among all that the session keeps would take a tenth of its time.
gc.disable()

# A shell has processes in its background ignore the keyboard, which tests press.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Under coverage, trace no other packages here, and later only the beginning of each test."""
    if sys.gettrace() is None or tracing.BEGINNING is None:
        return (yield)
    with tracing.others_imported_untraced():
        result = yield
    session.config.pluginmanager.register(tracing.TracedBeginnings(Coverage.current()))
    return result


def pytest_collection_finish():
    """From here on, cycles are searched for again, among what is new and not nearly as often."""
    gc.freeze()
    gc.set_threshold(200_000, 20, 20)
    gc.enable()


def pytest_collection_modifyitems(items):
    """Order the tests.

    The longest of the slow tests begin first, and tests that wait for the viewer: at the end, one
    process would run them alone.
    """

    def is_late(item):
        slow = item.get_closest_marker("slow")
        long = slow is not None and slow.kwargs.get("longest")
        return not (long or item.get_closest_marker("viewer"))

    items.sort(key=is_late)


@pytest.fixture(scope="session")
def scenarios():
    """All scenarios of the shipped library."""
    from tiltsim.scenario.library import library_entries
    from tiltsim.scenario.loading import load_scenario

    return [load_scenario(address) for address, _, _ in library_entries()]
