"""Saved recordings: entities, rows and values against the flight; the command line."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.flights import flight, saved
from tests.views.recordings import entities, rerun_rrd, rows, scalars
from tests.views.viewer_shot import free_port
from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.flight.reading import load_flight
from tiltsim.scenario.loading import load_scenario
from tiltsim.simulation.simulate import simulate
from tiltsim.views.rerun.recording import Recording, save_recording
from tiltsim.views.rerun.timeline import TIMELINE
from tiltsim.views.rerun.viewer import require_viewer
from tiltsim.views.signals import signals_of

SERIES = {
    ("/attitude", 0): "roll",
    ("/tilt_angles", 4): "alpha_3",
    ("/tilt_angles", 5): "alpha_ref_3",
    ("/rotor_speeds", 1): "rotor_speed_2",
    ("/singularity", 0): "singularity_margin",
}
"""Columns by the entities of plots and their number in it."""


def error_axes(this):
    return "xyz" if this.assembly.follows_position else "z"


@pytest.fixture(scope="module", params=["fixed", "trot", "limited", "free", "supervised"])
def recorded(request, tmp_path_factory):
    """A recording and the flight read back from its Parquet file."""
    folder = saved(request.param, tmp_path_factory.mktemp("flights"))
    path = folder / "flight.rrd"
    save_recording([flight(request.param)], path)
    return path, load_flight(folder)


def test_a_recording_has_all_entities_and_one_timeline(recorded):
    from rerun.chunk import RrdReader

    path, this = recorded
    reader = RrdReader(path)
    assert [entry.application_id for entry in reader.recordings()] == ["tiltsim"]
    assert len(reader.blueprints()) == 1
    assert [index.name for index in reader.store().schema().index_columns()] == [TIMELINE]
    expected = {
        "/attitude",
        "/tilt_angles",
        "/position_error",
        "/events",
        "/plane/attitude",
        "/plane/margin",
        "/plane/trail",
    }
    expected |= {"/world/vehicle", "/world/camera", "/world/trail", "/plane/forbidden"}
    expected |= {f"/world/vehicle/pod_{i}/thrust" for i in (1, 2, 3, 4)}
    for panel in signals_of(this.assembly).values():
        expected |= {f"/{panel.path}/{level.name}" for level in panel.levels}
    if this.scenario.controller.decoupler != "none":
        expected.add("/world/reference/now")
    assert expected <= entities(path)


def test_time_series_agree_with_the_parquet_file(recorded):
    path, this = recorded
    for place, column in SERIES.items():
        times, values = scalars(path, *place)
        np.testing.assert_allclose(times, this["time"], atol=1e-9)
        np.testing.assert_array_equal(values, this[column])
    for number, axis in enumerate(error_axes(this)):
        _, values = scalars(path, "/position_error", number)
        np.testing.assert_array_equal(values, this[f"{axis}_ref"] - this[axis])


def test_a_supervisor_is_drawn_with_its_threshold(tmp_path):
    path, this = tmp_path / "flight.rrd", flight("supervised")
    save_recording([this], path)
    _, values = scalars(path, "/singularity", 1)
    np.testing.assert_array_equal(values, this["supervision"])
    _, levels = scalars(path, "/singularity/threshold")
    assert set(levels) == {0.9}


def test_poses_agree_with_the_parquet_file(recorded):
    path, this = recorded
    times, positions = rows(path, "/world/vehicle", "Transform3D:translation")
    assert len(times) == len(this)
    for at in (0, -1):
        expected = [this[axis][at] for axis in "xyz"]
        np.testing.assert_allclose(positions[at][0], expected, atol=1e-5)
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
        expected = (this["roll"][at], -this["pitch"][at])
        np.testing.assert_allclose(points[at][0], expected, atol=1e-6)
    _, labels = rows(path, "/plane/attitude", "Points2D:labels")
    assert labels[-1] == [f"margin {abs(this['singularity_margin'][-1]):.2f} rad"]


def test_the_curve_moves_with_the_gait_and_only_then(recorded):
    path, this = recorded
    times, curves = rows(path, "/plane/curve", "LineStrips2D:strips")
    if this.scenario.gait.type == "fixed":
        assert times.tolist() == [0.0]
        return
    assert 10 < len(times) <= round(this.end.time / 0.05) + 1
    assert all(len(row) <= 1 for row in curves)
    assert all(before != after for before, after in pairwise(curves))


def test_events_begin_and_end_with_the_flight(recorded):
    path, this = recorded
    times, texts = rows(path, "/events", "TextLog:text")
    assert (times[0], times[-1]) == (0.0, pytest.approx(this.end.time))
    assert texts[-1] == ["flight completed"]
    saturated = [text for (text,) in texts if "saturated" in text]
    assert bool(saturated) == (this.scenario.vehicle.max_rotor_speed is not None)


def test_the_rerun_tool_verifies_the_recording(recorded):
    done = rerun_rrd("verify", recorded[0])
    assert done.returncode == 0, done.stderr


def test_a_recording_is_small(recorded):
    path, this = recorded
    # At most 5 MB for 40 s at 100 Hz: the static data of all panels, and this much per row.
    assert path.stat().st_size < 1.0e6 + 1000 * len(this)


def test_two_runs_compare_equal(tmp_path):
    paths = [tmp_path / name for name in ("a.rrd", "b.rrd")]
    for path, this in zip(paths, (flight("trot"), simulate(flight("trot").scenario))):
        save_recording([this], path)
    done = rerun_rrd("compare", *paths)
    assert done.returncode == 0, done.stderr


def test_another_flight_does_not_compare_equal(tmp_path):
    paths = [tmp_path / name for name in ("fixed.rrd", "limited.rrd")]
    for path in paths:
        save_recording([flight(path.stem)], path)
    assert rerun_rrd("compare", "--unordered", *paths).returncode != 0


def test_a_flight_in_pieces_is_recorded_like_a_complete_one(tmp_path):
    this = flight("trot")
    paths = []
    for size in (len(this), 13):
        path = tmp_path / f"{size}.rrd"
        recording = Recording([this.assembly])
        (recorder,) = recording.recorders
        recording.stream.save(path)
        recorder.draw_references(this.end.time)
        for at in range(0, len(this), size):
            recorder.append(replace(this, samples=this.samples[at : at + size]))
        recorder.finish(this.end)
        recording.stream.disconnect()
        paths.append(path)
    whole, pieces = paths
    assert entities(whole) == entities(pieces)
    for entity, component in (
        ("/world/trail", "LineStrips3D:strips"),
        ("/plane/curve", "LineStrips2D:strips"),
        ("/plane/trail", "LineStrips2D:strips"),
        ("/world/floor", "Transform3D:translation"),
        ("/singularity", "Scalars:scalars"),
        ("/events", "TextLog:text"),
    ):
        expected, found = rows(whole, entity, component), rows(pieces, entity, component)
        np.testing.assert_array_equal(found[0], expected[0])
        assert found[1] == expected[1]


def test_several_flights_share_a_recording_under_distinct_names(tmp_path):
    path = tmp_path / "comparison.rrd"
    save_recording([flight("fixed"), flight("trot")], path)
    assert rerun_rrd("verify", path).returncode == 0
    for name in ("fixed", "trot"):
        times, values = scalars(path, f"/{name}/singularity/margin")
        np.testing.assert_array_equal(values, flight(name)["singularity_margin"])
        assert len(rows(path, f"/world/{name}/vehicle", "Transform3D:translation")[0]) == len(times)
        _, texts = rows(path, f"/events/{name}", "TextLog:text")
        assert all(text.startswith(f"{name}: ") for (text,) in texts)
        _, labels = rows(path, f"/plane/{name}/attitude", "Points2D:labels")
        assert len(labels) == len(flight(name))
        assert {f"/plane/{name}/{part}" for part in ("forbidden", "axes/grid")} <= entities(path)


def test_vehicle_and_reference_are_visible_from_any_distance(recorded):
    from rerun.chunk import RrdReader

    path, this = recorded
    expected = {"/world/camera/dot", "/world/reference/now"}
    if this.scenario.controller.decoupler == "none":
        expected.remove("/world/reference/now")
    radii = {}
    for chunk in RrdReader(path).stream().filter(is_static=True):
        if chunk.entity_path in expected:
            (radii[chunk.entity_path],) = chunk.to_record_batch()["Points3D:radii"].to_pylist()
    assert expected == radii.keys()
    assert all(radius < 0.0 for (radius,) in radii.values()), "in points of the screen"


@pytest.mark.slow
def test_run_and_view_write_equal_recordings(tmp_path, capsys):
    name = "ch04_tracking/setpoint#rho_065_modified"
    short = ["--set", "simulation.duration=0.3", "--quiet", "--out", str(tmp_path)]
    flown, viewed = tmp_path / "flown.rrd", tmp_path / "viewed.rrd"
    assert main(["run", name, *short, "--rerun", str(flown)]) in (0, 1)
    assert main(["view", str(tmp_path), "--rerun", str(viewed)]) == 0
    printed = capsys.readouterr().out
    assert printed.endswith(f"recording written to {viewed}; see it with tiltsim view {viewed}\n")
    done = rerun_rrd("compare", flown, viewed)
    assert done.returncode == 0, done.stderr


def test_a_full_disk_is_an_error_of_one_line(tmp_path, capfd):
    path = tmp_path / "flight.rrd"
    path.symlink_to("/dev/full")
    with pytest.raises(InputError, match=r"flight\.rrd: cannot be written: No space left"):
        save_recording([flight("fixed")], path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["view", "nothing"], "no such file"),
        (["view", "nothing.rrd"], "no such file"),
        (["view", "a.rrd", "b"], "a recording can only be opened"),
        (["run", "ch04_tracking/setpoint#rho_0_modified", "--rerun", "no/x.rrd"], "does not exist"),
        (["run", "ch04_tracking/setpoint#rho_0_modified", "--connect", "x"], "not a viewer's"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, words, capsys):
    assert main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize(("content", "words"), [(b"", "not a Rerun"), (b"PAR1", "not a Rerun")])
def test_a_file_without_a_recording_is_refused(content, words, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("opens the viewer"))
    monkeypatch.setenv("DISPLAY", ":0")
    path = tmp_path / "flight.RRD"
    path.write_bytes(content)
    assert main(["view", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_a_missing_screen_is_an_error_of_one_line(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=r"no screen .* --rerun FILE\.rrd"):
        require_viewer(None)


@pytest.mark.parametrize("how", ["run", "view", "live"])
def test_disabled_rerun_is_an_error_of_one_line(how, tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("RERUN", "Off")
    folder, target = saved("fixed", tmp_path), str(tmp_path / "flight.rrd")
    arguments = {
        "run": ["run", "ch04_tracking/setpoint#rho_065_modified", "--rerun", target],
        "view": ["view", str(folder), "--rerun", target],
        "live": ["run", "ch04_tracking/setpoint#rho_065_modified", "--live"],
    }
    assert main(arguments[how]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line == "tiltsim: RERUN=Off in the environment disables Rerun; unset it"


def test_a_port_without_a_viewer_is_an_error_of_one_line():
    with pytest.raises(InputError, match="no viewer listens there"):
        require_viewer(f"rerun+http://127.0.0.1:{free_port()}/proxy")


def test_vehicles_of_a_flight_have_separate_plots(tmp_path):
    companion = {"name": "wing", "offset": [2.0, 0.3, 0.0]}
    companion["changes"] = {"initial": {"attitude": [0.1, 0.05, 0.0]}}
    changes = {"simulation.duration": 0.1, "simulation.integrator": "implicitfast", "expect": []}
    scenario = load_scenario("fleet/hexarotor#hover", changes | {"companion": [companion]})
    flight = simulate(scenario)
    save_recording([flight], tmp_path / "both.rrd")
    found = entities(tmp_path / "both.rrd")
    for name, prefix in (("first\\ vehicle", ""), ("wing", "wing_")):
        for place in ((f"/{name}/attitude/pitch",), (f"/{name}/signals/attitude", 2)):
            values = scalars(tmp_path / "both.rrd", *place)[1]
            np.testing.assert_array_equal(values, flight[f"{prefix}pitch"])
    assert not any(path.startswith("/first\\ vehicle/signals/wing") for path in found)
    save_recording([flight], tmp_path / "wing.rrd", vehicle="wing")
    alone = scalars(tmp_path / "wing.rrd", "/attitude", 2)[1]
    np.testing.assert_array_equal(alone, flight["wing_pitch"])
    with pytest.raises(InputError, match="choose first vehicle, wing"):
        save_recording([flight], tmp_path / "none.rrd", vehicle="none")
