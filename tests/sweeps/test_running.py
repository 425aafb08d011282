"""Sweeps that are interrupted, continued, shared out: always the same rows."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from itertools import pairwise

import pyarrow.parquet as pq
import pytest

from tests.sweeps.files import boundary_sweep, short_sweep
from tests.system.test_files import HEX
from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.scenario.loading import parse_scenario
from tiltsim.scenario.metric_names import METRICS, Metric
from tiltsim.simulation import batch
from tiltsim.simulation.simulate import simulate
from tiltsim.sweeps import chunks, points, running
from tiltsim.sweeps.chunks import ChunkWork, fly_points
from tiltsim.sweeps.dataset import load_results, open_sweep_folder
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.running import run_sweep
from tiltsim.system.processes import ProcessDiedError
from tiltsim.views.figures.sweep import sweep_figure


def rows(folder):
    return pq.read_table(folder / "sweep.parquet").to_pylist()


def command(file, folder, *options):
    arguments = [sys.executable, "-m", "tiltsim", "sweep", str(file), "--out", str(folder)]
    return [*arguments, "--quiet", *options]


def parts_in(folder):
    return len(list(folder.glob("parts/[0-9]*.parquet")))


DYING = """
import os, signal, sys
from itertools import count, product
from pathlib import Path
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.running import run_sweep

definition, folder, jobs = load_sweep(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
replace = Path.replace


def fly(death):
    numbers = count(1)

    def die(temporary, file):
        number = next(numbers)
        if death == ("before", number):
            os.kill(os.getpid(), signal.SIGKILL)
        replace(temporary, file)
        if death == ("after", number):
            os.kill(os.getpid(), signal.SIGKILL)

    Path.replace = die
    run_sweep(definition, folder, jobs=jobs)


if jobs > 1:
    fly(("after", 4))
while not (folder / "sweep.parquet").exists():
    for death in product(("before", "after"), (1, 2)):
        child = os.fork()
        if child == 0:
            fly(death)
            os._exit(0)
        assert os.waitpid(child, 0)[1] == signal.SIGKILL
        print(*sorted(file.name for file in folder.glob("**/[!.]*.parquet")))
"""
"""A sweep killed before and after it renames the definition, and then the next file, each time.

With several processes, their parent is killed after the third part.
"""


def test_rows_hold_what_was_flown(tmp_path):
    definition = load_sweep(short_sweep(tmp_path / "sweep.toml"))
    sweep = SweepPoints(definition)
    assert run_sweep(definition, tmp_path / "out") == tmp_path / "out" / "sweep.parquet"
    table = rows(tmp_path / "out")
    assert [row["index"] for row in table] == list(range(12))
    for row in table:
        point = sweep.point(row["index"])
        assert {key: row[key] for key in point} == point
        scenario = parse_scenario(json.loads(row["scenario"]))
        assert scenario.model_dump() == sweep.scenario(point).model_dump()
        assert row["mujoco_version"] == definition.versions["mujoco"]
        assert row["end"] == "completed"
    flight = simulate(parse_scenario(json.loads(table[7]["scenario"])))
    kept = {name: value for name, value in flight.metrics().items() if name != "realtime_factor"}
    assert {name: table[7][name] for name in kept} == kept
    assert "realtime_factor" not in table[7]


def test_a_sweep_continues_where_it_stopped(tmp_path, monkeypatch):
    definition = load_sweep(short_sweep(tmp_path / "sweep.toml"))
    whole = run_sweep(definition, tmp_path / "whole")
    flown = []
    original = chunks.fly_points

    def fly_points(sweep, points, engine, **options):
        flown.append(list(points))
        if len(flown) == 3:
            raise KeyboardInterrupt
        return original(sweep, points, engine, **options)

    monkeypatch.setattr(chunks, "fly_points", fly_points)
    with pytest.raises(KeyboardInterrupt):
        run_sweep(definition, tmp_path / "parts")
    leftover = tmp_path / "parts" / "parts" / f".000003.parquet.{HEX}.new"
    leftover.write_bytes(b"half")
    reports = []
    continued = run_sweep(definition, tmp_path / "parts", report=reports.append)
    assert flown == [[0, 1, 2], [3, 4, 5], [6, 7, 8], [6, 7, 8], [9, 10, 11]]
    assert reports == [6, 9, 12]
    assert not leftover.exists()
    assert continued.read_bytes() == whole.read_bytes()
    run_sweep(definition, tmp_path / "parts")
    assert len(flown) == 5  # nothing is flown twice


def test_another_definition_is_refused_with_the_difference(tmp_path):
    run_sweep(load_sweep(short_sweep(tmp_path / "sweep.toml", count=2)), tmp_path / "out")
    other = load_sweep(short_sweep(tmp_path / "sweep.toml", count=3))
    with pytest.raises(InputError, match=r"sample.count was 2 and is 3"):
        run_sweep(other, tmp_path / "out")


def test_other_results_are_not_written_over(tmp_path):
    definition = load_sweep(short_sweep(tmp_path / "sweep.toml"))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "flight.parquet").touch()
    with pytest.raises(InputError, match="other results"):
        run_sweep(definition, tmp_path / "out")


def test_two_sweeps_do_not_share_a_folder(tmp_path):
    definition = load_sweep(short_sweep(tmp_path / "sweep.toml"))
    with (
        open_sweep_folder(tmp_path / "out", SweepPoints(definition)),
        pytest.raises(InputError, match="another tiltsim sweep"),
    ):
        run_sweep(definition, tmp_path / "out")


def test_a_bad_flight_becomes_a_row(tmp_path, monkeypatch):
    original = batch.simulate_assembly

    def simulate(assembly):
        if assembly.scenario.initial.attitude[0] > 0.0:
            raise RuntimeError("no such luck")
        return original(assembly)

    monkeypatch.setattr(batch, "simulate_assembly", simulate)
    run_sweep(load_sweep(short_sweep(tmp_path / "sweep.toml")), tmp_path / "out")
    for row in rows(tmp_path / "out"):
        bad = row["initial.attitude[0]"] > 0.0
        assert row["end"] == ("crashed" if bad else "completed")
        assert row["cause"] == ("RuntimeError: no such luck" if bad else "")
        assert (row["max_abs_roll"] is None) == bad


@pytest.mark.parametrize("chunk", [1, 16])
def test_a_sweep_whose_flights_all_crash_stops_after_the_first_few(tmp_path, monkeypatch, chunk):
    tried = []

    def simulate(assembly):
        tried.append(assembly)
        raise TypeError("no such luck")

    monkeypatch.setattr(batch, "simulate_assembly", simulate)
    file = short_sweep(tmp_path / "sweep.toml", count=16, chunk_size=chunk)
    found = r"every flight tried, from all over the sweep, crashed with TypeError: no such luck$"
    with pytest.raises(InputError, match=found):
        run_sweep(load_sweep(file), tmp_path / "out")
    assert len(tried) < 8
    assert not parts_in(tmp_path / "out")


def test_code_that_is_not_trusted_is_not_tried_either(tmp_path, monkeypatch):
    code = tmp_path / "own.py"
    code.write_text("def law(observation): ...")
    laws = {"ours": {}, "own": {"controller": {"law": "python", "function": f"{code}:law"}}}
    axes = [
        {"type": "cases", "key": "law", "cases": laws},
        {"type": "list", "key": "initial.attitude[0]", "values": [0.0, 0.1, 0.2]},
    ]
    simulation = {"duration": 0.01, "engine": "python"}
    points = SweepPoints(load_sweep({"scenario": {"simulation": simulation}, "axis": axes}))
    tried = []

    def simulate(assembly):
        tried.append(assembly.scenario.controller.law)
        raise TypeError("no such luck")

    monkeypatch.setattr(batch, "simulate_assembly", simulate)
    with pytest.raises(InputError, match="every flight tried"):
        fly_points(points, range(3), None)
    assert "python" not in tried


def test_points_without_a_valid_scenario_become_rows(tmp_path, capsys):
    file = short_sweep(tmp_path / "sweep.toml", count=32)
    text = file.read_text().replace("0.1", "0.2").replace("mean = 0.0", "mean = 2.9")
    file.write_text(text.replace("seed = 3", "seed = 5"))
    assert main(["sweep", str(file), "--jobs", "1", "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"\nmost frequent reason \(\d of 8\): .* to 3\.14159\n", shown)
    ends = {row["end"] for row in rows(tmp_path / "out")}
    for row in rows(tmp_path / "out"):
        assert (row["end"] == "invalid") == (abs(row["initial.attitude[0]"]) > 3.141592653589793)
    assert "invalid" in ends


def test_a_sweep_without_a_valid_scenario_fails(tmp_path, capsys, monkeypatch):
    def refuse(_assembly):
        raise InputError("no such mesh")

    monkeypatch.setattr(batch, "simulate_assembly", refuse)
    file = short_sweep(tmp_path / "sweep.toml", count=1)
    options = ["--jobs", "1", "--quiet", "--out", str(tmp_path / "out")]
    for _ in range(2):  # flown, then read
        assert main(["sweep", str(file), *options]) == 2
        message = "tiltsim: nothing could be flown; most frequent reason (2 of 2): no such mesh\n"
        assert capsys.readouterr().err == message
    assert {row["end"] for row in rows(tmp_path / "out")} == {"invalid"}


def test_flights_are_kept_if_requested(tmp_path):
    file = short_sweep(tmp_path / "sweep.toml", count=2)
    file.write_text("keep_flights = true\n" + file.read_text())
    run_sweep(load_sweep(file), tmp_path / "out")
    files = sorted((tmp_path / "out" / "flights").iterdir())
    assert [file.name for file in files] == [f"{index:07d}.parquet" for index in range(4)]
    table = rows(tmp_path / "out")
    roll = pq.read_table(files[2])["roll"].to_numpy()
    assert abs(roll).max() == table[2]["max_abs_roll"]


def test_boundaries_are_found_to_their_tolerance(tmp_path):
    run_sweep(load_sweep(boundary_sweep(tmp_path / "sweep.toml")), tmp_path / "out")
    for row in rows(tmp_path / "out"):
        assert row["roll"] < 0.2345 < row["roll_beyond"] + 0.002
        assert 0.0 < row["roll_beyond"] - row["roll"] <= 0.001
        assert row["flights"] == 4 + 7
        assert row["max_abs_roll"] <= 0.2345
        assert row["initial.attitude"] == [row["roll"], 0.0, 2 * row["roll"]]


@pytest.mark.slow
def test_killed_at_every_file_it_continues_to_the_same_dataset(tmp_path):
    file = short_sweep(tmp_path / "sweep.toml", count=3, chunk_size=2)
    whole = run_sweep(load_sweep(file), tmp_path / "whole")
    flown = subprocess.run(
        [sys.executable, "-c", DYING, file, tmp_path / "killed", "1"],
        **{"check": True, "capture_output": True, "text": True},
    )
    parts = [f"{number:06d}.parquet" for number in range(3)]
    left = [*(parts[:number] for number in range(4)), [*parts, "sweep.parquet"]]
    found = [line.split() for line in flown.stdout.splitlines()]
    # Only the last of four kills, after the renaming, finds another file in the folder.
    assert found == [x for old, new in pairwise(left) for x in (old, old, old, new)]
    assert (tmp_path / "killed" / "sweep.parquet").read_bytes() == whole.read_bytes()


@pytest.mark.slow
def test_processes_of_a_killed_sweep_end_and_others_continue_to_the_same_dataset(tmp_path):
    file = short_sweep(tmp_path / "sweep.toml", count=80, chunk_size=8)
    whole = run_sweep(load_sweep(file), tmp_path / "whole")
    folder = tmp_path / "out"
    arguments = [sys.executable, "-c", DYING, file, folder, "2"]
    process = subprocess.Popen(arguments, start_new_session=True)
    process.wait()
    deadline = time.monotonic() + 300.0
    while time.monotonic() < deadline:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            break
        time.sleep(0.1)
    else:
        os.killpg(process.pid, signal.SIGKILL)
        pytest.fail("processes outlive their parent")
    reports = []
    continued = run_sweep(load_sweep(file), folder, jobs=2, report=reports.append)
    assert reports[0] == 3 * 8  # the parent alone was killed, after the third part
    assert continued.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("times", [2, 3])
def test_all_processes_may_die_at_once_but_not_again_and_again(times, monkeypatch):
    """As when memory runs out under all of them."""
    rounds = []

    def in_processes(_work, items, jobs):
        rounds.append(items)
        for item in items:
            future = Future()
            if len(rounds) <= times:
                future.set_exception(ProcessDiedError())
            else:
                future.set_result(item)
            yield item, future

    monkeypatch.setattr(running, "in_processes", in_processes)
    flown = running.fly_on_processes(ChunkWork("", None), [0, 1, 2, 3], 4)
    if times == 2:
        assert list(flown) == [0, 1, 2, 3]
    else:
        with pytest.raises(InputError, match="processes keep dying while they fly chunk 0"):
            list(flown)


@pytest.mark.slow
def test_a_terminated_sweep_cleans_up_and_continues(tmp_path):
    file = short_sweep(tmp_path / "sweep.toml", count=4000, chunk_size=2)  # minutes
    folder = tmp_path / "out"
    process = subprocess.Popen(command(file, folder, "--jobs=2"), stderr=subprocess.PIPE)
    while not parts_in(folder):
        time.sleep(0.01)
    process.terminate()
    _, error = process.communicate(timeout=300.0)
    assert process.returncode == 143
    assert error.decode() == (
        f"tiltsim: interrupted; finished flights are in {folder}; the same command continues\n"
    )
    kept = parts_in(folder)
    assert kept > 0
    reports = []

    def stop_soon(done):
        reports.append(done)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(load_sweep(file), folder, report=stop_soon)
    assert reports == [2 * kept]


def test_a_damaged_folder_is_reported_or_repaired(tmp_path):
    definition = load_sweep(short_sweep(tmp_path / "sweep.toml"))
    dataset = run_sweep(definition, tmp_path / "out")
    whole = dataset.read_bytes()
    dataset.write_bytes(whole[:100])  # follows from the parts
    assert run_sweep(definition, tmp_path / "out").read_bytes() == whole
    part = next(iter((tmp_path / "out" / "parts").iterdir()))
    part.write_bytes(part.read_bytes()[:100])
    with pytest.raises(
        InputError, match=f"{part.name}: not a readable Parquet file: .*; delete it"
    ):
        run_sweep(definition, tmp_path / "out")


def test_parts_with_other_columns_are_refused(tmp_path, monkeypatch):
    definition = load_sweep(short_sweep(tmp_path / "sweep.toml"))
    run_sweep(definition, tmp_path / "out")
    monkeypatch.setitem(METRICS, "a_metric_of_tomorrow", Metric("use", "m", "of no use"))
    monkeypatch.setattr(points, "KEPT_METRICS", (*points.KEPT_METRICS, "a_metric_of_tomorrow"))
    with pytest.raises(
        InputError, match=r"made by another version of tiltsim: .* a_metric_of_tomorrow"
    ):
        run_sweep(definition, tmp_path / "out")
    assert sweep_figure(load_results(tmp_path / "out"))  # but they can be drawn


def test_an_unreadable_definition_is_refused(tmp_path):
    definition = load_sweep(short_sweep(tmp_path / "sweep.toml"))
    run_sweep(definition, tmp_path / "out")
    file = tmp_path / "out" / "sweep.json"
    whole = json.loads(file.read_text())
    for text, words in (
        ("{}", "keys are missing"),
        ("junk", "not the definition"),
        ("[" * 100_000, "keys are missing"),
        (json.dumps({**whole, "address": "other"}), "differs from its checksum"),
        (json.dumps({**whole, "versions": 3}), "differs from its checksum"),
        (json.dumps({**whole, "sha256": None}), "differs from its checksum"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=words) as caught:
            load_results(tmp_path / "out")
        assert "\n" not in str(caught.value)
