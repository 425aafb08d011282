"""Logs of other tools: maps, frames, and one line for each defect."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.flights import flight

MAP = """
world = "ned"
body = "frd"
attitude = ["qw", "qx", "qy", "qz"]
max_gap = 0.3

[columns]
x = "north"
y = "east"
z = "down"
q = "pitch_rate"
rotor_speed_1 = { signal = "rpm_1", scale = 0.10471975511965977 }
"""


def rows(count=40, step=0.05):
    time = 5.0 + step * np.arange(count)
    angle = 0.3 * np.sin(time)
    return {
        "time": time,
        "north": np.cos(time),
        "east": np.sin(time),
        "down": -time,
        # Pitch by angle about the body's right axis of FRD: nose up.
        "qw": np.cos(angle / 2),
        "qx": 0.0 * time,
        "qy": np.sin(angle / 2) * np.where(np.arange(count) == 7, 1.0, 1.0),
        "qz": 0.0 * time,
        "pitch_rate": 0.3 * np.cos(time),
        "rpm_1": 3000.0 + time,
    }


def write(path, table):
    lines = [
        ",".join(table),
        *(",".join(map(repr, row)) for row in zip(*(c.tolist() for c in table.values()))),
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def chart(tmp_path):
    file = tmp_path / "map.toml"
    file.write_text(MAP)
    return file


def test_a_map_turns_ned_and_frd_into_z_up_and_flu(tmp_path, chart):
    given = rows()
    given["qw"][7:], given["qy"][7:] = -given["qw"][7:], -given["qy"][7:]  # the same rotations
    log = tiltsim.read_log(write(tmp_path / "log.csv", given), chart)
    np.testing.assert_allclose(log["time"], given["time"] - 5.0, atol=1e-12)
    np.testing.assert_allclose(
        log["position"], np.stack([given["north"], -given["east"], -given["down"]], 1)
    )
    np.testing.assert_allclose(log["pitch"], -0.3 * np.sin(given["time"]), atol=1e-12)
    np.testing.assert_allclose(log["q"], -given["pitch_rate"])
    np.testing.assert_allclose(log["rotor_speed_1"], given["rpm_1"] * np.pi / 30)
    assert log.units["rotor_speed_1"] == "rad/s"
    assert log.notes == ("constant: roll, yaw",)


def test_defects_are_one_line_each_and_nothing_is_lost(tmp_path, chart):
    given = rows()
    keep = np.delete(np.arange(40), np.arange(20, 30))
    given = {name: column[keep].copy() for name, column in given.items()}
    given["rpm_1"][3:5] = np.nan
    given["east"][:] = 2.0
    log = tiltsim.read_log(write(tmp_path / "log.csv", given), chart)
    assert len(log) == 30
    assert log.notes == (
        "1 gap between samples, the longest 0.55 s at 0.95 s",
        "constant: y, roll, yaw",
    )
    assert np.isfinite(log["rotor_speed_1"]).all()  # a hole of 0.15 s is bridged
    chart.write_text(MAP.replace("max_gap = 0.3", "max_gap = 0.1"))
    log = tiltsim.read_log(write(tmp_path / "log.csv", given), chart)
    assert np.flatnonzero(~np.isfinite(log["rotor_speed_1"])).tolist() == [3, 4]
    assert log.notes[1] == "rotor_speed_1: no value in 2 of 30 samples"


MISTAKES = {
    'x = "north"': ('x = "nort"', "signal nort: not in this log; did you mean north?"),
    "max_gap = 0.3": ("max_gap = -1", "map.toml: max_gap = -1: must be"),
    'world = "ned"': ('world = "nwd"', 'map.toml: world = "nwd"'),
    "[columns]": ('[columns]\nroll = "qw"', "give roll by the key attitude"),
    'q = "pitch_rate"': ('pitchrate = "pitch_rate"', "column 'pitchrate' is unknown"),
    '"qw", "qx", "qy", "qz"': ('"qw", "qx"', "three signals (roll, pitch, yaw) or four"),
    "body": ("bodies", "unknown key"),
    '"qz"]': ('"qz"', "map.toml: not valid TOML"),
}


@pytest.mark.parametrize("part", MISTAKES)
def test_a_wrong_map_gets_one_line(tmp_path, chart, part):
    instead, message = MISTAKES[part]
    assert MAP.count(part) >= 1
    chart.write_text(MAP.replace(part, instead, 1))
    with pytest.raises(tiltsim.InputError) as caught:
        tiltsim.read_log(write(tmp_path / "log.csv", rows()), chart)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", b"time,x\n0,0\n1,1\n", "a log ends with .mcap"),
        ("a.csv", b"", "0 rows"),
        ("a.csv", b"t,x\n0,0\n1,1\n", "no column time (s)"),
        ("a.csv", b"time;x\n0;0\n1;1\n", "separate columns by commas"),
        ("a.csv", b"time,x\n0,0\n1\n", "row 2: 1 values in 2 columns"),
        ("a.csv", b"time,x\n0,0\n1,one\n", "row 2, column x = 'one': no number"),
        ("a.csv", b"time,x,x\n0,0,0\n1,1,1\n", "column x: twice"),
        ("a.csv", b"time,x\n1,0\n0,1\n", "time: must be finite and increase"),
        ("a.csv", b"time,height\n0,0\n1,1\n", "give a map (--map FILE)"),
        ("a.mcap", b"\x89MCAP0\r\n damaged", "not a readable MCAP file"),
        ("a.ulg", b"ULog\x01\x12\x35\x01", "a.ulg: "),
    ],
)
def test_a_damaged_log_gets_one_line(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(tiltsim.InputError) as caught:
        tiltsim.read_log(tmp_path / name)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_imported_log_is_no_flight_but_is_read_again(tmp_path, chart):
    log = tiltsim.read_log(write(tmp_path / "log.csv", rows()), chart)
    log.save(tmp_path / "imported")
    again = tiltsim.read_log(tmp_path / "imported")
    assert again["x"].tobytes() == log["x"].tobytes()
    with pytest.raises(tiltsim.InputError, match="it is an imported log, for tiltsim plot"):
        tiltsim.load_flight(tmp_path / "imported")
    flight("fixed").save(tmp_path / "flight")
    with pytest.raises(tiltsim.InputError, match="not an imported log"):
        log.save(tmp_path / "flight")
