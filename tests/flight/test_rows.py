"""Metrics of flights computed together equal each flight's metrics, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.test_laws import LAWS
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End, Metrics, metrics_of_rows
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import load_scenario
from tiltsim_controllers.mathematics.records import flatten

TROT = {"type": "trot_continuous", "period": 1.0, "amplitude": 0.4}
CIRCLE = {"type": "circle", "radius": 2.0, "angular_frequency": 0.5}
THESIS = {"simulation": {"plant": "thesis"}, "gait": TROT}
MASSES = ("vehicle.mass", (0.9, 0.95, 1.0))
CASES = {law: (tables, *MASSES) for law, tables in LAWS.items()} | {
    "turbulence": (
        THESIS | {"air": {"turbulence": {"wind_at_6m": 3.0}, "drag": {"linear": [0.1] * 3}}},
        "air.turbulence.wind_at_6m",
        (3.0, 4.0, 4.0),
    ),
    "fault": (
        THESIS | {"fault": [{"type": "rotor_loss", "rotor": 2, "time": 9.0}]},
        "fault[0].time",
        (8.0, 9.0, 30.0),
    ),
    "model error": (THESIS, "model_error.mass", (0.9, 1.05, 1.1)),
    "supervisor": (
        {"controller": {"supervisor": {"strategy": "scale"}}, "gait": TROT},
        "gait.amplitude",
        (0.3, 0.4, 0.5),
    ),
    "limit": ({}, "vehicle.max_rotor_speed", (300.0, 310.0, 900.0)),
    "circle": ({"reference": CIRCLE}, "reference.position", ([0.0] * 3, [1.0] * 3, [2.0] * 3)),
    "multirotor": ("fleet/tilt_hexarotor#hover", "vehicle.max_rotor_speed", (300.0, 310.0, 838.0)),
}
TIMES = np.arange(0.0, 25.1, 0.5)
END = End("completed", TIMES[-1])


@pytest.mark.parametrize("name", CASES)
def test_metrics_of_rows_equal_each_flights_to_the_last_bit(name):
    base, key, values = CASES[name]
    base = load_scenario(base)
    assemblies = [assemble(base.replace({key: value})) for value in values]
    fields = assemblies[0].loop.sample_fields
    samples = np.random.default_rng(1).normal(0.0, 0.3, (len(values), len(TIMES), len(fields)))
    samples[:, :, 0] = TIMES
    for place, field in enumerate(fields):
        samples[:, :, place] += 300.0 if field.startswith("rotor_speed") else 0.0
    numbers = np.array([[*flatten(assembly.setup.parameters)] for assembly in assemblies])
    together = metrics_of_rows(assemblies, numbers, samples, END, [1.0] * len(assemblies))
    for assembly, own, found in zip(assemblies, samples, together, strict=True):
        alone = Flight(assembly, own.copy(), END, "jax", 1.0).metrics()
        assert [*found.items()] == [*alone.items()]
    assert len({str(found) for found in together}) == len(values)


def test_rows_that_differ_in_more_than_numbers_have_no_metrics_together():
    assemblies = [
        assemble(load_scenario({"vehicle": limits})) for limits in ({}, {"max_rotor_speed": 400.0})
    ]
    samples = np.zeros((2, len(TIMES), len(assemblies[0].loop.sample_fields)))
    assert metrics_of_rows(assemblies, np.empty((2, 0)), samples, END, [1.0] * 2) is None


def test_squares_may_overflow_in_metrics_of_rows_as_in_one_flight():
    def shared():
        return Metrics({"max_abs_roll": np.square(np.array([1e200]))[0]})

    assembly = assemble(load_scenario({}))
    samples = np.zeros((2, len(assembly.loop.sample_fields)))
    flight = Flight(assembly, samples, END, "jax", 1.0, shared_metrics=shared)
    with np.errstate(over="raise"):
        assert flight.metrics() == {"max_abs_roll": np.inf}
