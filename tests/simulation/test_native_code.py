"""Native code beside flights: sign checks, columns, names, announcements, choice of engine."""

from __future__ import annotations

import re
from dataclasses import replace
from inspect import unwrap

import numpy as np
import pytest

import tiltsim
import tiltsim.engines.sample_evaluation
from tests.laws.test_laws import LAWS
from tests.simulation.test_batch import ALL_LAWS, GAITS, scenario
from tiltsim.engines.native_engine import compile_control
from tiltsim.engines.native_stepper import compile_stepper
from tiltsim.equations.actuator_level import actuator_plant
from tiltsim.flight.end import End
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.laws.layers.actuation import with_actuation
from tiltsim.laws.layers.air import with_air
from tiltsim.laws.layers.on_equations import on_equations
from tiltsim.laws.layers.rotor_inertia import with_rotor_inertia
from tiltsim.laws.layers.supervision import with_supervisor
from tiltsim.plants.factory import make_plant


@pytest.mark.parametrize("law", LOOPS)
def test_every_sign_check_has_a_cause(law):
    plant, loop = make_plant(assemble(scenario(ALL_LAWS[law], engine="python"))), LOOPS[law]
    values = plant.observe()
    sample = dict(zip(loop.sample_fields, (plant.time, *values), strict=True))
    assembly = assemble(scenario(ALL_LAWS[law]))
    numbers = assembly.sign_check_values(plant.time, values)
    assert len(loop.monitoring.causes(sample, assembly.setup)) == len(numbers)
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


def test_a_row_without_a_result_is_no_number():
    setup = assemble(scenario({})).setup
    rows = tiltsim.engines.sample_evaluation.evaluate_over_samples(
        lambda time, state, _parameters, _table: (state[0], time / state[0]),
        *(2, np.array([1.0, 2.0]), np.array([[0.0], [4.0]]), setup),
    )
    np.testing.assert_array_equal(rows, [[np.nan, np.nan], [4.0, 0.5]])


def test_compilation_is_announced_unless_the_code_is_cached(monkeypatch, tmp_path):
    import tiltsim.engines.cache as cache

    monkeypatch.setattr(cache, "native_code_folder", lambda: tmp_path)
    announced = []
    monkeypatch.setattr(cache, "before_compiling", [announced.append])
    cache.announce_native_code("mujoco.some.law")
    assert announced == ["mujoco.some.law"]
    cache.mark_native_code_compiled("mujoco.some.law")
    cache.announce_native_code("mujoco.some.law")
    assert announced == ["mujoco.some.law"]


@pytest.mark.parametrize("plant", ["mujoco", "thesis", "rigid_body"])
def test_each_plant_announces_its_compilation(monkeypatch, tmp_path, plant):
    import tiltsim.engines.cache as cache

    class AnnouncedError(Exception):
        pass

    def stop(name):
        raise AnnouncedError(name)

    monkeypatch.setattr(cache, "native_code_folder", lambda: tmp_path)
    monkeypatch.setattr(cache, "before_compiling", [stop])
    loop = LOOPS["attitude_altitude"]
    compiling, more = compile_stepper, (plant, "ode3")
    if plant == "mujoco":
        compiling, more = compile_control, ()
    with pytest.raises(AnnouncedError, match=re.escape(loop.native_name(plant, *more[1:]))):
        unwrap(compiling)(loop, *more)


def test_all_that_processes_fly_with_is_compiled_for_them_once(monkeypatch):
    import tiltsim.simulation.shared_engine as shared_engine

    calls = []

    class Recorded:
        def __init__(self, assembly, engine):
            assert engine == "native"
            calls.append(assembly.scenario.simulation.plant)

        def record(self, samples, steps):
            calls.append("record")

    monkeypatch.setattr(shared_engine, "make_plant", Recorded)
    flights = [scenario({}, plant="thesis", duration=1.0) for _ in range(2)]
    assert shared_engine.shared_engine(flights, 99_999) is None
    assert shared_engine.shared_engine(flights, 100_000) == "native"
    assert calls == ["thesis", "record"]
    on_arrays = [flight.replace({"simulation.engine": "jax"}) for flight in flights]
    shared_engine.shared_engine(on_arrays, 100_000)
    assert len(calls) == 2


def test_only_loops_that_fly_long_are_compiled_together(monkeypatch, tmp_path):
    import tiltsim.engines.cache as cache
    import tiltsim.simulation.shared_engine as shared_engine

    compiled = []

    def in_processes(work, groups, jobs):
        compiled.append(([[_plant_and_law(one) for one in group] for group in groups], jobs))
        return iter(())

    def _plant_and_law(one):
        return one.simulation.plant, one.controller.law

    monkeypatch.setattr(cache, "native_code_folder", lambda: tmp_path)
    monkeypatch.setattr(shared_engine, "in_processes", in_processes)
    long = [scenario({}, engine="auto", plant=p, duration=45.0) for p in ("thesis", "mujoco")]
    two = [scenario(ALL_LAWS["full_pose"], engine="auto", duration=d) for d in (7.0, 7.999)]
    names = shared_engine.compile_together([*long, *two], 2)
    assert names == {loop_of(one).native_name(one.simulation.plant) for one in long}
    assert compiled == [([[("thesis", "attitude_altitude"), ("mujoco", "attitude_altitude")]], 2)]
    flown = [shared_engine.with_compiled(one, names).simulation.engine for one in (*long, *two)]
    assert flown == ["native", "native", "auto", "auto"]

    third = scenario(ALL_LAWS["full_pose"], engine="auto", duration=0.001)
    assert len(shared_engine.compile_together([*long, *two, third], 2)) == 3
    assert shared_engine.compile_together([long[0], *two], 2) == frozenset()  # 60,000 steps
    compiled.clear()
    assert shared_engine.compile_together([*long, *two], 1) == names
    cache.mark_native_code_compiled(loop_of(long[0]).native_name("thesis"))
    cache.mark_native_code_compiled(loop_of(long[1]).native_name("mujoco"))
    shared_engine.compile_together([*long, *two], 2)
    assert [groups for groups, _ in compiled] == [[]]
    cache.mark_native_code_compiled(loop_of(two[0]).native_name("mujoco"))
    assert len(shared_engine.compile_together([*long, *two], 2)) == 3


def test_whether_native_code_is_cached_is_known_by_law_and_plant(monkeypatch, tmp_path):
    import tiltsim.engines.cache as cache
    from tiltsim.plants.engine_choice import choose_engine

    monkeypatch.setattr(cache, "native_code_folder", lambda: tmp_path)
    flown = scenario({}, engine="auto", duration=20.0)  # 20,000 steps: worth loading only
    assert choose_engine(flown, loop_of(flown)) == "python"
    cache.mark_native_code_compiled(LOOPS["full_pose"].native_name("mujoco"))
    cache.mark_native_code_compiled(LOOPS["attitude_altitude"].native_name("thesis"))
    assert choose_engine(flown, loop_of(flown)) == "python"
    cache.mark_native_code_compiled(LOOPS["attitude_altitude"].native_name("mujoco"))
    assert choose_engine(flown, loop_of(flown)) == "native"


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_no_two_control_steps_share_a_name_of_native_code(plant):
    """Else an automatic engine takes one law for compiled where another is."""
    tilting = [LOOPS["attitude_altitude"], LOOPS["gait_feedforward"]]
    laws = [*LOOPS.values(), *(with_supervisor(loop, "hold") for loop in tilting)]
    tiltrotors = [loop for loop in laws if loop.dynamics.model == "tiltrotor"]
    real = [with_actuation(loop, steps) for loop in tiltrotors for steps in (0, 2)]
    aired = [with_air(loop) for loop in [*laws, *real] if loop.dynamics.model != "tilt_car"]
    spinning = [with_rotor_inertia(loop) for loop in [*tiltrotors, *real]]
    loops = [*laws, *real, *aired, *spinning]
    if plant == "thesis":
        moved = [loop for loop in loops[len(LOOPS) :] if loop.equations is None]
        loops = [
            *laws[: len(LOOPS)],
            *spinning[: len(tiltrotors) - 2],
            *(on_equations(loop, actuator_plant(loop.dynamics)) for loop in moved),
        ]
    names = [loop.native_name(plant) for loop in loops]
    assert len(set(names)) == len(names) == len(loops) > 30
