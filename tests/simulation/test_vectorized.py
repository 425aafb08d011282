"""A scenario as pure functions: values and gradients."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.arrays.flown_scenarios import MULTIROTORS
from tests.laws.test_baselines import BASELINES
from tests.laws.test_laws import LAWS
from tiltsim.arrays.flying import double_precision
from tiltsim.errors import InputError
from tiltsim.laws.assembling import loop_of
from tiltsim.scenario.loading import merge
from tiltsim.scenario.scenario import plan_flight
from tiltsim.simulation.vectorized import ArrayPlan

jax = pytest.importorskip("jax")

THESIS = {"simulation": {"plant": "thesis", "duration": 0.02}}
PERTURBED = {"initial": {"attitude": [0.05, -0.04, 0.03], "velocity": [0.1, 0.2, -0.1]}}


@pytest.fixture(autouse=True)
def _double_precision():
    with double_precision():
        yield


@pytest.mark.slow
def test_the_flight_agrees_with_the_engine_and_consists_of_steps():
    scenario = tiltsim.parse_scenario({**LAWS["tilt_car_planned_direction"], **THESIS})
    flown = tiltsim.vectorized(scenario)
    changes = {"vehicle": {"mass": 1.1}, "gait": {"period": 0.45}}
    quickly = {"xla_backend_optimization_level": 0}
    samples = jax.jit(flown.fly, compiler_options=quickly)(changes)
    flight = tiltsim.simulate(
        scenario.replace({"vehicle.mass": 1.1, "gait.period": 0.45, "simulation.engine": "python"})
    )
    for name in ("time", "x", "y", "rotor_speed_1"):
        np.testing.assert_allclose(samples[name], flight[name], rtol=1e-12, atol=1e-12)
    step = jax.jit(flown.step, compiler_options=quickly)
    state = flown.initial(changes)
    for _ in range(10):
        state = step(state, changes)
    assert flown.observe(state, changes)["x"] == pytest.approx(flight["x"][1], abs=1e-12)
    assert {"position", "velocity", "attitude"} <= set(flown.parameters["initial"])


def test_parameters_are_the_numbers_that_a_flight_depends_on():
    flown = tiltsim.vectorized(tiltsim.parse_scenario({**LAWS["attitude_altitude"], **THESIS}))
    assert flown.parameters["vehicle"]["mass"] == 0.429
    assert flown.parameters["controller"]["gains"]["altitude"] == (10.0, 15.0, 10.0)
    assert flown.parameters["gait"] == {"scale": 1.0, "bias": 1.0, "amplitude": 0.4, "period": 1.0}
    with pytest.raises(InputError, match=r"parameters.air: no parameter of this scenario; choose"):
        flown.fly({"air": {"density": 1.0}})


def test_a_parameter_may_vary_unless_its_plan_needs_it_as_a_number():
    tables = {
        "gait": {"type": "walk", "amplitude": 0.1, "period": 0.8},
        "reference": {"type": "waypoints", "positions": [[0, 0, 0], [1, 0, 0]], "times": [0, 2]},
    }
    parameters = tiltsim.vectorized(tiltsim.parse_scenario({**tables, **THESIS})).parameters
    assert set(parameters["gait"]) == {"scale", "bias", "amplitude", "lean", "period"}
    assert set(parameters["reference"]) == {"roll", "pitch", "yaw", "positions"}  # but not times


def test_knots_of_other_points_come_from_the_plan_of_each():
    changes = {
        "gait": {"rectangle": [[-0.3, -0.1], [0.1, 0.25]], "period": 3.0},
        "reference": {"positions": [[0.1, 0.0, 0.0], [1.2, 0.3, -0.1], [2.0, 0.0, 1.0]]},
    }
    tables = {
        "gait": {"type": "two_color", "rectangle": [[-0.2, 0.0], [0.1, 0.3]], "period": 4.0},
        "reference": {"type": "waypoints", "positions": [[0, 0, 0]] * 3, "times": [0, 2, 5]},
    }
    scenario = tiltsim.parse_scenario({**tables, **THESIS})
    plan = ArrayPlan(scenario, loop_of(scenario), "float64")
    knots = jax.jit(lambda tree: plan(tree).knots)(changes)
    expected = plan_flight(tiltsim.parse_scenario(merge({**tables, **THESIS}, changes)))
    np.testing.assert_allclose(knots, expected.knots, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("name", ["tilting hexarotor", "lqr"])
def test_numbers_that_numpy_plans_with_are_fixed_and_the_others_vary(name):
    tables = BASELINES["lqr"] if name == "lqr" else MULTIROTORS["tilting"]
    parameters = tiltsim.vectorized(tiltsim.parse_scenario({**tables, **THESIS})).parameters
    assert {"initial", "reference"} <= set(parameters)
    assert not {"vehicle", "gait"} & set(parameters)  # gains, and the directions of the forces


def test_a_gait_has_derivatives_by_its_scale_and_bias_where_they_are_one():
    tables = {"gait": {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0}}
    flown = tiltsim.vectorized(tiltsim.parse_scenario({**tables, **THESIS}))

    def alpha_3(gait):
        return flown.observe(flown.initial({"gait": gait}), {"gait": gait})["alpha_3"]

    slopes = jax.jit(jax.jacfwd(alpha_3))({"scale": 1.0, "bias": 1.0})
    assert slopes == {"scale": pytest.approx(0.4), "bias": pytest.approx(0.4)}


def test_numbers_of_a_rigid_body_are_parameters():
    rigid = {"simulation": {"plant": "rigid_body"}, "controller": {"law": "yaw_position"}}
    tables = {**rigid, "vehicle": {"model": "quadrotor"}}
    flown = tiltsim.vectorized(tiltsim.parse_scenario(tables))
    needed = {"mass", "inertia", "arm_length", "thrust_coefficient", "drag_coefficient"}
    assert needed < set(flown.parameters["vehicle"])


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        (5, "parameters = 5: must be a dict"),
        (None, "parameters = None: must be a dict"),
        ({"gait": 5}, "parameters.gait = 5: must be a dict"),
        ({"gait": {"period": 0.0}}, "parameters: period = 0.0: must be positive and finite"),
        ({"gait": {"period": float("nan")}}, "parameters: period = nan: must be positive"),
    ],
)
def test_invalid_trees_of_numbers_are_refused(tree, words):
    with double_precision():
        flown = tiltsim.vectorized(tiltsim.parse_scenario({**LAWS["attitude_altitude"], **THESIS}))
        with pytest.raises(InputError, match=words):
            flown.fly(tree)


def test_a_vectorized_flight_needs_equations():
    with pytest.raises(InputError, match=r'plant = "mujoco".*vectorized supports "thesis" and'):
        tiltsim.vectorized({})


def flat(tree, keys):
    """Some numbers of a tree by (path, index)."""
    found = []
    for path, index in keys:
        value = tree
        for name in path.split("."):
            value = value[name]
        found.append(value if index is None else np.asarray(value)[index])
    return np.array(found, dtype=float)


def replaced(tree, keys, values):
    changed = jax.tree.map(lambda value: value, tree)
    for (path, index), value in zip(keys, values):
        *tables, name = path.split(".")
        table = changed
        for each in tables:
            table = table[each]
        if index is None:
            table[name] = value
        else:
            array = jax.numpy.asarray(table[name], float).at[index].set(value)
            table[name] = (
                jax.tree.map(lambda v: v, tuple(array))
                if array.ndim == 1
                else tuple(tuple(row) for row in array)
            )
    return changed


BODY = [("vehicle.mass", None), ("vehicle.inertia", 0), ("vehicle.gravity", None)]
GRADIENTS = {
    "attitude_altitude": [
        *BODY,
        ("vehicle.arm_length", None),
        ("gait.amplitude", None),
        ("gait.period", None),
        ("controller.gains.attitude", (1, 0)),
        ("controller.gains.attitude", (2, 1)),
        ("controller.gains.altitude", 0),
        ("initial.attitude", 1),
    ],
    "yaw_position": [
        *BODY,
        ("vehicle.inertia", 1),
        ("vehicle.inertia", 2),
        ("initial.attitude", 0),
        ("initial.attitude", 1),
        ("initial.angular_velocity", 2),
        ("reference.radius", None),
        ("reference.angular_frequency", None),
    ],
    "tilt_car_third_derivative": [
        ("vehicle.mass", None),
        ("vehicle.top_inertia", None),
        ("vehicle.bottom_inertia", None),
        ("vehicle.half_angle", None),
        ("vehicle.thrust_coefficient", None),
        ("controller.restoring_rate", None),
        ("initial.rotor_speed", 0),
        ("initial.attitude", 2),
        ("reference.radius", None),
        ("reference.angular_frequency", None),
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("law", GRADIENTS)
def test_gradients_agree_with_central_differences(law):
    keys = GRADIENTS[law]
    tables = {**LAWS[law], "simulation": {"plant": "thesis", "control_timestep": 0.002}}
    if "car" not in law:
        tables = merge(tables, PERTURBED)
    flown = tiltsim.vectorized(tiltsim.parse_scenario(tables))
    base = flat(flown.parameters, keys)

    def cost(factors):
        parameters = replaced(flown.parameters, keys, base * factors)
        step = lambda now, _: (flown.step(now, parameters), None)  # noqa: E731
        last, _ = jax.lax.scan(step, flown.initial(parameters), length=20)
        return sum((value - 0.3) ** 2 for value in last.state[:12])

    # Forward mode; and steps of a held controller have its code once, a whole flight five times.
    quickly = {"xla_backend_optimization_level": 0}  # compiled in two thirds of the time
    slope = jax.jit(lambda f, along: jax.jvp(cost, (f,), (along,)), compiler_options=quickly)
    ones, h = np.ones(len(keys)), 3e-4
    for key, along in zip(keys, np.eye(len(keys)), strict=True):
        _, exact = slope(ones, along)
        # With five points: errors of h**4 and of rounding / h, both about 1e-12 of the cost.
        points = [ones + k * h * along for k in (-2, -1, 1, 2)]
        far_below, below, above, far_above = (float(slope(p, along)[0]) for p in points)
        difference = (8.0 * (above - below) - (far_above - far_below)) / (12.0 * h)
        assert exact == pytest.approx(difference, rel=1e-6, abs=1e-11), key
        assert exact != 0.0
