"""Recordings read back: entities, rows and values against the flight; live streams; the viewer."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import pytest

from tests.flights import flight, saved
from tests.views.viewer_shot import (
    free_port,
    missing_driver,
    shoot,
    viewer,
    viewer_process,
    wait_for,
)
from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.flight.reading import load_flight
from tiltsim.models.rotorcraft import MODELS, RotorcraftSpec, compile_model
from tiltsim.scenario.loading import load_scenario
from tiltsim.simulation.simulate import simulate
from tiltsim.views.attitude_plane import MOVING_TRAIL_TIME
from tiltsim.views.rerun.blueprint import flight_blueprint
from tiltsim.views.rerun.geometry import geom_archetypes, log_geometry
from tiltsim.views.rerun.live import LiveStream
from tiltsim.views.rerun.names import TIMELINE
from tiltsim.views.rerun.process import RecordingProcess
from tiltsim.views.rerun.recorder import FlightRecorder
from tiltsim.views.rerun.recording import make_recorders, new_recording, save_recording
from tiltsim.views.rerun.series import error_axes, limit_series
from tiltsim.views.rerun.viewer import require_viewer
from tiltsim_controllers.vehicle.parameters import PRESETS

SERIES = {
    "/attitude/roll": "roll",
    "/attitude/pitch_ref": "pitch_ref",
    "/tilt_angles/alpha_3": "alpha_3",
    "/tilt_angles/alpha_ref_3": "alpha_ref_3",
    "/rotor_speeds/rotor_2": "rotor_speed_2",
    "/singularity/margin": "singularity_margin",
}
needs_driver = pytest.mark.skipif(bool(missing_driver()), reason=missing_driver())


@pytest.fixture(autouse=True)
def strict(monkeypatch):
    """Let Rerun raise where it would only warn."""
    monkeypatch.setenv("RERUN_STRICT", "1")


@pytest.fixture(scope="module", params=["fixed", "trot", "limited", "free", "supervised"])
def recorded(request, tmp_path_factory):
    """A recording and the flight read back from its Parquet file."""
    folder = saved(request.param, tmp_path_factory.mktemp("flights"))
    path = folder / "flight.rrd"
    save_recording([flight(request.param)], path)
    return path, load_flight(folder)


def rerun_rrd(*arguments):
    program = Path(sys.executable).with_name("rerun")
    return subprocess.run(
        [str(program), "rrd", *map(str, arguments)], capture_output=True, text=True
    )


def entities(path):
    from rerun.chunk import RrdReader

    schema = RrdReader(path).store().schema()
    return {column.entity_path for column in schema.component_columns()}


def rows(path, entity, component):
    """Times (s) and values of one component, in order of time."""
    from rerun.chunk import RrdReader

    times, values = [], []
    for chunk in RrdReader(path).stream().filter(content=entity, is_static=False):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            times += batch.column(TIMELINE).cast(pa.int64()).to_pylist()
            values += batch.column(component).to_pylist()
    order = np.argsort(times, kind="stable")
    return np.array(times)[order] * 1e-9, [values[index] for index in order]


def scalars(path, entity):
    times, values = rows(path, entity, "Scalars:scalars")
    return times, np.array(values)[:, 0]


# --- saved recordings --------------------------------------------------------------------------


def test_a_recording_has_all_entities_and_one_timeline(recorded):
    from rerun.chunk import RrdReader

    path, this = recorded
    reader = RrdReader(path)
    assert [entry.application_id for entry in reader.recordings()] == ["tiltsim"]
    assert len(reader.blueprints()) == 1
    assert [index.name for index in reader.store().schema().index_columns()] == [TIMELINE]
    expected = {*SERIES, "/events", "/plane/attitude", "/plane/margin", "/plane/trail"}
    expected |= {"/world/vehicle", "/world/camera", "/world/trail", "/plane/forbidden"}
    expected |= {f"/world/vehicle/pod_{i}/thrust" for i in (1, 2, 3, 4)}
    expected |= {f"/position_error/{axis}" for axis in error_axes(this.scenario)}
    expected |= {f"/{series.path}" for series, _ in limit_series(this.scenario)}
    if this.scenario.controller.decoupler != "none":
        expected.add("/world/reference/now")
    assert expected <= entities(path)


def test_time_series_are_those_of_the_parquet_file(recorded):
    path, this = recorded
    for entity, column in SERIES.items():
        times, values = scalars(path, entity)
        np.testing.assert_allclose(times, this["time"], atol=1e-9)
        np.testing.assert_array_equal(values, this[column])
    for axis in error_axes(this.scenario):
        _, values = scalars(path, f"/position_error/{axis}")
        np.testing.assert_array_equal(values, this[f"{axis}_ref"] - this[axis])


def test_a_supervisor_is_drawn_with_its_threshold(tmp_path):
    path, this = tmp_path / "flight.rrd", flight("supervised")
    save_recording([this], path)
    _, values = scalars(path, "/singularity/supervision")
    np.testing.assert_array_equal(values, this["supervision"])
    _, levels = scalars(path, "/singularity/threshold")
    assert set(levels) == {0.9}


def test_poses_are_those_of_the_parquet_file(recorded):
    path, this = recorded
    times, positions = rows(path, "/world/vehicle", "Transform3D:translation")
    assert len(times) == len(this)
    for at in (0, -1):
        wanted = [this[axis][at] for axis in "xyz"]
        np.testing.assert_allclose(positions[at][0], wanted, atol=1e-5)
    _, turns = rows(path, "/world/vehicle/pod_1", "Transform3D:quaternion")
    half = 0.5 * this["alpha_1"]
    np.testing.assert_allclose(np.array(turns)[:, 0, 0], np.sin(half), atol=1e-6)
    np.testing.assert_allclose(np.array(turns)[:, 0, 3], np.cos(half), atol=1e-6)


def test_thrust_arrows_are_as_long_as_their_thrust(recorded):
    path, this = recorded
    for rotor in (1, 4):
        _, vectors = rows(path, f"/world/vehicle/pod_{rotor}/thrust", "Arrows3D:vectors")
        length = np.array(vectors)[:, 0, 2]
        np.testing.assert_allclose(length, 0.2 * this[f"thrust_{rotor}"], rtol=1e-5)


def test_the_plane_has_the_attitude_with_pitch_upwards(recorded):
    path, this = recorded
    times, points = rows(path, "/plane/attitude", "Points2D:positions")
    assert len(times) == len(this)
    for at in (0, -1):
        wanted = (this["roll"][at], -this["pitch"][at])
        np.testing.assert_allclose(points[at][0], wanted, atol=1e-6)
    _, labels = rows(path, "/plane/attitude", "Points2D:labels")
    assert labels[-1] == [f"margin {abs(this['singularity_margin'][-1]):.2f} rad"]


def test_the_curve_moves_with_the_gait_and_only_then(recorded):
    path, this = recorded
    times, curves = rows(path, "/plane/curve", "LineStrips2D:strips")
    if this.scenario.gait.type == "fixed":
        assert times.tolist() == [0.0]
        return
    assert 10 < len(times) <= this.end.time / 0.05 + 1
    assert all(len(row) <= 1 for row in curves)
    assert all(before != after for before, after in pairwise(curves))


def test_events_begin_and_end_with_the_flight(recorded):
    path, this = recorded
    times, texts = rows(path, "/events", "TextLog:text")
    assert (times[0], times[-1]) == (0.0, pytest.approx(this.end.time))
    assert texts[-1] == ["flight completed"]
    saturated = [text for (text,) in texts if "saturated" in text]
    assert bool(saturated) == (this.scenario.vehicle.max_rotor_speed is not None)


def test_the_viewers_own_tool_verifies_the_recording(recorded):
    done = rerun_rrd("verify", recorded[0])
    assert done.returncode == 0, done.stderr


def test_a_recording_is_small(recorded):
    path, this = recorded
    # Below 5 MB for 40 s at 100 Hz: what does not move, and so much a row.
    assert path.stat().st_size < 0.8e6 + 1000 * len(this)


def test_two_runs_compare_equal(tmp_path):
    scenario = flight("trot").scenario
    paths = [tmp_path / name for name in ("a.rrd", "b.rrd")]
    for path in paths:
        save_recording([simulate(scenario)], path)
    done = rerun_rrd("compare", *paths)
    assert done.returncode == 0, done.stderr


def test_another_flight_does_not_compare_equal(tmp_path):
    paths = [tmp_path / name for name in ("fixed.rrd", "limited.rrd")]
    for path in paths:
        save_recording([flight(path.stem)], path)
    assert rerun_rrd("compare", "--unordered", *paths).returncode != 0


def test_a_flight_in_pieces_is_recorded_like_a_whole_one(tmp_path):
    this = flight("trot")
    paths = []
    for size in (len(this), 13):
        path = tmp_path / f"{size}.rrd"
        recording = new_recording([this.scenario])
        recording.save(path)
        recorder = FlightRecorder(recording, this.scenario)
        recorder.begin()
        recorder.draw_references(this.end.time)
        for at in range(0, len(this), size):
            recorder.append(replace(this, samples=this.samples[at : at + size]))
        recorder.finish(this.end)
        recording.disconnect()
        paths.append(path)
    whole, pieces = paths
    assert entities(whole) == entities(pieces)
    for entity, component in (
        ("/world/trail", "LineStrips3D:strips"),
        ("/plane/curve", "LineStrips2D:strips"),
        ("/plane/trail", "LineStrips2D:strips"),
        ("/world/floor", "Transform3D:translation"),
        ("/singularity/margin", "Scalars:scalars"),
        ("/events", "TextLog:text"),
    ):
        expected, found = rows(whole, entity, component), rows(pieces, entity, component)
        np.testing.assert_array_equal(found[0], expected[0])
        assert found[1] == expected[1]


def test_several_flights_share_a_recording_under_names_of_their_own(tmp_path):
    path = tmp_path / "comparison.rrd"
    save_recording([flight("fixed"), flight("trot")], path)
    assert rerun_rrd("verify", path).returncode == 0
    for name in ("fixed", "trot"):
        times, values = scalars(path, f"/{name}/singularity/margin")
        np.testing.assert_array_equal(values, flight(name)["singularity_margin"])
        assert len(rows(path, f"/world/{name}/vehicle", "Transform3D:translation")[0]) == len(times)
        _, texts = rows(path, f"/events/{name}", "TextLog:text")
        assert all(text.startswith(f"{name}: ") for (text,) in texts)


def test_compared_flights_have_their_margins_in_the_plot_alone(tmp_path):
    """Labels of several would hide each other in the plane."""
    alone, compared = tmp_path / "alone.rrd", tmp_path / "compared.rrd"
    save_recording([flight("fixed")], alone)
    save_recording([flight("fixed"), flight("trot")], compared)
    _, labels = rows(alone, "/plane/attitude", "Points2D:labels")
    assert len(labels) == len(flight("fixed"))
    _, labels = rows(compared, "/plane/fixed/attitude", "Points2D:labels")
    assert labels == []


def test_vehicle_and_reference_are_seen_from_however_far(recorded):
    from rerun.chunk import RrdReader

    path, this = recorded
    wanted = {"/world/camera/dot", "/world/reference/now"}
    if this.scenario.controller.decoupler == "none":
        wanted.remove("/world/reference/now")
    radii = {}
    for chunk in RrdReader(path).stream().filter(is_static=True):
        if chunk.entity_path in wanted:
            (radii[chunk.entity_path],) = chunk.to_record_batch()["Points3D:radii"].to_pylist()
    assert wanted == radii.keys()
    assert all(radius < 0.0 for (radius,) in radii.values()), "in points of the screen"


# --- the blueprint -----------------------------------------------------------------------------


def views_of(*scenarios, names=()):
    """The views that flights of these scenarios are shown in, by their titles."""
    recorders = make_recorders(new_recording(scenarios, names), scenarios, names)
    blueprint = flight_blueprint([recorder.shown() for recorder in recorders])
    found, waiting = {}, [blueprint.root_container]
    while waiting:
        part = waiting.pop()
        waiting += [inner for inner in part.contents if hasattr(inner, "column_shares")]
        found |= {view.name: view for view in part.contents if not hasattr(view, "column_shares")}
    return found


def test_a_vehicle_without_tilt_angles_has_no_plot_of_them():
    tilts = "Tilt angles (rad)"
    quadrotor = views_of(load_scenario("ch01_gust/hover#quadrotor")).keys()
    assert views_of(flight("fixed").scenario).keys() - quadrotor == {tilts}


def test_compared_flights_have_one_legend():
    def legends(*names):
        views = views_of(*(flight(name).scenario for name in names)).values()
        plots = [view.properties["PlotLegend"] for view in views if "PlotLegend" in view.properties]
        return [legend.visible.as_arrow_array().to_pylist() == [True] for legend in plots]

    assert legends("fixed") == [True] * 5
    assert sorted(legends("fixed", "trot")) == [False] * 4 + [True]


@pytest.mark.parametrize(("name", "whole"), [("fixed", True), ("trot", False)])
def test_the_attitudes_trail_is_short_beside_a_curve_that_moves(name, whole):
    view = views_of(flight(name).scenario)["Attitude (shaded: unacceptable attitudes)"]
    (shown,) = view.visualizer_overrides["plane/trail"].ranges.as_arrow_array().to_pylist()
    assert shown["range"]["start"] == (None if whole else -1e9 * MOVING_TRAIL_TIME)


def test_flights_of_one_scenario_are_recorded_under_their_folders(tmp_path, capsys):
    folders = [tmp_path / "mod", tmp_path / "with a.dot"]
    for folder in folders:
        flight("fixed").save(folder)
    path = tmp_path / "both.rrd"
    assert main(["view", *map(str, folders), "--rerun", str(path)]) == 0
    assert {"/mod/singularity/margin", r"/with\ a.dot/singularity/margin"} <= entities(path)


def test_the_plots_of_compared_flights_find_lines_of_any_name():
    view = views_of(*[flight("fixed").scenario] * 2, names=("mod", "a b"))[
        "Singularity margin and threshold (rad)"
    ]
    assert [line.partition("/singularity")[0] for line in view.contents[:2]] == ["mod", r"a\ b"]


# --- any model ---------------------------------------------------------------------------------

SHAPES = """
<mujoco>
  <asset>
    <material name="red" rgba="1 0 0 1"/>
    <mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
    <hfield name="hill" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 0 1"/>
  </asset>
  <worldbody>
    <geom name="ground" type="plane" size="0 0 1"/>
    <geom name="table" type="plane" size="1 2 1"/>
    <geom name="hill" type="hfield" hfield="hill"/>
    <body name="odd/name">
      <freejoint/>
      <geom name="box" type="box" size="1 1 1" material="red"/>
      <geom name="ball" type="sphere" size="1"/>
      <geom name="egg" type="ellipsoid" size="1 2 3"/>
      <geom name="can" type="cylinder" size="1 2"/>
      <geom type="capsule" size="1 2" pos="0 0 5" euler="90 0 0"/>
      <geom name="wedge" type="mesh" mesh="wedge"/>
      <geom name="hidden" type="sphere" size="1" group="3"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_every_shape_of_any_model_is_drawn_or_named(tmp_path):
    import rerun as rr

    model = mujoco.MjModel.from_xml_string(SHAPES)
    path = tmp_path / "shapes.rrd"
    with rr.RecordingStream("test") as recording:
        recording.save(path)
        assert log_geometry(recording, model, "world") == ["hill"]
    names = {entity.rpartition("/")[2] for entity in entities(path)}
    assert {"table", "box", "ball", "egg", "can", "wedge"} <= names
    assert any(name.startswith("geom_") for name in names), "a geom without a name"
    assert not names & {"ground", "hidden", "hill"}


@pytest.mark.parametrize("vehicle", MODELS)
def test_every_vehicle_is_drawn_whole(vehicle, tmp_path):
    import rerun as rr

    model = compile_model(RotorcraftSpec(vehicle, PRESETS["ar_drone_2"]))
    path = tmp_path / "vehicle.rrd"
    with rr.RecordingStream("test") as recording:
        recording.save(path)
        assert log_geometry(recording, model, "world") == []
    visible = [geom for geom in range(model.ngeom) if model.geom_group[geom] == 2]
    drawn = {entity.rpartition("/")[2] for entity in entities(path)}
    assert {model.geom(geom).name for geom in visible} <= drawn


def test_a_capsule_begins_where_mujocos_does():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    capsule = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE)[0])
    (archetype,) = geom_archetypes(model, capsule)
    start = archetype.translations.as_arrow_array().to_pylist()[0]
    np.testing.assert_allclose(start, (0.0, 2.0, 5.0), atol=1e-6)


def test_a_geom_without_a_colour_has_its_materials():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    (archetype,) = geom_archetypes(model, model.geom("box").id)
    assert archetype.colors.as_arrow_array().to_pylist() == [0xFF0000FF]


# --- the command line --------------------------------------------------------------------------


def test_run_and_view_write_equal_recordings(tmp_path, capsys):
    name = "ch04_tracking/setpoint#rho_065_modified"
    short = ["--set", "simulation.duration=0.3", "--quiet", "--out", str(tmp_path)]
    flown, viewed = tmp_path / "flown.rrd", tmp_path / "viewed.rrd"
    assert main(["run", name, *short, "--rerun", str(flown)]) in (0, 1)
    assert main(["view", str(tmp_path), "--rerun", str(viewed)]) == 0
    assert f"open it with: rerun {viewed}" in capsys.readouterr().out
    done = rerun_rrd("compare", flown, viewed)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def full_disk(monkeypatch):
    """The next recording goes to where there is no room."""
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")

    @contextmanager
    def to_nowhere(_path):
        yield Path("/dev/full")

    monkeypatch.setattr("tiltsim.views.rerun.recording.replacing", to_nowhere)


def test_a_full_disk_is_said_in_one_line(full_disk, tmp_path, capfd):
    path = tmp_path / "flight.rrd"
    with pytest.raises(InputError, match=r"flight\.rrd: cannot be written: No space left"):
        save_recording([flight("fixed")], path)
    assert capfd.readouterr().err == ""


def test_the_recordings_process_tells_what_went_wrong(tmp_path):
    path = tmp_path / "no folder" / "flight.rrd"
    with RecordingProcess(flight("fixed").scenario) as process:
        process.start(flight("fixed"), path)
        with pytest.raises(InputError, match=r"flight\.rrd: cannot be written: No such file"):
            process.finish()


def test_a_recording_whose_process_is_killed_is_written_all_the_same(tmp_path):
    this, paths = flight("trot"), [tmp_path / "a.rrd", tmp_path / "b.rrd"]
    with RecordingProcess(this.scenario) as process:
        process._process.kill()
        process._process.wait()
        process.start(this, paths[0])
        process.finish()
    save_recording([this], paths[1])
    done = rerun_rrd("compare", *paths)
    assert done.returncode == 0, done.stderr


def test_the_recordings_process_ends_with_a_flight_that_comes_to_nothing():
    with pytest.raises(KeyboardInterrupt), RecordingProcess(flight("trot").scenario) as process:
        raise KeyboardInterrupt
    assert process._process.returncode is not None


def test_the_recordings_process_says_nothing_where_its_answer_is_not_awaited(tmp_path, capfd):
    """As where another file of the flight cannot be written."""
    path = tmp_path / "flight.rrd"
    with RecordingProcess(flight("fixed").scenario) as process:
        process.start(flight("fixed"), path)
    assert process._process.returncode == 0
    assert path.is_file()
    assert capfd.readouterr().err == ""


def test_the_recordings_process_says_nothing_of_half_a_flight(capfd):
    with RecordingProcess(flight("fixed").scenario) as process:
        process._work = flight("fixed"), Path("nowhere")
        process._process.stdin.write(pickle.dumps(process._work)[:1000])
    assert process._process.returncode == 0
    assert capfd.readouterr().err == ""


def test_the_recordings_process_ends_with_the_one_that_it_serves(tmp_path):
    """Also when that is killed, with no time to clean up."""
    program = (
        "import os, signal; from tests.flights import flight; "
        "from tiltsim.views.rerun import RecordingProcess; "
        "RecordingProcess(flight('fixed').scenario); os.kill(os.getpid(), signal.SIGKILL)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    # Both write to one pipe, of which the end is seen when both have ended.
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, stderr=subprocess.PIPE, text=True, timeout=30)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")


def test_a_flight_is_recorded_without_loading_rerun_beside_it(tmp_path):
    path = tmp_path / "flight.rrd"
    options = ["--set", "simulation.duration=0.1", "--set", "expect=[]", "--quiet"]
    arguments = ["run", "ch04_tracking/setpoint#rho_065_modified", *options, "--rerun", str(path)]
    program = (
        f"import sys; from tiltsim.cli import main; main({arguments!r}); "
        "assert 'rerun' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert path.is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["view", "nothing"], "no such file"),
        (["view", "nothing.rrd"], "no such file"),
        (["view", "a.rrd", "b"], "a recording is opened as it is"),
        (["run", "ch04_tracking/setpoint#rho_0_modified", "--rerun", "no/x.rrd"], "does not exist"),
        (["run", "ch04_tracking/setpoint#rho_0_modified", "--connect", "x"], "not a viewer's"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, words, capsys):
    assert main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize(("content", "words"), [(b"", "not a Rerun"), (b"PAR1", "not a Rerun")])
def test_what_is_no_recording_is_said_in_one_line(content, words, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("opens the viewer"))
    monkeypatch.setenv("DISPLAY", ":0")
    path = tmp_path / "flight.RRD"
    path.write_bytes(content)
    assert main(["view", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_no_screen_is_said_in_one_line(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=r"no screen .* --rerun FILE\.rrd"):
        require_viewer(None)


@pytest.mark.parametrize("how", ["run", "view", "live"])
def test_rerun_switched_off_is_said_in_one_line(how, tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("RERUN", "Off")
    folder, target = saved("fixed", tmp_path), str(tmp_path / "flight.rrd")
    arguments = {
        "run": ["run", "ch04_tracking/setpoint#rho_065_modified", "--rerun", target],
        "view": ["view", str(folder), "--rerun", target],
        "live": ["run", "ch04_tracking/setpoint#rho_065_modified", "--live"],
    }
    assert main(arguments[how]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line == "tiltsim: RERUN=Off in the environment switches Rerun off; unset it"


def test_a_port_where_nobody_listens_is_said_in_one_line():
    with pytest.raises(InputError, match="no viewer listens there"):
        require_viewer(f"rerun+http://127.0.0.1:{free_port()}/proxy")


# --- live --------------------------------------------------------------------------------------


class Wall:
    """A recorder that takes nothing for a while, or at all."""

    def __init__(self, error=None):
        self.released = threading.Event()
        self.error = error
        self.samples = 0

    def begin(self):
        pass

    def draw_references(self, _until):
        pass

    def append(self, piece):
        if self.error:
            raise self.error
        self.samples += len(piece)
        self.released.wait(60.0)

    def finish(self, _end):
        pass


@pytest.fixture
def listener():
    """The address of something that listens but never answers."""
    import socket

    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy"


def stream_to(recorder, url, monkeypatch, farewell=30.0):
    from tiltsim.views.rerun import live

    monkeypatch.setattr(live, "attach_viewer", lambda *_: None)
    monkeypatch.setattr(live, "SHUTDOWN_TIMEOUT", farewell)
    stream = LiveStream(flight("fixed").scenario, url)
    monkeypatch.setattr(stream, "_recorder", recorder)
    return stream


def test_a_viewer_that_takes_nothing_does_not_hold_the_flight_up(listener, monkeypatch, capsys):
    wall = Wall()
    began = time.monotonic()
    with stream_to(wall, listener, monkeypatch, farewell=0.3) as stream:
        this = simulate(flight("fixed").scenario, stream)
        stream.finish(this.end)
    assert time.monotonic() - began < 30.0, "the wall stands for a minute"
    assert "the viewer does not answer" in capsys.readouterr().err
    assert this.end.kind == "completed"
    np.testing.assert_array_equal(this.samples, flight("fixed").samples)
    wall.released.set()


def test_a_stream_that_breaks_is_one_line_and_no_loss(listener, monkeypatch, capsys):
    with stream_to(Wall(OSError("gone")), listener, monkeypatch) as stream:
        this = simulate(flight("fixed").scenario, stream)
        stream.finish(this.end)
    assert this.end.kind == "completed"
    assert capsys.readouterr().err == "tiltsim: live view ended: gone\n"


def test_all_samples_reach_the_recorder_in_order(listener, monkeypatch):
    pieces = []

    class Taker(Wall):
        def append(self, piece):
            pieces.append(piece.samples)

    with stream_to(Taker(), listener, monkeypatch) as stream:
        this = simulate(flight("fixed").scenario, stream)
    np.testing.assert_array_equal(np.concatenate(pieces), this.samples)


# --- the viewer itself -------------------------------------------------------------------------


@pytest.mark.viewer
@needs_driver
@pytest.mark.parametrize("names", [["fixed"], ["trot"], ["free"], ["tilt_car"], ["fixed", "trot"]])
def test_the_viewer_shows_recordings_without_complaints(names, tmp_path):
    path = tmp_path / "flight.rrd"
    save_recording([flight(name) for name in names], path)
    shot = shoot(path, 1.0)
    assert shot.reports == []
    assert len(shot.views) == (8 if names == ["tilt_car"] else 9)
    assert shot.png.startswith(b"\x89PNG")


@pytest.mark.viewer
@needs_driver
def test_the_viewer_receives_a_live_flight():
    port = free_port()
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    with viewer("800x600", port) as client:
        with LiveStream(flight("fixed").scenario, url) as stream:
            stream.finish(simulate(flight("fixed").scenario, stream).end)
        (recording,) = wait_for(lambda: client.get_state().recordings, "the live recording")
        assert "tiltsim" in str(recording)


@pytest.mark.viewer
@needs_driver
@pytest.mark.parametrize("stop", ["kill", "freeze"])
def test_closing_the_viewer_leaves_the_flight_whole(stop, tmp_path):
    port = free_port()
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    name = "ch04_tracking/setpoint#rho_065_modified"
    options = ["--set", "simulation.duration=8", "--set", "simulation.engine=python", "--quiet"]
    command = [sys.executable, "-m", "tiltsim", "run", name, "--connect", url, *options]
    with viewer_process(port) as process:
        wait_for(lambda: listens(url), "the viewer to listen")
        sent = signal.SIGKILL if stop == "kill" else signal.SIGSTOP
        timer = threading.Timer(3.0, process.send_signal, [sent])
        timer.start()
        done = subprocess.run([*command, "--out", str(tmp_path)], timeout=120)
        timer.join()
        if stop == "freeze":
            process.send_signal(signal.SIGCONT)
    assert done.returncode in (0, 1)
    this = load_flight(tmp_path)
    assert (this.end.kind, len(this)) == ("completed", 801)
    assert (tmp_path / "metrics.json").is_file()


def listens(url):
    try:
        require_viewer(url)
    except InputError:
        return False
    return True
