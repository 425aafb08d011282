"""Settings of all tests."""

from __future__ import annotations

import signal
import sys

import pytest
from hypothesis import settings

from tests.tracing import trace_seldom

# A busy machine may take long for an example; nothing that is tested depends on it.
settings.register_profile("tiltsim", deadline=None)
settings.load_profile("tiltsim")

# A shell has processes in its background ignore the keyboard, which tests press.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _seldom_traced():
    """Under coverage, most steps of a flight run without its tracer."""
    with pytest.MonkeyPatch.context() as patch:
        if sys.gettrace() is not None:
            trace_seldom(patch)
        yield
