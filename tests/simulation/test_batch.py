"""One law, three ways: Python, native, and a row of a batch fly the same flight bit for bit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import get_args

import mujoco
import numpy as np
import pytest

import tiltsim
import tiltsim.engines.sample_evaluation
import tiltsim.plants.plant
from tests.flights import TILT_CAR
from tests.laws.layers.test_actuation import EVERYTHING
from tests.laws.layers.test_air import STORM
from tests.laws.test_laws import GUST, LAWS
from tests.refusals import refusal
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.plants.mujoco_plant import MujocoPlant, flight_model, model_cache_key
from tiltsim.plants.plant import take_sample
from tiltsim.resources import shipped_folder
from tiltsim.scenario.loading import merge
from tiltsim.scenario.scenario_tables import Gait
from tiltsim.simulation import batch
from tiltsim.simulation.batch import fly
from tiltsim.simulation.native_batch import WAITING
from tiltsim.simulation.simulate import TerminationMonitor, fly_chunk, make_plant
from tiltsim.system import arguments

TROT = {"amplitude": 0.3, "period": 0.8}
GAITS = {
    "fixed": {"angles": [-0.3, 0.2, 0.4, 0.1]},
    "trot_instant": {**TROT, "period": 0.2},
    "trot_continuous": TROT,
    "walk": TROT,
    "run": TROT,
    "transverse_gallop": TROT,
    "rotary_gallop": TROT,
    "two_color": {"period": 1.0, "centre": [0.2, -0.2], "radius": 0.1},
    "table": {"rows": [[0, 0.1, 0, 0.1, 0], [0.2, 0.2, -0.1, 0.2, -0.1], [0.3, 0.1, 0, 0.1, 0]]},
    "waypoints": {"period": 0.7, "angles": [[0.1, 0.0, 0.1, 0.0], [0.2, -0.1, 0.2, -0.1]]},
}
CAR = LAWS["tilt_car_planned_direction"]
CAR_GAITS = {
    "penguin_small": {"period": 0.4},
    "penguin_large": {"period": 0.4},
    "rotating": {"rate": 0.8},
}
ALL_LAWS = {name: {**tables, "disturbance": GUST} for name, tables in LAWS.items()}

# Gains that let the law be sampled at a few milliseconds; the published loops are too fast for it.
EXACT = {"decoupling": "exact", "gains": "exact"}
UPSIDE_DOWN = {"initial": {"attitude": [np.pi, 0.0, 0.0]}}
STOPPING_ROTOR = {
    "controller": EXACT,
    "initial": {"rotor_speed": [20.0, 300.0, 300.0, 300.0], "angular_velocity": [0, 20, 0]},
}
LATE_LOSS = {"gait": {"type": "trot_instant", "amplitude": 0.9, "period": 2.0}}


def scenario(tables, **simulation):
    simulation = {"duration": 0.43, "engine": "native", **simulation}
    return tiltsim.parse_scenario({**tables, "simulation": simulation})


def without_speed(metrics):
    return {name: value for name, value in metrics.items() if name != "realtime_factor"}


def three_ways(scenarios):
    """Assert that every scenario flies equally in Python, natively and in a batch of all."""
    rows = list(fly(scenarios, keep_samples=True, threads=2))
    assert [row.scenario for row in rows] == scenarios
    for flown, row in zip(scenarios, rows, strict=True):
        for engine in ("python", "native"):
            simulation = flown.simulation.model_copy(update={"engine": engine})
            alone = tiltsim.simulate(flown.model_copy(update={"simulation": simulation}))
            assert alone.engine == engine
            np.testing.assert_array_equal(row.flight.samples, alone.samples)
            assert row.end == alone.end
            assert without_speed(row.metrics) == without_speed(alone.metrics())
        assert row.flight.engine == "native"
    return rows


# The equations are one for all laws of a vehicle; compiling each law into them takes seconds.
ON_EQUATIONS = ("attitude_altitude", "full_pose", "tilt_car_planned_direction")


@pytest.mark.parametrize(
    ("law", "plant"),
    [(law, "mujoco") for law in LOOPS]
    + [
        pytest.param(law, "thesis", marks=[] if law in ON_EQUATIONS else pytest.mark.slow)
        for law in LOOPS
    ],
)
def test_every_law_flies_the_same_three_ways_with_continuous_and_held_control(law, plant):
    tables, simulation = ALL_LAWS[law], {"plant": plant, "timestep": 0.002}
    rows = three_ways(
        [
            scenario(tables, **simulation, duration=0.21),
            # 0.426 s is no multiple of the recording interval or of the interval of held commands
            scenario(tables, **simulation, control_timestep=0.006, duration=0.426),
        ]
    )
    assert [row.end.kind for row in rows] == ["completed"] * 2
    assert [len(row.flight) for row in rows] == [22, 44]


def test_every_gait_is_here():
    tables = get_args(get_args(Gait)[0])
    names = {n for table in tables for n in get_args(table.model_fields["type"].annotation)}
    assert set(GAITS) | set(CAR_GAITS) == names


def test_every_gait_flies_the_same_three_ways_with_continuous_and_held_control():
    each = [({"controller": EXACT}, *gait) for gait in GAITS.items()]
    each += [(CAR, *gait) for gait in CAR_GAITS.items()]
    scenarios = [
        scenario({**tables, "gait": {"type": name, **table}}, timestep=0.002, control_timestep=held)
        for tables, name, table in each
        for held in (0.0, 0.004)
    ]
    # Rows have tables of different lengths, though one layout.
    assert len({len(assemble(s).setup.knots) for s in scenarios}) > 2
    three_ways(scenarios)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["RK4", "implicitfast", "implicit", "Euler"])
def test_rows_may_differ_in_vehicle_time_step_recording_and_duration(integrator):
    gait = {"type": "trot_continuous", **TROT}
    three_ways(
        [
            scenario({"gait": gait}, integrator=integrator),
            scenario({"vehicle": {"mass": 0.5, "gravity": 9.81}}, integrator=integrator),
            scenario({"disturbance": GUST}, integrator=integrator, timestep=0.0005, duration=0.2),
            scenario({"gait": gait}, integrator=integrator, record_timestep=0.001, duration=0.05),
            scenario({}, integrator=integrator, record_timestep=0.3, duration=1.0),
            scenario({"vehicle": {"tilt_servo": {"max_angle": 0.3}}, "gait": gait}),
        ]
    )


WINDING_UP = {
    "vehicle": {"model": "tilt_car"},
    "initial": {"rotor_speed": [3.0, 60.0]},  # where it shall stay: both rotors slow down
}
FALLING = {"initial": {"position": [0.0, 0.0, 0.1], "rotor_speed": 200.0}, "controller": EXACT}
LAGGING = {"vehicle": {"rotor_time_constant": 0.004}, "controller": EXACT}
BREEZE = {"air": {"wind": [1.0, 0.0, 0.0], "drag": {"linear": [0.1, 0.1, 0.1]}}}
LIKE_BUT_FOR = {
    "the model's error": [
        {"initial": {"attitude": [0.2, -0.1, 0.1]}, "model_error": error}
        for error in ({}, {"mass": 1.1}, {"inertia": [1.2, 1.2, 1.2]})
    ],
    "anti-windup": [
        {**WINDING_UP, "controller": {"law": "tilt_car_fourth_derivative", "anti_windup": held}}
        for held in (False, True)
    ],
    "ground": [FALLING, {**FALLING, "ground": {}}, {**FALLING, "ground": {"height": 0.02}}],
    "gait rates": [{}, LAWS["gait_feedforward"]],
    "layers": [{}, LAGGING, BREEZE, {**LAGGING, **BREEZE, "model_error": {"mass": 1.1}}],
}


@pytest.mark.parametrize(
    "what",
    [
        pytest.param(what, marks=pytest.mark.slow if what == "layers" else ())
        for what in LIKE_BUT_FOR
    ],
)
def test_flights_that_differ_in_one_thing_do_not_share_what_depends_on_it(what):
    rows = three_ways([scenario(tables) for tables in LIKE_BUT_FOR[what]])
    assert len({row.flight.samples[:, 1:4].tobytes() for row in rows}) == len(rows), (
        "they must not fly alike by themselves"
    )


def test_user_files_with_other_bodies_fly_in_separate_batches(tmp_path):
    shipped = (shipped_folder("mjcf") / "tiltrotor.xml").read_text(encoding="utf-8")
    scene = (shipped_folder("mjcf") / "scene.xml").read_text(encoding="utf-8")
    (tmp_path / "scene.xml").write_text(scene, encoding="utf-8")
    payload = '<body pos="0 0 -0.05"><geom size="0.01" mass="0.05" contype="0"/></body>'
    files = {
        "bare.xml": shipped,
        "loaded.xml": shipped.replace('<site name="imu"/>', payload + '<site name="imu"/>'),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    three_ways([scenario({"vehicle": {"mjcf": str(tmp_path / name)}}) for name in files])


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_flights_end_early_on_the_same_step_with_the_same_cause(plant):
    rows = three_ways(
        [
            scenario(tables, duration=3.0, record_timestep=record, plant=plant)
            for tables in (UPSIDE_DOWN, STOPPING_ROTOR)
            for record in (0.001, 0.25)
        ]
    )
    ends = [row.end for row in rows]
    assert ends[0].kind in {"diverged", "singular"}
    assert ends[2].kind == "singular"
    assert "came to a stop" in ends[2].cause
    assert ends[0] == ends[1], "recording must not matter"


@pytest.mark.slow
def test_a_flight_that_ends_early_makes_room_for_the_next():
    """An hour each, if they did not diverge in the first second."""
    many = [scenario(UPSIDE_DOWN, duration=3600.0, record_timestep=1.0)] * (WAITING + 4)
    results = list(fly(many, threads=1))
    assert len(results) == len(many)
    assert {result.end.time for result in results} == {results[0].end.time}
    assert results[0].end.time < 1.0
    assert all(result.flight is None for result in results)


def test_an_early_end_is_located_from_the_last_good_sample_on(monkeypatch):
    steps_taken = []
    advance = MujocoPlant.advance

    def counted(plant, steps):
        steps_taken.append(steps)
        return advance(plant, steps)

    flown = scenario(LATE_LOSS, duration=3.0, record_timestep=0.05)
    alone, assembly = tiltsim.simulate(flown), assemble(flown)
    plant, monitor = make_plant(assembly), TerminationMonitor(assembly)
    assert monitor.check(plant, take_sample(plant)) is None
    monkeypatch.setattr(MujocoPlant, "advance", counted)
    samples, end = fly_chunk(plant, monitor, 60, 50)
    assert 2.0 < end.time < 2.1
    assert end == alone.end
    np.testing.assert_array_equal(samples, alone.samples[1:])
    assert steps_taken[:3] == [60 * 50, 50 * (len(samples) - 1), 50]
    assert sum(steps_taken[3:]) <= 50


# --- layers around the laws ---------------------------------------------------------------------

LAYERED = {
    "initial": {"rotor_speed": 361.0, "attitude": [0.05, -0.03, 0.02]},
    "controller": {**EXACT, "decoupler": "exact"},
    "gait": {"type": "trot_continuous", **TROT},
}
LATE = {"control_timestep": 0.004, "control_latency": 0.008}
NOISY = {"sensors": {"attitude_noise": 0.01, "velocity_noise": 0.02, "position_bias": [0.1, 0, 0]}}
STORMY = {"air": STORM}
HINGED = {"vehicle": {"rotor_inertia": 1e-5}}
HEAVY = {"model_error": {"mass": 1.07, "inertia": [1.1, 0.9, 1.0], "thrust_coefficient": 0.95}}
WATCHED = {"controller": {"supervisor": {"min_margin": 0.3, "min_determinant": 3.9}}}
MEASURED = {"controller": {"angular_acceleration": "measured"}}
EVERY_LAYER = (EVERYTHING, STORMY, HINGED, HEAVY, WATCHED, MEASURED)
ACTUATION = {key: table for key, table in EVERYTHING.items() if key != "controller"}
WITH_ACTUATORS = (ACTUATION, STORMY, HINGED, HEAVY)
"""Without the controller's own layers (supervisor, measured acceleration, latency, prioritized
allocation): on the equations, the solver would compile them again at each of its stages."""
HELD = {"control_timestep": 0.004}
FED_FORWARD = {"controller": {"gait_rate_feedforward": True, "gains": {
    "attitude": {"bandwidth": 25.0},
    "altitude": {"bandwidth": 10.0, "integral": 0.5},
    "position": {"bandwidth": 1.5, "integral": 0.5},
}}}  # fmt: skip


def layered(*changes, seed=1, **simulation):
    tables = LAYERED
    for change in changes:
        tables = merge(tables, change)
    return scenario(tables, timestep=0.002, duration=0.35, seed=seed, **simulation)


@pytest.mark.slow
def test_rows_with_and_without_layers_fly_the_same_three_ways():
    rows = three_ways(
        [
            layered(),
            layered(NOISY),
            layered(NOISY, seed=2),
            layered(STORMY),
            layered(STORMY, {"air": {"wind": [-2.0, 0.0, 0.5]}}, seed=3),
            layered(STORMY, NOISY, HEAVY, seed=4),
            layered(EVERYTHING),
            layered(EVERYTHING, **LATE),
            layered(*EVERY_LAYER, seed=5, **LATE),
            layered({"vehicle": {"rotor_time_constant": 0.03, "tilt_servo": {"max_angle": 0.4}}}),
            layered(),
        ]
    )
    assert len({id(loop_of(row.scenario)) for row in rows}) == 7
    assert rows[8].flight["supervision"].max() > 0.1
    paths = [row.flight.samples[:, 1:4].tolist() for row in rows]
    assert paths[0] == paths[-1]
    assert all(a != b for i, a in enumerate(paths[:-1]) for b in paths[:i])


@pytest.mark.slow
def test_estimators_inside_layers_fly_the_same_three_ways():
    sensors = {
        "imu": {"gyro_noise_density": 3e-4, "accelerometer_noise_density": 2e-3},
        "mocap": {"position_noise": 1e-3, "attitude_noise": 3e-3, "delay": 0.008},
    }
    estimating = {"controller": {"estimator": "ekf"}, "sensors": sensors}
    actuators = {key: table for key, table in ACTUATION.items() if key != "sensors"}
    rows = three_ways(
        [
            layered(estimating, **HELD),
            layered(estimating, seed=2, **HELD),
            layered(estimating, STORMY, HINGED, HEAVY, **HELD),
            layered(estimating, actuators, MEASURED, **LATE),
            layered(estimating, STORMY, plant="thesis", **HELD),
        ]
    )
    assert all(row.end.kind == "completed" for row in rows)
    assert rows[0].flight["estimate_x"].tolist() != rows[1].flight["estimate_x"].tolist()


@pytest.mark.slow
def test_layers_around_the_law_that_knows_its_gait_fly_the_same_three_ways():
    rows = three_ways(
        [
            layered(FED_FORWARD),
            layered(),  # the same law by name, and another loop
            layered(FED_FORWARD, STORMY, NOISY, HEAVY),
            layered(FED_FORWARD, STORMY, NOISY, HEAVY, seed=2),
        ]
    )
    assert all(row.end.kind == "completed" for row in rows)


@pytest.mark.slow(longest=True)
def test_rotors_with_inertia_fly_the_same_three_ways():
    knowing = {"controller": {"rotor_inertia_feedforward": True}}
    rows = three_ways(
        [
            layered(HINGED, FED_FORWARD, knowing),
            layered({"vehicle": {"rotor_inertia": 2e-5}}, FED_FORWARD, knowing),
            layered(HINGED, LAWS["full_pose"]),
            layered(*WITH_ACTUATORS, plant="thesis", **HELD),
        ]
    )
    assert all(row.end.kind == "completed" for row in rows)
    assert (rows[0].flight["roll"] != rows[1].flight["roll"]).any()


@pytest.mark.slow
def test_air_around_quadrotors_flies_the_same_three_ways():
    quadrotor = LAWS["yaw_position"]
    three_ways(
        [
            scenario(quadrotor, duration=0.2),
            scenario({**quadrotor, **STORMY}, duration=0.2, seed=1),
            scenario({**quadrotor, **STORMY}, duration=0.2, seed=2, control_timestep=0.004),
            scenario({**quadrotor, **STORMY, **HEAVY}, duration=0.2, seed=2),
            scenario({**quadrotor, **STORMY}, duration=0.2, seed=1, plant="thesis"),
        ]
    )


def test_every_row_flies_a_separate_model():
    """Properties that the law does not model: the true vehicle, and ground to touch."""
    down = {"initial": {"velocity": [0.0, 0.0, -1.0]}}
    rows = three_ways(
        [
            layered(),
            layered(HEAVY),
            layered({"model_error": {"mass": 0.9}}),
            layered(down),
            layered(down, {"ground": {"height": -0.1}}),
            layered(down, {"ground": {"height": -0.15, "friction": 0.4}}),
        ]
    )
    heights = [float(row.flight["z"].min()) for row in rows]
    assert len(set(heights)) == len(rows)
    assert heights[3] < heights[5] < heights[4], "ground holds up"


@pytest.mark.parametrize(
    "change",
    [
        HEAVY,
        GUST,
        {"ground": {"height": -1.0}},
        {"ground": {"height": -1.0, "friction": 0.4}},
        {"vehicle": {"mass": 0.5}},
        {"vehicle": {"max_rotor_speed": 500.0}},
        {"simulation": {"timestep": 0.001}},
        {"simulation": {"integrator": "Euler"}},
        {"initial": {"position": [1.0, 0.0, 0.0]}},
        {"simulation": {"seed": 3}},
        {"gait": {"period": 0.9}},
    ],
    ids=str,
)
def test_the_model_cache_key_distinguishes_models(change):
    """Rows share a model exactly where MuJoCo would compile the same one."""
    change = {"disturbance": change} if change is GUST else change
    tables = {**LAYERED, "simulation": {"timestep": 0.002, "duration": 0.3}}
    plain, changed = map(tiltsim.parse_scenario, (tables, merge(tables, change)))
    models = [saved_model(flight_model(assemble(flown), 40)) for flown in (plain, changed)]
    same_key = model_cache_key(plain) == model_cache_key(changed)
    assert same_key == (models[0] == models[1])


def saved_model(model):
    """A compiled model as bytes."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def test_own_controllers_are_flown_one_by_one_among_others(tmp_path):
    file = tmp_path / "hover.py"
    file.write_text(
        "import numpy as np\nimport tiltsim\n\n\n"
        "def law(seen):\n"
        "    weight = seen.vehicle.mass * seen.vehicle.gravity\n"
        "    return tiltsim.Command(thrusts=np.full(4, weight / 4))\n",
        encoding="utf-8",
    )
    own = {"controller": {"law": "python", "function": f"{file}:law"}}
    scenarios = [
        tiltsim.load_scenario(
            scenario(
                {**own, "model_error": {"mass": mass}}, engine="auto", timestep=0.002, duration=0.1
            ),
            trusted=True,
        )
        for mass in (0.9, 1.0, 1.1)
    ]
    # A sweep requests the native engine for all scenarios, even where it cannot be used.
    simulation = scenarios[2].simulation.model_copy(update={"engine": "native"})
    scenarios[2] = scenarios[2].model_copy(update={"simulation": simulation})
    scenarios.insert(1, scenario({}, duration=0.1))
    results = list(fly(scenarios, keep_samples=True))
    assert [result.scenario for result in results] == scenarios
    assert [result.flight.engine for result in results] == ["python", "native", "python", "python"]
    light, _, right, heavy = (float(result.flight["z"][-1]) for result in results)
    # The law lifts the nominal weight: z = (1 / factor - 1) g t^2 / 2.
    assert light == pytest.approx((1 / 0.9 - 1) * 9.8 * 0.1**2 / 2, rel=1e-3)
    assert right == pytest.approx(0.0, abs=1e-9)
    assert heavy == pytest.approx((1 / 1.1 - 1) * 9.8 * 0.1**2 / 2, rel=1e-3)


# --- rows that come and go ----------------------------------------------------------------------


def test_more_flights_than_rows_come_in_their_order():
    scenarios = [
        scenario({"initial": {"position": [0.001 * i, 0.0, 0.0]}}, duration=0.02 + 0.01 * (i % 7))
        for i in range(60)
    ]
    results = list(fly(scenarios, threads=2, keep_samples=True))
    assert [result.scenario for result in results] == scenarios
    for i, result in enumerate(results):
        assert result.flight["x"][0] == 0.001 * i
        assert result.end.time == pytest.approx(0.02 + 0.01 * (i % 7))


def test_all_kinds_of_flights_together():
    scenarios = [
        scenario({}, engine="python", duration=0.05),
        scenario({}, plant="thesis", duration=0.05),
        scenario({}, duration=0.05),
        scenario(LAWS["yaw_position"], duration=0.05),
        scenario({}, engine="auto", duration=0.05),
    ]
    results = list(fly(scenarios * 2, keep_samples=True))
    assert [result.scenario for result in results] == scenarios * 2
    assert results[0].flight.engine == "python"
    assert results[2].flight.engine == "native"
    assert mujoco.get_mjcb_control() is None


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_many_short_flights_are_worth_the_native_engine(plant, monkeypatch):
    scenarios = [scenario({}, engine="auto", plant=plant, duration=0.05)] * 6
    monkeypatch.setattr(tiltsim.plants.plant, "MIN_STEPS_TO_COMPILE", 300)
    results = list(fly(scenarios, keep_samples=True))
    assert {result.flight.engine for result in results} == {"native"}
    assert [result.scenario for result in results] == scenarios
    assert next(fly(scenarios[:1], keep_samples=True)).flight.engine == "python"


def test_no_flights_give_no_results():
    assert list(fly([])) == []


def test_a_batch_takes_whatever_describes_a_scenario_and_flies_own_controllers():
    short = {"simulation": {"duration": 0.02}}
    own = tiltsim.load_scenario(short, controller=lambda _: tiltsim.Command(thrusts=[2.0] * 4))
    mixture = [own, short, tiltsim.load_scenario(TILT_CAR, {"simulation.duration": 0.02})]
    results = list(tiltsim.fly((one for one in mixture), keep_samples=True))
    models = [result.scenario.vehicle.model for result in results]
    assert models == ["tiltrotor", "tiltrotor", "tilt_car"]
    assert results[0].flight["thrusts"][-1] == pytest.approx([2.0] * 4)
    np.testing.assert_array_equal(results[1].flight.samples, tiltsim.simulate(short).samples)


def falling(_):
    """A controller that other processes import."""
    return tiltsim.Command(rotor_accelerations=[-50.0] * 4)


@pytest.mark.slow
def test_processes_fly_own_controllers_alike():
    short = {"simulation": {"duration": 0.02}}
    own = [tiltsim.load_scenario({**short, "title": name}, controller=falling) for name in "abc"]
    alone, shared = ([*tiltsim.fly(own, jobs=jobs, keep_samples=True)] for jobs in (1, 2))
    assert [result.scenario for result in shared] == own
    for one, other in zip(alone, shared, strict=True):
        np.testing.assert_array_equal(one.flight.samples, other.flight.samples)
        assert without_speed(one.metrics) == without_speed(other.metrics)
        assert other.flight.scenario.own_controller is falling


def test_functions_that_processes_cannot_import_are_refused():
    local = tiltsim.load_scenario({"simulation": {"duration": 0.02}}, controller=lambda _: None)
    line = refusal(lambda: [*tiltsim.fly([local] * 2, jobs=2)])
    assert line.startswith("jobs = 2: other processes cannot import a function given in Python (")
    assert line.endswith("define it in a module, or leave jobs out")


def test_a_batch_reports_flights_whose_results_wait_for_others(monkeypatch):
    def flown(assemblies, *_):
        return ((place, SimpleNamespace(has_failed=False)) for place in range(len(assemblies)))

    monkeypatch.setattr(batch, "fly_in_mujoco", flown)
    monkeypatch.setattr(batch, "_way_to_fly", lambda assembly, _: assembly.scenario.title)
    monkeypatch.setattr(arguments, "INTERVAL", 0.0)
    counts = []
    results = tiltsim.fly([{"title": title} for title in "ABAB"], progress=counts.append)
    next(results)
    assert counts == [1]
    next(results)
    assert counts == [1, 2, 3]  # the second A waits for the first B


def test_a_batch_reports_its_flights_and_takes_numpy_numbers():
    counts = []
    short = {"simulation": {"duration": 0.01}}
    results = tiltsim.fly([short] * 3, threads=np.int64(2), progress=counts.append)
    assert len([*results]) == 3
    assert counts[-1] == 3
