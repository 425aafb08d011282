"""Flights in JAX agree with the other engines."""

import sys
from itertools import cycle

import numpy as np
import pytest

import tiltsim
from tests.arrays.flown_scenarios import LAYERED, MULTIROTORS, REFERENCES, SUPERVISED
from tests.laws.test_baselines import BASELINES
from tests.laws.test_laws import GUST, LAWS
from tests.laws.test_multirotor import TILTS, document
from tests.simulation.test_batch import CAR, CAR_GAITS, EXACT, GAITS
from tiltsim.arrays.flying import Kernel, course_of, double_precision
from tiltsim.equations.solvers import Integration, make_step
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import merge

needs_jax = pytest.mark.skipif(
    "not __import__('importlib').util.find_spec('jax')", reason="JAX is not installed"
)
EVERY = {
    **{law: {**tables, "disturbance": GUST} for law, tables in LAWS.items()},
    **{f"gait {n}": {**CAR, "gait": {"type": n, **t}} for n, t in CAR_GAITS.items()},
    **{
        f"gait {gait}, reference {reference}": {
            "gait": {"type": gait, **GAITS[gait]},
            "reference": {"type": reference, **REFERENCES[reference]},
            "controller": {**EXACT, "decoupler": "none" if "altitude" in reference else "exact"},
        }
        for gait, reference in zip(GAITS, cycle(REFERENCES))
    },
    **{f"supervisor {n}": tables for n, tables in SUPERVISED.items()},
    **BASELINES,
    **LAYERED,
    **{f"multirotor {n}": tables for n, tables in MULTIROTORS.items()},
}
"""Every controller, gait, reference and layer."""

ON_RIGID_BODY = {
    "everything attitude_altitude": EVERY["everything attitude_altitude"],
    "multirotor": document(
        "tilt_hexarotor", {"max_rotor_speed": 800.0, "rotor_time_constant": 0.02}, gait=TILTS
    ),
}
"""Some for its plant: all layers, another layout."""


def fly(tables, engine, **simulation):
    simulation = {"plant": "thesis", "duration": 0.3, "engine": engine, **simulation}
    return tiltsim.simulate(tiltsim.parse_scenario({**tables, "simulation": simulation}))


def largest_difference(tables, **simulation):
    """The largest difference of any sample from Python's, relative to one."""
    flown, python = (fly(tables, engine, **simulation) for engine in ("jax", "python"))
    assert flown.engine == "jax"
    assert flown.end == python.end
    scale = np.maximum(1.0, np.abs(python.samples))
    return np.max(np.abs(flown.samples - python.samples) / scale)


@needs_jax
def test_a_flight_in_jax_is_the_one_in_python():
    tables = {**LAWS["tilt_car_planned_direction"], "disturbance": GUST}
    assert largest_difference(tables, control_timestep=0.004) < 1e-12


@needs_jax
@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_steps_of_whatever_flies_on_the_equations_are_those_in_python(name):
    compare_steps({**EVERY[name], "simulation": {"plant": "thesis", "duration": 0.3}})


@needs_jax
@pytest.mark.slow
@pytest.mark.parametrize("name", ON_RIGID_BODY)
def test_steps_of_the_rigid_body_are_those_in_python(name):
    compare_steps(merge(ON_RIGID_BODY[name], {"simulation": {"plant": "rigid_body"}}))


def compare_steps(tables):
    """The second step in Python, and of the operations, which XLA would take long to compile."""
    import jax

    assembly = assemble(tiltsim.parse_scenario(tables))
    equations, disturbance = assembly.loop.equations, assembly.scenario.disturbance_acceleration
    simulation = assembly.scenario.simulation
    timing = simulation.timestep, simulation.control_steps
    integration = Integration(*timing, *assembly.setup, disturbance)
    step, held = make_step(equations, simulation.solver), (0.0,) * equations.inputs_size
    start = [float(value) for value in equations.initial(assembly, assembly.setup)]
    start, held = step(0.0, start, held, True, integration)
    with double_precision():
        kernel = Kernel(course_of(assembly), assembly.setup, disturbance)
        carried, shape = jax.tree.flatten(kernel.at(1, start, held))
        program = jax.make_jaxpr(kernel.step)(jax.tree.unflatten(shape, carried))
        state = np.array(jax.tree.unflatten(shape, results(program, carried)).state)
    samples = simulation.control_steps in (0, 1)
    python, _ = step(simulation.timestep, start, held, samples, integration)
    scale = np.maximum(1.0, np.abs(python))
    np.testing.assert_array_less(np.abs(state - python) / scale, 1e-11)


def results(program, values):
    """Results of a program's operations in JAX, one after the other."""
    from jax.extend.core import Literal

    known = dict(zip(program.jaxpr.constvars, program.consts))
    known |= zip(program.jaxpr.invars, values)

    def value(atom):
        return atom.val if isinstance(atom, Literal) else known[atom]

    for step in program.eqns:
        made = [value(atom) for atom in step.invars]
        if step.primitive.name in ("jit", "pjit"):  # by the version of JAX
            made = results(step.params["jaxpr"], made)
        else:
            made = step.primitive.bind(*made, **step.params)
            made = made if step.primitive.multiple_results else [made]
        known |= zip(step.outvars, made)
    return [value(atom) for atom in program.jaxpr.outvars]


@needs_jax
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "timing"),
    [("switching", {}), ("heavy attitude_altitude", {"control_timestep": 0.004})],
    ids=["continuous", "held"],
)
def test_compiled_flights_are_those_in_python(name, timing):
    """Only few: XLA takes seconds to compile a flight."""
    assert largest_difference(EVERY[name], **timing) < 1e-9


@needs_jax
@pytest.mark.slow
def test_a_flight_of_20_s_differs_by_less_than_a_nanometer_from_the_native_one():
    changes = {"expect": [], "simulation.plant": "thesis", "simulation.duration": 20.0}
    scenario = tiltsim.load_scenario("ch04_tracking/circle#continuous_t2_modified", changes)
    flown, native = (
        tiltsim.simulate(scenario.replace({"simulation.engine": engine}))
        for engine in ("jax", "native")
    )
    assert len(flown) == len(native)
    for axis in "xyz":
        np.testing.assert_allclose(flown[axis], native[axis], rtol=0, atol=1e-9)


def test_the_jax_engine_needs_the_thesis_plant():
    with pytest.raises(InputError, match=r'simulation.plant = "mujoco": simulation.engine = "jax"'):
        tiltsim.parse_scenario({"simulation": {"engine": "jax"}})


def test_single_precision_is_for_the_jax_engine():
    with pytest.raises(InputError, match=r'precision = "float32": needs simulation.engine = "jax"'):
        tiltsim.parse_scenario({"simulation": {"precision": "float32"}})


def test_without_jax_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(InputError, match=r"needs jax.*pip install 'tiltsim\[jax\]'"):
        fly({}, "jax")
