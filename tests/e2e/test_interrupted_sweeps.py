"""Sweeps that signals interrupt lose no row, whenever they come."""

from __future__ import annotations

import sys

import pytest

from tests.e2e.interrupting import interrupt_sweeps


@pytest.mark.slow(longest=True)
@pytest.mark.skipif(sys.platform == "win32", reason="other signals")
@pytest.mark.parametrize(("engine", "count"), [("native", 8), ("jax", 2)])
def test_signals_at_any_moment_end_a_sweep_and_lose_nothing(engine, count):
    if engine == "jax":
        pytest.importorskip("jax")
    mistakes, _ = interrupt_sweeps(engine, count, seed=0)
    assert mistakes == []
