"""The benchmark of batches, in lanes and in JAX."""

from __future__ import annotations

import pytest

from tiltsim.studies import array_benchmark


@pytest.mark.parametrize("engine", ["native", pytest.param("jax", marks=pytest.mark.slow)])
def test_rows_extend_bench_by_precision_and_time_to_compile(engine, monkeypatch):
    if engine == "jax":
        pytest.importorskip("jax")
    monkeypatch.setattr(array_benchmark, "TOTAL_STEPS", 200)
    monkeypatch.setattr(array_benchmark, "_kinds", lambda: [array_benchmark.Kind(engine)])
    (row,) = array_benchmark.bench_arrays([2])
    assert (row["engine"], row["precision"]) == (engine, "float64")
    assert row["vehicles"] == 2
    assert row["realtime_factor"] == pytest.approx(row["steps_per_second"] * row["timestep"])
    assert row["compile_seconds"] >= 0.0
    if engine == "jax":
        assert row["compile_seconds"] > 0.0


def test_rk4_at_8_ms_is_within_a_micrometer(monkeypatch):
    monkeypatch.setattr(array_benchmark, "ACCURACY_DURATION", 8.0)
    monkeypatch.setattr(array_benchmark, "ACCURACY_VEHICLES", 2)
    monkeypatch.setattr(array_benchmark, "REFERENCE_STEP", 0.002)
    rows = array_benchmark.bench_array_accuracy([0.008])
    assert [row["batch_functions"] for row in rows] == ["exact", "quick"]
    for row in rows:
        assert 0.0 < row["position_error"] < 1e-6
        assert row["integrator"] == "RK4"
