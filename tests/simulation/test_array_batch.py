"""Batches in JAX: every row is the flight that its scenario makes alone."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tiltsim
from tests.laws.test_laws import LAWS
from tests.simulation.test_batch import EXACT, without_speed
from tiltsim.arrays.xla_flags import MERGES_LOOPS, let_xla_merge_loops
from tiltsim.flight.flight import Flight
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import merge
from tiltsim.simulation.array_batch import ArrayBatch, _padded

pytest.importorskip("jax")

CAR = LAWS["tilt_car_planned_direction"]
TROT = {
    "controller": EXACT,
    "gait": {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0},
    "simulation": {"duration": 0.41},
}


def scenarios(base, *changes, **simulation):
    simulation = {"plant": "thesis", "duration": 0.205, "engine": "jax", **simulation}
    tables = merge({"simulation": simulation}, base)
    return [tiltsim.parse_scenario(merge(tables, change)) for change in changes]


def alone(scenario):
    return tiltsim.simulate(scenario.replace({"simulation.engine": "python"}))


def assert_rows_fly_as_alone(several):
    rows = list(tiltsim.fly(several, keep_samples=True))
    for row, scenario in zip(rows, several, strict=True):
        flight = alone(scenario)
        assert row.flight.engine == "jax"
        assert row.end == flight.end
        np.testing.assert_allclose(row.flight.samples, flight.samples, rtol=1e-9, atol=1e-9)
        expected = pytest.approx(without_speed(flight.metrics()), rel=1e-9, abs=1e-9, nan_ok=True)
        assert without_speed(row.metrics) == expected
    return rows


@pytest.mark.slow
def test_rows_differ_in_numbers_and_fly_as_alone():
    several = scenarios(
        CAR,
        {},
        {"vehicle": {"mass": 1.1}, "gait": {"period": 0.45}},
        {"initial": {"position": [0.0, 0.1, 0.0]}, "reference": {"velocity": [0.4, 0.1, 0.0]}},
        {"initial": {"position": [99.0, 0.0, 0.0]}},  # ends at once
    )
    first, second, *_ = assert_rows_fly_as_alone(several)
    # The block from which their metrics come together is kept anyway: no copy beside it.
    assert first.flight.samples.base is second.flight.samples.base is not None


@pytest.mark.slow
def test_rows_that_end_early_end_as_alone():
    several = scenarios(TROT, *({"initial": {"attitude": [0.3 * i, 0.0, 0.0]}} for i in range(8)))
    kinds = {alone(scenario).end.kind for scenario in several}
    assert kinds == {"completed", "singular"}
    assert_rows_fly_as_alone(several)


@pytest.mark.slow
def test_single_precision_is_near_double_precision():
    (double,) = scenarios(TROT, {})
    first = alone(double)
    second = tiltsim.simulate(double.replace({"simulation.precision": "float32"}))
    difference = np.abs(first.samples[:, 1:4] - second.samples[:, 1:4]).max()
    assert 0.0 < difference < 1e-4
    np.testing.assert_array_equal(first["time"], second["time"])


def test_zeros_of_either_sign_are_different_numbers():
    starts = ({"initial": {"position": [0.0, zero, 0.0]}} for zero in (0.0, -0.0))
    assemblies = list(map(assemble, scenarios(CAR, *starts)))
    with ThreadPoolExecutor(1) as pool:
        both, *each = (
            ArrayBatch(chosen, 1, pool, Flight.metrics)._batch
            for chosen in (assemblies, assemblies[:1], assemblies[1:])
        )
    assert both._numbers.count(None) == 1
    assert each[0] is not each[1]


def test_batches_have_few_sizes_since_each_is_compiled():
    sizes = [_padded(rows) for rows in range(1, 5000)]
    assert sorted({*sizes}) == [*(2**n for n in range(10)), 1024, 2048, 3072, 4096, 5120]
    assert all(size >= rows for rows, size in enumerate(sizes, start=1))


def test_the_command_line_adds_its_option_to_the_users_options(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_dump_to=here")
    let_xla_merge_loops()
    assert os.environ["XLA_FLAGS"].split() == [
        "--xla_dump_to=here",
        f"--xla_backend_extra_options={MERGES_LOOPS}=true",
    ]
    let_xla_merge_loops()
    assert os.environ["XLA_FLAGS"].count("xla_backend_extra_options") == 1
