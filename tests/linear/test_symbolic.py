"""A scenario as CasADi functions."""

from __future__ import annotations

import runpy
from math import sin, sqrt
from pathlib import Path

import numpy as np
import pytest

import tiltsim
from tests.arrays.flown_scenarios import MULTIROTORS
from tests.laws.test_laws import LAWS
from tests.laws.test_multirotor import document
from tests.simulation.test_batch import EXACT, GAITS
from tiltsim.errors import InputError, TiltsimError
from tiltsim.laws.assembling import assemble
from tiltsim.plants.plant import EquationsPlant
from tiltsim.scenario.loading import merge
from tiltsim_controllers.vehicle.parameters import PRESETS

casadi = pytest.importorskip("casadi")

THESIS = {"simulation": {"plant": "thesis", "duration": 0.1}}
LOOPS = LAWS | {
    f"gait {name}": {"gait": {"type": name, **table}, "controller": EXACT}
    for name, table in GAITS.items()
}
LOOPS["multirotor"] = MULTIROTORS["tilting"]
LOOPS["rigid body"] = {**LAWS["attitude_altitude"], "simulation": {"plant": "rigid_body"}}


@pytest.mark.parametrize("name", LOOPS)
def test_symbolic_closed_loops_agree_with_python(name):
    scenario = tiltsim.parse_scenario(merge(THESIS, LOOPS[name]))
    model, assembly = tiltsim.symbolic(scenario), assemble(scenario)
    equations, (parameters, knots) = assembly.loop.equations, assembly.setup
    state = np.array(model.initial) + 0.01
    arguments = 0.037, state.tolist(), parameters, knots
    inputs = equations.inputs(*arguments)
    rates = equations.rates(0.037, state.tolist(), inputs, parameters, knots, (0.0, 0.0, 0.0))
    for function, expected, given in (
        (model.controller, inputs, {}),
        (model.closed_loop, rates, {}),
        (model.dynamics, rates, {"inputs": inputs}),
    ):
        (result,) = function(time=0.037, state=state, **given).values()
        size = np.abs(expected).max()
        np.testing.assert_allclose(result.full().ravel(), expected, rtol=1e-12, atol=1e-12 * size)
    sample = equations.observe(0.037, state.tolist(), inputs, parameters, knots)
    np.testing.assert_allclose(
        model.sample(0.037, state).full().ravel(), sample, rtol=1e-12, atol=1e-12
    )
    assert len(model.fields) == len(sample)
    assert len({*model.states}) == len(model.initial)
    assert len(model.inputs) == len(inputs)


BRIEF = {"simulation": {"plant": "thesis", "engine": "python", "duration": 0.03}}
WITH_MARGIN = {name: LOOPS[name] for name in ("full_pose", "gait walk", "multirotor", "rigid body")}
WITH_MARGIN["quadrotor"] = LAWS["yaw_position"]
WITH_MARGIN["leaning"] = merge(MULTIROTORS["leaning"], {"initial": {"attitude": [0.3, 0.2, 0]}})
WITH_MARGIN["omni"] = MULTIROTORS["turning over"]


@pytest.mark.parametrize("name", WITH_MARGIN)
def test_the_margin_is_the_column_of_the_flight(name):
    scenario = tiltsim.parse_scenario(merge(BRIEF, WITH_MARGIN[name]))
    model, flight = tiltsim.symbolic(scenario), tiltsim.simulate(scenario)
    plant, found = EquationsPlant(assemble(scenario), "python"), []
    times = flight["time"][:4]
    for time in times:
        plant.advance(round((time - plant.time) / scenario.simulation.timestep))
        state, held = np.split(plant.state[1:], [len(model.initial)])
        found.append([float(f(time, state, held)[0]) for f in (model.margin, model.signs)])
    margins, determinants = np.array(found).T
    logged = flight["singularity_margin"][:4]
    np.testing.assert_allclose(np.sin(margins), np.sin(logged), rtol=0.0, atol=1e-12)
    # Near a right angle the arc sine turns a rounding of 1e-16 into 1e-8 rad.
    assert np.abs(margins - logged)[logged < 1.57].max(initial=0.0) < 1e-9
    if name in ("gait walk", "rigid body"):
        np.testing.assert_allclose(determinants, flight["determinant"][:4], rtol=0.0, atol=1e-9)


def test_only_vehicles_with_a_margin_have_one():
    for tables in (
        LOOPS["tilt_car_planned_direction"],
        document("tricopter", controller={"law": "geometric", "tilts": "free"}),
    ):
        assert tiltsim.symbolic(merge(tables, THESIS)).margin is None


def test_names_say_where_states_and_inputs_are():
    model = tiltsim.symbolic({**THESIS, "controller": EXACT})
    state = np.array(model.initial)
    assert (
        state[model.states.index("rotor_speed_2")]
        == model.sample(0.0, state)[model.fields.index("rotor_speed_2")]
    )
    push = np.zeros(len(model.inputs))
    push[model.inputs.index("rotor_acceleration_2")] = 7.0
    rates = model.dynamics(0.0, state, push).full().ravel()
    assert rates[model.states.index("rotor_speed_2")] == 7.0


def test_the_symbolic_jacobian_has_the_poles_of_the_gains():
    """A hover with exact decoupling is linear, with the poles of its gains."""
    model = tiltsim.symbolic({**THESIS, "controller": {**EXACT, "decoupler": "none"},
        "reference": {"type": "attitude_altitude"},
        "initial": {"rotor_speed": PRESETS["ar_drone_2"].hover_rotor_speed}})  # fmt: skip
    state = casadi.SX.sym("state", len(model.initial))
    jacobian = casadi.Function(
        "jacobian", [state], [casadi.jacobian(model.closed_loop(0.0, state), state)]
    )
    poles = np.linalg.eigvals(jacobian(model.initial).full())
    for pole in np.roots([1.0, 40.0, 600.0, 4000.0]):
        assert np.abs(poles - pole).min() < 1e-3


def test_scenarios_without_a_symbolic_form_are_refused():
    with pytest.raises(InputError, match='plant = "mujoco": symbolic supports "thesis" and'):
        tiltsim.symbolic({})
    noisy = {**THESIS, "sensors": {"position_noise": 0.1}}
    with pytest.raises(TiltsimError, match=r"random numbers have no symbolic form"):
        tiltsim.symbolic(noisy)


@pytest.mark.slow
def test_the_optimal_manoeuvre_of_the_example_holds_in_mujoco():
    example = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "fastest_sidestep.py"))
    plan = example["fastest"](tiltsim.symbolic(example["SCENARIO"]), True, 20)
    vehicle = PRESETS["ar_drone_2"]
    # Level, two of four rotors push along x: no plan is faster than they at full tilt.
    push = 2.0 * vehicle.thrust_coefficient * 500.0**2 * sin(0.8) / vehicle.mass
    assert 2.0 * sqrt(3.0 / push) < plan.times[-1] < 1.6
    assert np.abs(plan.states[:, 12:14]).max() < 0.011
    assert example["deviation"](plan, example["fly"](plan)) < 0.02
