"""Several vehicles in one world: each as alone, until they touch."""

from __future__ import annotations

import json

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.commands.run import summary
from tiltsim.flight.metrics import check_expectations
from tiltsim.laws.assembling import assemble
from tiltsim.logs.model import LoggedVehicle
from tiltsim.plants.mujoco_plant import flight_model
from tiltsim.views.figures.sweep import sweep_figure

HOVER = "fleet/hexarotor#hover"
SIMULATION = {"duration": 0.3, "integrator": "implicitfast", "engine": "python"}
TOWARDS = {
    "name": "wing",
    "offset": [0.8, 0.1, 0.05],
    "changes": {"initial": {"velocity": [-1.5, 0.0, 0.0]}},
}
WING = {"name": "wing", "offset": [2.0, 0.3, 0.0]}
PULL = {"type": "acceleration", "value": [1.0, 0.0, 0.0]}
STICK = {"position": [0.0, 0.05, 0.0], "direction": [0.0, 1.0, 0.0], "length": 0.4, "mass": 0.01}
QUAD = {
    "name": "quad",
    "scenario": "arena/quadrotor#step",
    "offset": [0.0, 3.0, 0.0],
    "changes": {"vehicle": {"gravity": 9.81}},
}


def together(*companions, **changes):
    """A hexarotor among companions."""
    tables = {f"simulation.{key}": value for key, value in SIMULATION.items()}
    tables |= {"initial.velocity": [0.1, 0.2, 0.3], "companion": [*companions], "expect": []}
    return tiltsim.load_scenario(HOVER, tables | changes)


def assert_equal(flight, alone, prefix):
    for name in alone:
        if name != "time":
            np.testing.assert_array_equal(flight[prefix + name], alone[name], err_msg=name)


@pytest.mark.parametrize("engine", ["python", "native"])
def test_far_apart_each_vehicle_flies_as_alone_with_the_same_bits(engine):
    armed = WING | {"changes": {"tool": STICK}}
    scenario = together(armed, QUAD, **{"simulation.engine": engine})
    flight = tiltsim.simulate(scenario)
    assert flight.engine == engine
    assert_equal(flight, tiltsim.simulate(scenario.replace({"companion": []})), "")
    for name, own in zip(("wing_", "quad_"), scenario.companions, strict=True):
        assert_equal(flight, tiltsim.simulate(own), name)
    assert np.ptp(flight["quad_x"]) > 0.0


def test_both_engines_fly_a_collision_with_the_same_bits_and_push_apart():
    flights = [
        tiltsim.simulate(together(TOWARDS, **{"simulation.engine": engine}))
        for engine in ("python", "native")
    ]
    for name in flights[0]:
        np.testing.assert_array_equal(flights[0][name], flights[1][name], err_msg=name)
    nearest = flights[0].metrics()["minimum_separation"]
    alone = tiltsim.simulate(together(TOWARDS | {"offset": [0.8, 3.1, 0.05]}))
    assert nearest < 0.8
    assert np.abs(flights[0]["x"] - alone["x"]).max() > 1e-3, "it is pushed away"


def test_vehicles_keep_their_momentum_through_an_impact():
    """Without gravity and thrust."""
    assembly = assemble(together(TOWARDS))
    model = flight_model(assembly)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = assembly.loop.kind.initial_motion(assembly)
    momenta, contacts = [], 0
    for _ in range(1000):
        mujoco.mj_step(model, data)
        contacts += data.ncon > 0
        mujoco.mj_subtreeVel(model, data)
        momenta.append(data.subtree_linvel[0] * model.body_subtreemass[0])
    assert contacts > 5
    assert np.ptp(momenta, axis=0).max() < 1e-6 * np.abs(momenta).max()


def test_a_saved_flight_is_read_back_whatever_becomes_of_the_files_that_it_names(tmp_path):
    named = tmp_path / "wing.toml"
    named.write_text('[vehicle]\npreset = "ar_drone_2"\ngravity = 9.81\n')
    text = f'[[companion]]\nname = "wing"\nscenario = "{named.name}"\noffset = [2.0, 0.0, 0.0]\n'
    text += '[simulation]\nduration = 0.05\nintegrator = "implicitfast"\n'
    text += "[vehicle]\ngravity = 9.81\n"
    (tmp_path / "first.toml").write_text(text)
    flight = tiltsim.simulate(tmp_path / "first.toml")
    flight.save(tmp_path / "flight")
    named.unlink()
    again = tiltsim.load_flight(tmp_path / "flight")
    assert_equal(again, flight, "")
    assert again["wing_z"][-1] != 0.0
    assert tiltsim.load_scenario(tmp_path / "flight" / "scenario.toml").companion


def test_the_contact_forces_of_a_companion_are_its_own_on_both_engines():
    """A box without weight flies against the companion's tool: Newton's second law, by steps."""
    box = {"name": "box", "type": "box", "position": [2.1, 0.92, 0.02], "size": [0.2, 0.3, 0.4]}
    box |= {"joint": "free", "mass": 0.7, "floating": True, "velocity": [0.0, -0.5, 0.0]}
    wall = {"name": "wall", "type": "wall", "position": [0.0, -9.0, 0.0], "size": [2.0, 2.0]}
    armed = WING | {"changes": {"tool": STICK}}
    changes = {"object": [wall, box], "simulation.timestep": 0.001}
    changes |= {"simulation.record_timestep": 0.001, "simulation.duration": 0.05}
    python, native = (
        tiltsim.simulate(together(armed, **changes, **{"simulation.engine": engine}))
        for engine in ("python", "native")
    )
    for name in python:
        np.testing.assert_array_equal(python[name], native[name], err_msg=name)
    force = python["wing_contact_force_y"]
    assert np.abs(force).max() > 1.0
    speed = np.diff(python["box_y"], 2) / 0.001
    np.testing.assert_allclose(0.7 * speed / 0.001, force[2:], atol=1e-6)
    assert not python["contact_force_y"].any()
    assert python["contact_time"][-1] == 0.0
    assert python["wing_contact_time"][-1] == pytest.approx(0.001 * np.count_nonzero(force))
    assert python["wing_peak_contact_force"][-1] >= np.abs(force).max()


def test_vectors_of_a_companion_are_panels_and_hints():
    flight = tiltsim.simulate(together(WING, **{"simulation.duration": 0.02}))
    (axes,) = tiltsim.plot(flight, panels="wing_position", size="85x60mm").axes
    shown = np.stack([line.get_ydata() for line in axes.lines[:3]], axis=-1)
    np.testing.assert_array_equal(shown, flight["wing_position"])
    assert "did you mean wing_position?" in refusal(tiltsim.plot, flight, panels="wing_positon")
    begun = refusal(tiltsim.plot, flight, panels="reference")
    assert "'reference': choose reference_position, " in begun


def test_identification_refuses_companions():
    assert "identify takes a vehicle alone" in refusal(LoggedVehicle, together(WING))


def test_a_companion_that_is_lost_ends_the_flight_by_its_name():
    spinning = WING | {"changes": {"initial": {"angular_velocity": [2000.0, 0.0, 0.0]}}}
    flight = tiltsim.simulate(together(spinning))
    assert flight.end.kind == "diverged"
    assert flight.end.cause.startswith("wing: body rate p")


@pytest.mark.parametrize(
    ("companions", "line"),
    [
        ([WING, WING], 'companion.name = "wing": is taken'),
        ([WING | {"name": "tilt"}], 'companion.name = "tilt": is taken'),
        ([WING | {"name": "Wing 1"}], "up to 31 lowercase letters, digits and _"),
        ([WING | {"scenario": "interaction/formation"}], "a companion has no companions"),
        ([WING | {"scenario": "fleet/no_such"}], 'companion.scenario = "fleet/no_such"'),
        ([WING | {"scenario": "missing.toml"}], 'missing.toml": no such file'),
        ([WING | {"scenario": "ch10_state_drift/circle"}], "companion"),
        ([WING | {"scenario": "interaction/carry#cable"}], "a companion carries no load"),
        ([WING | {"changes": {"vehicle": {"gravity": 3.7}}}], "vehicle.gravity = 3.7"),
        ([WING | {"changes": {"vehicle": {"mass": -1.0}}}], '"wing": vehicle.mass'),
        ([WING | {"changes": {"nonsense": {}}}], "nonsense"),
        ([WING | {"changes": {"refrence": {}}}], "did you mean reference?"),
        ([WING | {"changes": {"simulation": {"timestep": 1.0}}}], "companion.changes.simulation ="),
        ([WING | {"changes": {"payload": {"mass": 0.1}}}], "companion.changes.payload ="),
        ([WING | {"changes": {"object": []}}], "companion.changes.object ="),
        ([WING | {"changes": {"companion": [WING]}}], "companion.changes.companion ="),
        ([WING | {"changes": {"sensors": {"imu": {}}}}], "sensors.imu"),
        ([WING | {"changes": {"disturbance": [PULL]}}], "a disturbance by an acceleration"),
        ([WING | {"spacing": -1.0}], "companion[0].spacing = -1.0: unknown key"),
        ([{"name": f"wing_{i}"} for i in range(8)], "at most 7"),
    ],
)
def test_a_bad_companion_is_refused_in_one_line(companions, line):
    assert line in refusal(together, *companions)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"simulation.plant": "rigid_body", "simulation.integrator": "RK4"},
            'simulation.plant = "rigid_body"',
        ),
        ({"simulation.integrator": "RK4"}, 'simulation.integrator = "RK4"'),
        ({"simulation.plant": "thesis", "simulation.engine": "jax"}, "no [companion]"),
    ],
)
def test_companions_are_refused_where_they_cannot_fly(changes, line):
    assert line in refusal(lambda: together(WING, **changes))


def test_vehicles_that_overlap_at_the_start_are_refused():
    with pytest.raises(
        tiltsim.InputError, match=r"companion wing and the vehicle overlap by .* at the start"
    ):
        tiltsim.simulate(together(WING | {"offset": [0.05, 0.0, 0.0]}))


def test_rows_of_a_batch_fly_among_companions_as_alone():
    scenarios = [
        together(WING | {"offset": [2.0, y, 0.0]}, **{"simulation.engine": "native"})
        for y in (0.3, 1.0)
    ]
    rows = tiltsim.fly(scenarios, keep_samples=True)
    for scenario, row in zip(scenarios, rows, strict=True):
        alone = tiltsim.simulate(scenario)
        assert_equal(row.flight, alone, "")
        for name in ("minimum_separation", "companion_rms_position_error"):
            assert row.metrics[name] == alone.metrics()[name]


DOWNWASH = {"rotor_radius": 0.1, "drag_area": 0.02}


@pytest.mark.parametrize("held", [0.0, 0.004])
def test_a_vehicle_in_the_wake_of_another_sinks_by_its_column_in_both_engines(held):
    changes = {"downwash": DOWNWASH, "simulation.control_timestep": held}
    flights = [
        tiltsim.simulate(
            together(
                WING | {"offset": [0.0, 0.0, -1.0]}, **{**changes, "simulation.engine": engine}
            )
        )
        for engine in ("python", "native")
    ]
    for name in flights[0]:
        np.testing.assert_array_equal(flights[0][name], flights[1][name], err_msg=name)
    flight = flights[0]
    assert not flight["downwash"].any()
    assert flight["wing_downwash"].max() < -0.5
    still = tiltsim.simulate(flight.scenario.replace({"downwash.drag_area": 1e-12}))
    np.testing.assert_array_equal(flight["z"], still["z"])
    mass = flight.scenario.any_rotorcraft.resolve().mass
    begin = slice(2, 6)  # before its controller reacts
    fall = np.gradient(flight["wing_vz"] - still["wing_vz"], flight["time"])[begin]
    np.testing.assert_allclose(fall, flight["wing_downwash"][begin] / mass, rtol=0.1)


def test_downwash_needs_a_companion():
    assert "needs a [[companion]]" in refusal(lambda: together(downwash=DOWNWASH))


def test_vectors_of_a_companion_have_its_name():
    flight = tiltsim.simulate(together(WING))
    np.testing.assert_array_equal(flight["wing_position"][:, 1], flight["wing_y"])
    assert "wing_position" in flight


def test_a_companions_tool_that_touches_its_rotor_is_refused():
    tool = {"tool": {"position": [0.0, 0.0, 0.02], "direction": [0.866, 0.5, 0.0], "length": 0.3}}
    scenario = together(WING | {"changes": tool})
    assert "tool: touches wing_pod_1 of its own vehicle" in refusal(tiltsim.simulate, scenario)


@pytest.mark.parametrize(
    "objects",
    [
        {},
        pytest.param(
            {"tool": STICK, "payload": {"mass": 0.1, "length": 0.3}}, marks=pytest.mark.slow
        ),
    ],
)
def test_the_first_vehicle_gives_the_command_that_it_gives_alone(objects):
    among = tiltsim.Simulation(together(WING, QUAD, **objects))
    alone = tiltsim.Simulation(among.scenario.replace({"companion": []}))
    for simulation in (among, alone):
        simulation.step(5)
    commanded, expected = among.command().rotor_accelerations, alone.command().rotor_accelerations
    np.testing.assert_array_equal(commanded, expected)
    assert commanded.any()


def test_every_vehicle_has_its_flight_and_metrics(tmp_path):
    """A companion far away has the columns and metrics of its scenario flown alone."""
    scenario = together(QUAD, WING | {"changes": {"tool": STICK}})
    flight = tiltsim.simulate(scenario)
    assert [*flight.vehicles] == ["first vehicle", "quad", "wing"]
    assert flight.vehicles["first vehicle"] is flight
    quad, alone = flight.vehicles["quad"], tiltsim.simulate(scenario.companions[0])
    assert_equal(quad, alone, "")
    clock = {"realtime_factor": 1.0}
    assert quad.metrics() | clock == alone.metrics() | clock
    flight.save(tmp_path)
    saved = json.loads((tmp_path / "metrics.json").read_text())["vehicles"]
    assert saved["quad"] | clock == quad.metrics() | clock
    assert flight.metrics()["quad.max_abs_pitch"] == quad.metrics()["max_abs_pitch"]
    with pytest.raises(tiltsim.InputError, match=r"'qud.duration': .* did you mean quad\?"):
        flight.metrics()["qud.duration"]
    lines = summary(flight, [], judged=False, changes={}).splitlines()
    (row,) = (line for line in lines if "max_abs_pitch" in line)
    largest = (np.abs(flight[f"{prefix}pitch"]).max() for prefix in ("", "quad_", "wing_"))
    assert [float(text) for text in row.split()[1:4]] == pytest.approx([*largest], rel=1e-5)


def test_a_page_has_a_line_of_every_vehicle_and_panels_of_one_on_request():
    flight = tiltsim.simulate(together(QUAD, WING))
    pitch = next(axes for axes in flight.plot().axes if axes.get_ylabel() == "pitch (rad)")
    drawn = [line.get_ydata().tobytes() for line in pitch.lines]
    for prefix in ("", "quad_", "wing_"):
        assert flight[f"{prefix}pitch"].tobytes() in drawn
    assert len(flight.plot(panels="quad_position").axes) == 1
    (alone,) = flight.plot(panels="pitch", vehicle="quad").axes
    np.testing.assert_array_equal(alone.lines[0].get_ydata(), flight["quad_pitch"])
    line = refusal(flight.plot, vehicle="qad")
    assert "vehicle 'qad'" in line
    assert "did you mean quad? choose first vehicle, quad, wing" in line


def test_expectations_judge_every_vehicle_by_its_name():
    bounds = [{"metric": "quad.max_abs_pitch", "min": 1e-6}, {"metric": "quad.duration", "max": 0}]
    scenario = together(QUAD).replace({"expect": bounds})
    flight = tiltsim.simulate(scenario)
    pitch, duration = check_expectations(scenario, flight.metrics())
    assert pitch.measured == np.abs(flight["quad_pitch"]).max()
    assert (pitch.holds, duration.holds) == (True, False)


@pytest.mark.parametrize(
    ("companions", "metric", "line"),
    [
        ([QUAD], "qad.duration", "no vehicle qad; did you mean quad? choose quad"),
        ([QUAD], "quad.duraton", "did you mean duration?"),
        ([], "quad.duration", "no vehicle quad; there is no [[companion]]"),
    ],
)
def test_an_expectation_on_no_vehicle_is_refused_in_one_line(companions, metric, line):
    bound = {"expect": [{"metric": metric, "max": 1.0}]}
    said = refusal(together(*companions).replace, bound)
    assert f'expect.metric = "{metric}": {line}' in said


def test_a_sweep_has_columns_of_every_vehicle():
    document = {
        "scenario": together(QUAD).model_dump(mode="json", exclude_none=True),
        "set": {"simulation.duration": 0.02},
        "axis": [{"type": "list", "key": "initial.velocity[0]", "values": [0.0, 0.1]}],
        "metrics": ["max_abs_pitch", "quad.max_abs_pitch"],
        "plot": {"metrics": ["quad.max_abs_pitch"]},
    }
    results = tiltsim.sweep(document)
    flight = tiltsim.simulate(together(QUAD, **{"simulation.duration": 0.02}))
    expected = np.abs(flight["quad_pitch"]).max()
    assert results["quad.max_abs_pitch"].tolist() == [expected] * 2
    drawn = {axes.get_ylabel() for axes in sweep_figure(results).axes}
    assert drawn == {"quad: largest pitch (rad)"}
    wrong = document | {"metrics": ["wing.max_abs_pitch"], "plot": {}}
    line = refusal(tiltsim.sweep, wrong)
    assert 'metrics = "wing.max_abs_pitch": no vehicle wing; choose quad' in line


def test_tensions_have_a_panel_and_contacts_the_colors_of_vehicles():
    changes = {"simulation.duration": 0.05, "simulation.engine": "python", "expect": []}
    changes |= {"controller": {"law": "full_pose"}}
    flight = tiltsim.simulate(tiltsim.load_scenario("interaction/handover", changes))
    panels = {axes.get_title(loc="left"): axes for axes in flight.plot().axes}
    looks = {
        name: [(line.get_color(), line.get_ydata()) for line in panels[name].lines]
        for name in ("Contact force", "Cable tension")
    }
    for (_, values), cable in zip(looks["Cable tension"], ("first", "second"), strict=True):
        np.testing.assert_array_equal(values, flight[f"{cable}_cable_tension"])
    contacts = [color for color, _ in looks["Contact force"]]
    vehicles = flight.plot(panels="position_error").axes[0].lines
    assert contacts == [line.get_color() for line in vehicles]
    assert not {*contacts} & {color for color, _ in looks["Cable tension"]}
