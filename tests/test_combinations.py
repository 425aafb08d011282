"""Every law with every vehicle, table of the scenario, plant and use: it works, or in one line not.

Nobody lists combinations here: laws, vehicles, tables with their examples, plants, engines and the
public interface are the product's own registries. An addition to them is tested with the rest.
"""

from __future__ import annotations

import tomllib
from functools import cache
from itertools import product
from types import FunctionType
from typing import get_args

import numpy as np
import pytest
from pydantic import TypeAdapter

import tiltsim
import tiltsim.env
from tiltsim.commands.files import scenario_schema
from tiltsim.commands.key_tables import key_tables
from tiltsim.errors import TiltsimError
from tiltsim.scenario.controller import CONTROLLERS, OwnFunctionController
from tiltsim.scenario.documents import leaves
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.scenario.simulation_table import SimulationTable
from tiltsim.scenario.vehicle import VehicleUnion
from tiltsim.studies.multirotor_analysis import FLEET, fleet_file
from tiltsim.views.figures import layout
from tiltsim.views.figures.style import save
from tiltsim.views.rerun.recording import save_recording
from tiltsim.views.video.offscreen import Overlay

SHORT = {"duration": 0.02, "timestep": 0.002, "engine": "python"}
TABLES = key_tables(scenario_schema())
PLANTS, ENGINES = (
    get_args(SimulationTable.model_fields[key].annotation) for key in ("plant", "engine")
)
MODELS = dict.fromkeys(model for table in CONTROLLERS.values() for model in table.vehicle_models)
SHIPPED = {model: {"model": model} for model in MODELS if model != "multirotor"}
MULTIROTORS = {
    f"multirotor {name}": {"model": "multirotor", "mjcf": str(fleet_file(name))} for name in FLEET
}
VEHICLES = SHIPPED | MULTIROTORS
FEW = [*SHIPPED, "multirotor tilt_hexarotor"]
"""All models, and of multirotors one with tilts."""


@pytest.fixture(autouse=True)
def strict(monkeypatch):
    """Let Rerun raise where it would only warn."""
    monkeypatch.setenv("RERUN_STRICT", "1")


def attempt(use, *arguments):
    """The result of a use and no line, or nothing and the line of its refusal; else it raises."""
    try:
        return use(*arguments), ""
    except TiltsimError as error:
        line = str(error)
        assert len(line.splitlines()) == 1, line
        assert 10 < len(line) < 600, line
        return None, line


# --- laws and vehicles -------------------------------------------------------------------------

OWN = {
    "python": "def law(seen):\n"
    "    return tiltsim.Command(rotor_accelerations=[0.0] * len(seen.rotor_speeds))\n",
    "numpy": "@tiltsim.law\ndef law(seen):\n    return tiltsim.Command(thrusts=[{thrusts}])\n",
}
"""Functions of the user's, by the law that they fly with."""


@pytest.fixture(scope="session", autouse=True)
def own_laws(tmp_path_factory):
    """Write these, for every number of rotors, where `fitting` finds them."""
    folder = tmp_path_factory.mktemp("own")
    for (law, text), rotors in product(OWN.items(), range(2, 17)):
        code = "import tiltsim\n\n\n" + text.format(thrusts="1.0, " * rotors)
        (folder / f"{law}_{rotors}.py").write_text(code)
    FOLDER.append(folder)


FOLDER = []


def kinds(name):
    """A document for each kind of a table that has several, such as gait, after none at all."""
    of_table = [table for table in TABLES if [step.name for step in table.places[0]] == [name]]
    return [{}, *(tomllib.loads(table.toml) for table in of_table)]


def trusted(tables):
    """A scenario that may execute the code that it names."""
    return tiltsim.load_scenario(tables, trusted=True)


@cache
def fitting(law, vehicle):
    """A scenario of a law and vehicle, with the first gait and reference that suit; or a line.

    A law that does not claim the vehicle is tried with all references alone.
    """
    model, why = VEHICLES[vehicle], []
    controller = {"law": law}
    if issubclass(CONTROLLERS[law], OwnFunctionController):
        rotors = TypeAdapter(VehicleUnion).validate_python(model).rotor_count
        controller["function"] = f"{FOLDER[0] / law}_{rotors}.py:law"
    tables = {"vehicle": model, "controller": controller, "simulation": SHORT}
    claimed = model["model"] in CONTROLLERS[law].vehicle_models
    for reference, gait in product(kinds("reference"), kinds("gait") if claimed else [{}]):
        scenario, line = attempt(trusted, tables | reference | gait)
        if scenario:
            return scenario
        why.append(line)
    return why[0]


def fits(law, vehicle):
    """Whether a law flies a vehicle."""
    return not isinstance(fitting(law, vehicle), str)


@cache
def flown(law, vehicle):
    """The flight of `fitting`."""
    return tiltsim.simulate(fitting(law, vehicle))


def claimed(vehicles):
    """Laws with the vehicles whose model they claim to control."""
    return [
        (law, vehicle)
        for law, vehicle in product(CONTROLLERS, vehicles)
        if VEHICLES[vehicle]["model"] in CONTROLLERS[law].vehicle_models
    ]


def in_turn(pairs):
    """Pairs with a plant each, in turn."""
    return [(*pair, PLANTS[place % len(PLANTS)]) for place, pair in enumerate(pairs)]


def one_of_each(groups):
    """One pair of each group: the first of the first, the second of the next, and so on."""
    return [group[place % len(group)] for place, group in enumerate(groups)]


FITTING = claimed(FEW)
EACH_LAW = one_of_each([pair for pair in FITTING if pair[0] == law] for law in dict(FITTING))
OTHERS = [vehicle for vehicle in VEHICLES if vehicle not in FEW]
DRAWN = FITTING + one_of_each(claimed([vehicle]) for vehicle in OTHERS)
"""All models with every law, and each other vehicle with one law."""

RENDERED = EACH_LAW + DRAWN[len(FITTING) :]
"""Each law and each other vehicle once."""

LAW_OF_VIDEO = {vehicle: law for law, vehicle in RENDERED}

LAID_OUT = {vehicle: law for law, vehicle in reversed(EACH_LAW)}
"""A law of each vehicle, whose flight alone is laid out, which takes long: of all laws, flights in
the same axes have all panels, and `test_every_flight_can_be_rendered` lays out one alone."""

PAIRS = [pytest.param(*pair, marks=[] if pair in EACH_LAW else pytest.mark.slow) for pair in DRAWN]
each_pair = pytest.mark.parametrize(("law", "vehicle"), PAIRS)


def test_every_law_flies_all_that_it_claims_and_nothing_else():
    assert {law for law in CONTROLLERS if law in OWN} == {
        law for law, table in CONTROLLERS.items() if issubclass(table, OwnFunctionController)
    }
    for law, vehicle in product(CONTROLLERS, SHIPPED):
        assert fits(law, vehicle) == (vehicle in CONTROLLERS[law].vehicle_models), (law, vehicle)
    for law, table in CONTROLLERS.items():
        several = "multirotor" in table.vehicle_models
        assert any(fits(law, vehicle) for vehicle in MULTIROTORS) == several, law


# --- uses of a flight and of a scenario --------------------------------------------------------


def of_file(flight, folder):
    """Save and load: the same columns, bit for bit, and the same metrics but for the speed."""
    flight.save(folder)
    loaded = tiltsim.load_flight(folder)
    assert list(loaded) == list(flight)
    for column in flight:
        np.testing.assert_array_equal(loaded[column], flight[column])
    assert loaded.metrics().keys() == flight.metrics().keys()


def paint(flight, _folder):
    """Text and inset of a frame of a video, whose rendering takes long."""
    overlay = Overlay(flight, 90)
    assert overlay.rows(0)
    overlay.paint(np.zeros((90, 160, 3), dtype=np.uint8), 0)


def through_a_log(flight, folder):
    """Write a flight as logs and read them."""
    for suffix in ("mcap", "ulg"):
        tiltsim.export(flight, folder / f"flight.{suffix}")
        assert len(tiltsim.read_log(folder / f"flight.{suffix}")) == len(flight)


USES_OF_FLIGHTS = {
    "plot": lambda flight, _folder: tiltsim.plot(flight),
    "several": lambda flight, _folder: tiltsim.plot([flight] * 2, labels=["a", "b"]),
    "view": lambda flight, folder: save_recording([flight], folder / "flight.rrd"),
    "video": paint,
    "metrics": lambda flight, _folder: flight.metrics(),
    "_repr_html_": lambda flight, _folder: flight._repr_html_(),
    "to_pandas": lambda flight, _folder: flight.to_pandas(),
    "to_arrow": lambda flight, _folder: flight.to_arrow(),
    "to_csv": lambda flight, folder: flight.to_csv(folder / "flight.csv"),
    "origin": lambda flight, _folder: flight.origin(),
    "save": of_file,
}
SLOW_USES_OF_FLIGHTS = {
    "plot": lambda flight, folder: save(tiltsim.plot(flight), folder / "flight.png"),
    "video": lambda flight, folder: flight.video(folder / "flight.mp4", quality="draft"),
}


def step(scenario):
    """Fly half of it, step by step."""
    simulation = tiltsim.Simulation(scenario)
    while simulation.time < 0.5 * SHORT["duration"]:
        simulation.step()


def learn(scenario):
    """One step of an environment."""
    env = tiltsim.env.TiltrotorEnv(scenario)
    env.reset()
    action = env.action_spec()
    env.step(0.5 * (action.minimum + action.maximum))
    env.flight().metrics()


def learn_on_arrays(scenario):
    """The flight on arrays, without compiling it."""
    jax = pytest.importorskip("jax")
    changed = scenario.replace({"simulation.integrator": "implicitfast"})
    env = tiltsim.env.TiltrotorEnv(changed)
    functions = tiltsim.env.EnvFunctions(env.task)
    episode, _ = jax.eval_shape(functions.reset, functions.draw([env.generator])[0])
    jax.eval_shape(functions.step, episode, np.zeros(env.action_spec().shape))


def sweep(scenario):
    """Two points along an axis."""
    axis = {"type": "list", "key": "initial.position[0]", "values": [0.0, 0.1]}
    tiltsim.sweep({"scenario": scenario, "axis": [axis]}, trusted=True)


def on_arrays(scenario):
    """Lift all code onto arrays, without compiling it."""
    from tiltsim.arrays.flying import double_precision

    jax = pytest.importorskip("jax")
    with double_precision():
        jax.eval_shape(tiltsim.vectorized(scenario).fly, {})


def on_any_engine(use):
    """A use that flies long where a gait moves."""
    return lambda scenario: use(scenario.replace({"simulation.engine": "auto"}))


def document(scenario):
    return scenario.model_dump(mode="json", exclude_unset=True)


USES_OF_SCENARIOS = {
    "load_scenario": tiltsim.load_scenario,
    "parse_scenario": lambda scenario: tiltsim.parse_scenario(document(scenario)),
    "simulate": lambda scenario: tiltsim.simulate(scenario).metrics(),
    "Simulation": step,
    "airframe": tiltsim.airframe,
    "fly": lambda scenario: [row.metrics for row in tiltsim.fly([scenario])],
    "stability": on_any_engine(tiltsim.stability),
    "symbolic": tiltsim.symbolic,
    "TiltrotorEnv": learn,
}
SLOW_USES_OF_SCENARIOS = {
    "attraction": lambda scenario: tiltsim.attraction(
        scenario, ("x", "y"), ranges=((-0.1, 0.1), (-0.1, 0.1)), coarse=2, refinements=0
    ),
    "linearize": lambda scenario: tiltsim.linearize(scenario, loop="open"),
    "margins": tiltsim.margins,
    "sweep": sweep,
    "vectorized": on_arrays,
    "EnvFunctions": learn_on_arrays,
}


def on(plant, use):
    """A use on a plant."""
    return lambda scenario: use(scenario.replace({"simulation.plant": plant}))


def test_the_whole_public_interface_is_here():
    public = {name for name in tiltsim.__all__ if name.islower()} | {"Simulation"}
    methods = {
        name
        for name, value in vars(tiltsim.Flight).items()
        if isinstance(value, FunctionType) and (name[0] != "_" or name == "_repr_html_")
    } - {*tiltsim.Flight.__dataclass_fields__}
    environments = {name for name in tiltsim.env.__all__ if "Env" in name}
    known = {*USES_OF_FLIGHTS, *USES_OF_SCENARIOS, *SLOW_USES_OF_SCENARIOS}
    # Loading is a part of saving; the base of environments and many of them are used by the others.
    known |= {"law", "xp", "load_flight", "Environment", "VectorEnv"}
    known |= {"export", "read_log", "replay", "identify", "to_mcap", "to_ulog"}  # through_a_log
    assert public | methods | environments <= known


@each_pair
def test_every_flight_can_be_used(law, vehicle, tmp_path):
    if fits(law, vehicle):
        for name, use in USES_OF_FLIGHTS.items():
            if name != "plot" or (law, vehicle) not in EACH_LAW or LAID_OUT[vehicle] == law:
                use(flown(law, vehicle), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "vehicle"), RENDERED)
def test_every_flight_can_be_rendered(law, vehicle, tmp_path):
    """As a figure, and each vehicle once as a video: its text and inset are painted above."""
    if fits(law, vehicle):
        for name, use in SLOW_USES_OF_FLIGHTS.items():
            if name != "video" or LAW_OF_VIDEO[vehicle] == law:
                _, line = attempt(use, flown(law, vehicle), tmp_path)
                assert not line or "OpenGL" in line


@each_pair
def test_every_flight_becomes_a_log_unless_it_stays_in_a_plane(law, vehicle, tmp_path):
    if fits(law, vehicle):
        _, line = attempt(through_a_log, flown(law, vehicle), tmp_path)
        refused = "moves in a plane; choose csv" in line
        assert refused == fitting(law, vehicle).vehicle.is_planar, line


@each_pair
def test_every_scenario_can_be_used_or_is_refused_in_a_line(law, vehicle):
    if fits(law, vehicle):
        scenario = fitting(law, vehicle)
        lines = {name: attempt(use, scenario)[1] for name, use in USES_OF_SCENARIOS.items()}
        assert not any(lines[name] for name in ("load_scenario", "parse_scenario", "fly"))
        plant = PLANTS[DRAWN.index((law, vehicle)) % len(PLANTS)]
        attempt(on(plant, USES_OF_SCENARIOS["simulate"]), scenario)
        attempt(on("thesis", tiltsim.symbolic), scenario)


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", OTHERS)
def test_every_vehicle_is_flown_by_every_law_of_its_model(vehicle):
    """The pairs whose uses are not tested: on the plants in turn."""
    for law, _, plant in in_turn(claimed([vehicle])):
        if fits(law, vehicle):
            attempt(on(plant, USES_OF_SCENARIOS["simulate"]), fitting(law, vehicle))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* is short:RuntimeWarning")  # for a region of attraction
@pytest.mark.parametrize(("law", "vehicle", "plant"), in_turn(claimed(FEW)))
def test_every_scenario_can_be_analyzed_or_is_refused_in_a_line(law, vehicle, plant):
    """On MuJoCo all but the slow uses are tested above."""
    if fits(law, vehicle):
        uses = SLOW_USES_OF_SCENARIOS | (USES_OF_SCENARIOS if plant != "mujoco" else {})
        for use in uses.values():
            attempt(on(plant, use), fitting(law, vehicle))


@pytest.mark.slow
@pytest.mark.parametrize(("law", "vehicle"), dict(reversed(FITTING)).items())
def test_every_engine_flies_every_law_or_refuses_it_in_a_line(law, vehicle):
    """JAX without compiling, which takes long: tests/arrays/test_engine.py compares its steps."""
    if fits(law, vehicle):
        for engine in ENGINES:
            plant = "thesis" if engine == "jax" else "mujoco"
            change = {"simulation.engine": engine, "simulation.plant": plant}
            use = SLOW_USES_OF_SCENARIOS["vectorized"] if engine == "jax" else tiltsim.simulate
            attempt(lambda use=use, change=change: use(fitting(law, vehicle).replace(change)))


# --- tables and their keys ---------------------------------------------------------------------

NOT_FLOWN = {*DESCRIPTIVE, "variant", "autopilot"}
"""Tables that change nothing in a flight, or need a firmware: tests/plants/test_autopilot.py."""


def companions(document):
    """Values without which these tables are refused: a wall to push, an integrator."""
    pushes = document.get("reference", {}).get("type") == "push"
    if (
        not pushes
        and not {"object", "tool", "payload", "companion", "downwash", "cable"} & document.keys()
    ):
        return {}
    wall = {"name": "wall", "type": "wall", "position": [0.8, 0.0, 1.0], "size": [4.0, 4.0]}
    below = {"position": [0.0, 0.0, -0.3], "length": 0.4}
    touched = {"object": [wall], "tool": below} if pushes else {}
    if {"downwash", "cable"} & document.keys():
        touched["companion"] = [{"name": "wing", "offset": [0.0, 1.0, -1.0]}]
    if "cable" in document:
        parcel = {"type": "sphere", "size": [0.05], "position": [0.0, 0.4, -0.5]}
        touched["object"] = [{"name": "parcel", "joint": "free", "mass": 0.1, **parcel}]
    return {"simulation.integrator": "implicitfast", **touched}


def changes(table, keys=()):
    """The examples of a table and of some of its keys, as values by dotted key."""
    document = at = tomllib.loads(table.toml)
    for place in table.places[0]:
        at = at.setdefault(place.name, {})
        at = at[0] if isinstance(at, list) else at
    for key in keys:
        at[key.name] = tomllib.loads(f"value = {key.example}")["value"]
    needed = dict(leaves(document)) | companions(document)
    if [step.name for step in table.places[0]][:1] == ["sensors"] and len(table.places[0]) > 1:
        needed["simulation.control_timestep"] = 0.01  # instruments are read at control steps
    if "estimator" in document.get("controller", {}):
        needed |= {"sensors.imu": {}, "sensors.mocap": {}, "simulation.control_timestep": 0.01}
    return {key: needed[key] for key in needed.keys() - {"controller.function", "vehicle.mjcf"}}


FLOWN = {
    table.addresses()[-1]: table
    for table in TABLES
    if table.places[0] and table.places[0][0].name not in NOT_FLOWN
}
LAYERS = {address: changes(table) for address, table in FLOWN.items()}


def concerns(change, law, vehicle):
    """Whether these values are not of another law or vehicle."""
    own = {"controller.law": law, "vehicle.model": VEHICLES[vehicle]["model"]}
    return fits(law, vehicle) and all(change.get(key, own[key]) == own[key] for key in own)


def fly(law, vehicle, change, plant="mujoco"):
    """Fly a pair with these values; None if they do not concern it."""
    if not concerns(change, law, vehicle):
        return None
    short = {f"simulation.{key}": value for key, value in SHORT.items()}
    scenario = fitting(law, vehicle).replace({**change, "simulation.plant": plant, **short})
    return tiltsim.simulate(scenario)


@pytest.mark.parametrize("layer", LAYERS)
def test_every_table_is_flown_by_some_law(layer):
    """With one of the pairs that take it, another one for each table."""
    first = 5 * [*LAYERS].index(layer) % len(FITTING)
    for pair in FITTING[first:] + FITTING[:first]:
        flight, _ = attempt(fly, *pair, LAYERS[layer])
        if flight is not None:
            assert flight.metrics()
            return
    raise AssertionError("no law takes the example of this table")


def together(layer):
    """The keys of a table in few groups, each of which some pair takes at once."""

    def taken(keys):
        change = changes(FLOWN[layer], keys)
        return any(
            concerns(change, *pair) and attempt(fitting(*pair).replace, change)[0]
            for pair in FITTING
        )

    groups = [[]]
    for key in FLOWN[layer].keys:
        if key.example:
            joined = next((group for group in groups if taken([*group, key])), None)
            if joined is None:
                groups.append(joined := [])
            joined.append(key)
    return [changes(FLOWN[layer], keys) for keys in groups]


COLUMNS_DRAWN = set()


@pytest.mark.slow
@pytest.mark.parametrize("layer", LAYERS)
def test_every_law_takes_every_table_and_key_or_refuses_it_in_a_line(layer, tmp_path, monkeypatch):
    """Its vehicles, and the plants, take the groups of keys in turn, or else the table alone.

    Panels of new columns are drawn, but not laid out, which takes longer than the flight.
    """
    monkeypatch.setattr(layout, "place_legends", lambda _page: None)
    number = [*LAYERS].index(layer)
    for change in together(layer):
        for law in dict(FITTING):
            number += 1
            pairs = [pair for pair in FITTING if pair[0] == law and concerns(change, *pair)]
            if not pairs:
                continue
            turn, place = divmod(number, len(pairs))
            for example in (change, LAYERS[layer]):
                flight, _ = attempt(fly, *pairs[place], example, PLANTS[turn % len(PLANTS)])
                if flight is not None:
                    break
            else:
                continue
            flight.metrics()
            added = frozenset(flight.units) - frozenset(flown(*pairs[place]).units)
            if added not in COLUMNS_DRAWN:  # equal columns have equal panels
                COLUMNS_DRAWN.add(added)
                for use in ("plot", "view", "video"):
                    USES_OF_FLIGHTS[use](flight, tmp_path)
