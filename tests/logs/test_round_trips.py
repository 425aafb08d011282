"""Flights in other formats and back, opened by the formats' own readers."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from pyulog import ULog

import tiltsim
from tests.flights import flight
from tiltsim.cli import main
from tiltsim.logs.log import Log

SUFFIXES = ("mcap", "ulg", "csv")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    flown = flight("fixed")
    flown.save(folder / "flight")
    for suffix in SUFFIXES:
        tiltsim.export(flown, folder / f"flight.{suffix}")
    return folder


def test_a_missing_folder_is_named_with_its_option(exported, tmp_path, capsys):
    out = tmp_path / "missing" / "flight.csv"
    assert main(["export", str(exported / "flight"), "--out", str(out)]) == 2
    assert capsys.readouterr().err == f"tiltsim: --out {out}: its folder does not exist\n"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_bit_comes_back(exported, suffix, tmp_path):
    log = tiltsim.read_log(exported / f"flight.{suffix}")
    flown = flight("fixed")
    assert list(log.units) == list(flown.units)
    if suffix != "csv":  # which has no place for units and scenario
        assert dict(log.units) == dict(flown.units)
    for name in flown.units:
        assert log[name].tobytes() == flown[name].tobytes()
    log.save(tmp_path / "back")
    first, second = (
        pq.read_table(f / "flight.parquet") for f in (exported / "flight", tmp_path / "back")
    )
    assert first.equals(second)
    if suffix != "csv":
        assert tiltsim.load_flight(tmp_path / "back").metrics() == flown.metrics()


def test_foxglove_reads_poses_in_its_schemas(exported):
    flown, topics = flight("fixed"), {}
    with (exported / "flight.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            topics.setdefault(channel.topic, []).append((schema.name, message))
    assert {topic: found[0][0] for topic, found in topics.items()} == {
        "/tiltsim/sample": "tiltsim/msg/Sample",
        "/tf": "foxglove.FrameTransform",
        "/reference": "foxglove.PoseInFrame",
        "/vehicle": "foxglove.SceneUpdate",
    }
    last = json.loads(topics["/tf"][-1][1].data)
    assert last["translation"]["z"] == flown["z"][-1]
    w, x, y, z = (last["rotation"][part] for part in "wxyz")
    assert np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) == pytest.approx(
        flown["roll"][-1], abs=1e-12
    )
    stamp = last["timestamp"]["sec"] + 1e-9 * last["timestamp"]["nsec"]
    assert stamp == pytest.approx(flown["time"][-1], abs=1e-9)


def test_px4s_topics_are_ned_and_come_back_in_z_up(exported, tmp_path):
    flown = flight("fixed")
    names = ["vehicle_local_position", "vehicle_attitude", "vehicle_angular_velocity"]
    only = ULog(str(exported / "flight.ulg"), names)
    position = only.get_dataset("vehicle_local_position").data
    np.testing.assert_allclose(position["z"], -flown["z"], atol=1e-6)
    assert (
        np.abs(only.get_dataset("vehicle_attitude").data["timestamp"] * 1e-6 - flown["time"]).max()
        <= 1e-6
    )
    only.write_ulog(str(tmp_path / "px4.ulg"))
    log = tiltsim.read_log(tmp_path / "px4.ulg")
    for name in ("x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw", "p", "q", "r"):
        np.testing.assert_allclose(log[name], flown[name], atol=2e-6, err_msg=name)


def test_a_long_scenario_survives_ulog(tmp_path):
    log = Log.of_flight(flight("fixed"))
    text = json.dumps({"title": "é" * 200_000}, ensure_ascii=False)
    from tiltsim.logs.formats import read_ulog, write_ulog

    write_ulog(Log(log.name, log.columns, log.units, (), {"scenario": text}), tmp_path / "a.ulg")
    assert read_ulog(tmp_path / "a.ulg")[1]["scenario"] == text
