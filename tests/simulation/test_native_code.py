"""Native code beside flights: sign checks, columns, names, announcements, choice of engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tiltsim
import tiltsim.engines.sample_evaluation
from tests.laws.test_laws import LAWS
from tests.simulation.test_batch import ALL_LAWS, GAITS, scenario
from tiltsim.closed_loop.assembly import program_key
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import LOOPS, assemble
from tiltsim.plants.plant import choose_engine
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.code.arrays import traceable, xp


@pytest.mark.parametrize("law", LOOPS)
def test_every_sign_check_has_a_cause(law):
    plant, loop = make_plant(assemble(scenario(ALL_LAWS[law], engine="python"))), LOOPS[law]
    values = plant.observe()
    sample = dict(zip(loop.sample_fields, (plant.time, *values), strict=True))
    assembly = assemble(scenario(ALL_LAWS[law]))
    numbers = assembly.sign_check_values(plant.time, values)
    assert len(loop.causes(sample, assembly.setup)) == len(numbers)
    assert all(np.isfinite(numbers))


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("decoupler", ["conventional", "modified", "exact"])
def test_references_are_the_same_floats_natively(gait, decoupler, monkeypatch):
    tables = {"gait": {"type": gait, **GAITS[gait]}, "controller": {"decoupler": decoupler}}
    flight = tiltsim.simulate(scenario(tables, engine="python", duration=0.1))
    in_python = dict(flight.columns)
    monkeypatch.setattr(tiltsim.engines.sample_evaluation, "MIN_ROWS_TO_COMPILE", 0)
    del flight.__dict__["columns"]
    for name, column in flight.columns.items():
        np.testing.assert_array_equal(column, in_python[name])


def test_references_of_the_law_with_gait_rates_are_the_same_floats_natively(monkeypatch):
    flight = tiltsim.simulate(scenario(LAWS["gait_feedforward"], engine="python", duration=0.1))
    in_python = dict(flight.columns)
    monkeypatch.setattr(tiltsim.engines.sample_evaluation, "MIN_ROWS_TO_COMPILE", 0)
    del flight.__dict__["columns"]
    for name, column in flight.columns.items():
        np.testing.assert_array_equal(column, in_python[name])


def test_columns_beside_a_state_out_of_all_bounds_raise_nothing():
    """A flight may be diverged between two samples by a hundred orders of magnitude."""
    flight = tiltsim.simulate(scenario(LAWS["gait_feedforward"], engine="python", duration=0.05))
    samples = flight.samples.copy()
    samples[-1, 3:] = 1e200  # squares overflow
    diverged = replace(flight, samples=samples, end=End("diverged", 0.05, "test"))
    columns = diverged.columns
    assert np.isfinite([columns[name][:-1] for name in ("roll_ref", "alpha_ref_1")]).all()
    assert diverged.metrics()["diverged"] is True


@traceable
def quotient(time, state, parameters, knots):
    return xp.array([state[0], time / state[0]])


def test_a_row_divides_by_zero_as_machine_code_does(monkeypatch):
    setup = assemble(scenario({})).setup
    samples = np.array([1.0, 2.0]), np.array([[0.0], [4.0]]), setup
    for rows_to_compile in (20_000, 0):
        name = "MIN_ROWS_TO_COMPILE"
        monkeypatch.setattr(tiltsim.engines.sample_evaluation, name, rows_to_compile)
        rows = tiltsim.engines.sample_evaluation.evaluate_over_samples(quotient, 2, *samples)
        np.testing.assert_array_equal(rows, [[0.0, np.inf], [4.0, 0.5]])


def test_a_flight_of_many_steps_is_compiled():
    chosen = [choose_engine(assemble(scenario({}, engine="auto", duration=d))) for d in (3.9, 4.0)]
    assert chosen == ["python", "native"]
    assert choose_engine(assemble(scenario({}, engine="python", duration=9.0))) == "python"


def test_flights_share_a_program_unless_they_differ_in_choices_or_knots():
    def key(**tables):
        return program_key(assemble(scenario(tables)))

    trot = {"type": "trot_continuous", "amplitude": 0.3, "period": 2.0}
    assert key(gait=trot) == key(gait={**trot, "amplitude": 0.4}, vehicle={"mass": 0.5})
    others = [
        key(gait={**trot, "type": "walk"}),
        key(gait=trot, controller={"decoupler": "exact"}),
        key(gait=trot, reference={"type": "circle", "radius": 1.0, "angular_frequency": 1.0}),
        key(),
    ]
    assert len({key(gait=trot), *others}) == 5
