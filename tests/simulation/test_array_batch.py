"""Batches in JAX: every row is the flight that its scenario makes alone."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.laws.test_laws import LAWS
from tests.simulation.test_batch import EXACT, without_speed
from tiltsim.scenario.loading import merge

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
    for row, scenario in zip(tiltsim.fly(several, keep_samples=True), several, strict=True):
        flight = alone(scenario)
        assert row.flight.engine == "jax"
        assert row.end == flight.end
        np.testing.assert_allclose(row.flight.samples, flight.samples, rtol=1e-9, atol=1e-9)
        expected = pytest.approx(without_speed(flight.metrics()), rel=1e-9, abs=1e-9, nan_ok=True)
        assert without_speed(row.metrics) == expected


def test_rows_differ_in_numbers_and_fly_as_alone():
    several = scenarios(
        CAR,
        {},
        {"vehicle": {"mass": 1.1}, "gait": {"period": 0.45}},
        {"initial": {"position": [0.0, 0.1, 0.0]}, "reference": {"velocity": [0.4, 0.1, 0.0]}},
        {"initial": {"position": [99.0, 0.0, 0.0]}},  # ends at once
    )
    assert_rows_fly_as_alone(several)


@pytest.mark.slow
def test_rows_that_end_early_end_as_alone():
    several = scenarios(TROT, *({"initial": {"attitude": [0.3 * i, 0.0, 0.0]}} for i in range(8)))
    kinds = {alone(scenario).end.kind for scenario in several}
    assert kinds == {"completed", "singular"}
    assert_rows_fly_as_alone(several)


@pytest.mark.slow
def test_single_precision_is_near_double_precision():
    (double,) = scenarios(TROT, {})
    single = double.replace({"simulation.precision": "float32"})
    first, second = (row.flight for row in tiltsim.fly([double, single], keep_samples=True))
    difference = np.abs(first.samples[:, 1:4] - second.samples[:, 1:4]).max()
    assert 0.0 < difference < 1e-4
    np.testing.assert_array_equal(first["time"], second["time"])
