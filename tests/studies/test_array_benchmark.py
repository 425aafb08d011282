"""The benchmark of batches in JAX."""

from __future__ import annotations

import pytest

from tiltsim.studies import array_benchmark

pytest.importorskip("jax")


@pytest.mark.slow
def test_rows_are_those_of_bench_with_precision_and_time_to_compile(monkeypatch):
    monkeypatch.setattr(array_benchmark, "TOTAL_STEPS", 200)
    rows = array_benchmark.bench_arrays([2])
    assert [row["precision"] for row in rows] == ["float64", "float32"]
    for row in rows:
        assert row["vehicles"] == 2
        assert row["realtime_factor"] == pytest.approx(row["steps_per_second"] * row["timestep"])
        assert row["compile_seconds"] > 0.0
