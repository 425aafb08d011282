"""The command line as a user meets it: output, files and exit codes."""

from __future__ import annotations

import atexit
import gc
import json
import os
import re
import signal
import subprocess
import sys
import tomllib
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from xml.etree import ElementTree

import pyarrow.parquet as pq
import pytest

from tiltsim.cli import main
from tiltsim.commands import run as run_command
from tiltsim.commands.text import Progress
from tiltsim.scenario.loading import as_in_file, is_changed_from_library, load_scenario
from tiltsim.scenario.metric_names import METRICS
from tiltsim.studies import benchmark
from tiltsim.vehicles.rotorcraft import COLUMNS

SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
SHORT = ("--set", "simulation.duration=0.2")
LONGER = ("--set", "simulation.duration=2.0")
UPSIDE_DOWN = ("--set", "initial.attitude=[3.14159, 0.0, 0.0]")
COMMAND = (sys.executable, "-m", "tiltsim")

EXPECTING = """
title = "expecting"
[simulation]
duration = 0.2
[[expect]]
metric = "max_abs_roll"
published = 0.0
max = {bound}
"""


def tiltsim(*arguments):
    """Run the command in a separate process, as from a shell."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False
    )


def test_only_a_separate_process_reduces_garbage_collection(monkeypatch):
    done = []
    monkeypatch.setattr(gc, "set_threshold", lambda *_: done.append("seldom"))
    monkeypatch.setattr(atexit, "register", done.append)
    monkeypatch.setattr(sys, "argv", ["tiltsim", "schema"])
    assert main(["schema"]) == 0
    assert done == []
    assert main() == 0
    assert done == ["seldom", gc.freeze]


@pytest.fixture
def expecting(tmp_path):
    def write(bound):
        path = tmp_path / "expecting.toml"
        path.write_text(EXPECTING.format(bound=bound), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("option", "answer"), [("--json", "--json"), ("--outt", "--outt; did you mean --out?")]
)
def test_a_command_refuses_an_option_that_it_does_not_have(capsys, option, answer):
    with pytest.raises(SystemExit) as stopped:
        main(["run", SETPOINT, option])
    assert stopped.value.code == 2
    line = f"tiltsim: unrecognized arguments: {answer} (see tiltsim run --help)\n"
    assert capsys.readouterr().err == line


def test_run_writes_the_three_files_and_prints_a_summary(tmp_path, capsys):
    out = tmp_path / "new" / "a folder"
    assert main(["run", SETPOINT, *SHORT, "--set", "expect=[]", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "Setpoint, trot angle fixed at rho = 0.65, modified decoupler" in printed
    assert f"  {SETPOINT}\n" in printed
    assert re.search(r"^  final_position_error_x  +-?[\d.e-]+ m$", printed, re.MULTILINE)
    assert re.search(r"^  min_decoupling_condition  +[\d.]+$", printed, re.MULTILINE)
    assert printed.endswith(f"flight written to {out}; see it with tiltsim view '{out}'\n")
    assert sorted(path.name for path in out.iterdir()) == [
        "flight.parquet",
        "metrics.json",
        "scenario.toml",
    ]
    metrics = json.loads((out / "metrics.json").read_text())
    assert set(metrics) <= set(METRICS)
    assert metrics["duration"] == pytest.approx(0.2)
    table = pq.read_table(out / "flight.parquet")
    assert table.column_names == list(COLUMNS)
    assert table.num_rows == 21
    assert table.schema.field("x").metadata == {b"unit": b"m"}


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.38123456, "0.381235"), (-8.123e-8, "-8e-08"), (-8.7e-16, "0"), (361.3829, "361.383")],
)
def test_run_shows_few_digits_of_values_that_are_zero_but_for_the_solver(value, shown):
    assert run_command._shown(value) == shown


def test_resolved_scenario_flies_the_same_flight_again(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    options = [*SHORT, "--set", "expect=[]", "--set", "gait.type=trot_instant"]
    options += ["--set", "gait.amplitude=0.4", "--set", "gait.period=0.1", "--quiet"]
    assert main(["run", SETPOINT, *options, "--out", str(first)]) == 0
    assert main(["run", str(first / "scenario.toml"), "--quiet", "--out", str(second)]) == 0
    assert tomllib.loads((first / "scenario.toml").read_text())["gait"]["amplitude"] == 0.4
    tables = [pq.read_table(folder / "flight.parquet") for folder in (first, second)]
    assert tables[0].equals(tables[1])


@pytest.mark.parametrize(("bound", "code", "word"), [(1.0, 0, "ok"), (-1.0, 1, "FAILED")])
def test_run_exit_code_reports_whether_expectations_hold(expecting, capsys, bound, code, word):
    assert main(["run", str(expecting(bound))]) == code
    assert word in capsys.readouterr().out


def test_run_quiet_prints_nothing(capsys):
    assert main(["run", SETPOINT, *SHORT, "--set", "expect=[]", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_only_values_that_differ_from_the_file_s_are_called_changed(capsys):
    same = ["--set", "reference.type=setpoint"]
    assert main(["run", SETPOINT, *SHORT, *same]) == 0
    printed = capsys.readouterr().out
    assert "  changed: simulation.duration = 0.2\n" in printed
    assert "reference.type" not in printed


def test_changes_are_named_though_the_flight_replaces_its_scenario(tmp_path, capsys):
    assert main(["run", SETPOINT, *SHORT, "--out", str(tmp_path), "--quiet"]) == 0
    shorter = ["--set", "simulation.duration=0.1", "--out", str(tmp_path)]
    assert main(["run", str(tmp_path / "scenario.toml"), *shorter]) == 0
    assert "  changed: simulation.duration = 0.1\n" in capsys.readouterr().out


def test_a_changed_flight_of_the_library_is_not_judged(tmp_path, capsys):
    assert main(["run", SETPOINT, *SHORT, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert tomllib.loads((tmp_path / "scenario.toml").read_text())["expect"] == []
    assert "no verdict" in printed
    assert f"  changed: {', '.join(SHORT[1::2]).replace('=', ' = ')}\n" in printed
    assert re.search(r"final_position_error_x +0\.\d+ +-0\.38 ", printed)
    assert main(["run", SETPOINT, *SHORT, "--quiet"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["run", SETPOINT, *SHORT, "--judge"]) == 1
    assert "FAILED" in capsys.readouterr().out
    own_bound = ["--set", 'expect=[{metric="duration", max=0.1}]']
    assert main(["run", SETPOINT, *SHORT, *own_bound]) == 1


def test_no_judge_forbids_the_verdict(expecting, capsys):
    assert main(["run", str(expecting(-1.0)), "--no-judge"]) == 0
    printed = capsys.readouterr().out
    assert "FAILED" not in printed
    assert "no verdict" in printed


@pytest.mark.parametrize(
    ("path", "overrides", "changed"),
    [
        (SETPOINT, {}, False),
        (SETPOINT, {"simulation.plant": "thesis", "simulation.engine": "python"}, False),
        (SETPOINT, {"controller.decoupler": "modified", "title": "Mine"}, False),
        (SETPOINT, {"controller.decoupler": "exact"}, True),
        (SETPOINT, {"simulation.duration": 20.0}, True),
        (SETPOINT.partition("#")[0], {"simulation.plant": "thesis"}, True),
    ],
)
def test_a_flight_of_the_library_is_as_shipped_on_any_plant(path, overrides, changed):
    scenario = load_scenario(path, overrides)
    assert is_changed_from_library(path, scenario, as_in_file(path)) is changed


def test_a_custom_flight_is_always_judged(expecting):
    path = expecting(1.0)
    changed = load_scenario(path, {"simulation.duration": 0.1})
    assert not is_changed_from_library(path, changed, as_in_file(path))


def test_run_quiet_prints_failed_expectations(expecting, capsys):
    assert main(["run", str(expecting(-1.0)), "--quiet"]) == 1
    output, error = capsys.readouterr()
    assert output == ""
    assert error == "tiltsim: FAILED max_abs_roll: measured 0, expected <= -1\n"


def test_a_sweep_is_not_a_scenario(tmp_path, capsys):
    path = tmp_path / "sw.toml"
    path.write_text('scenario = "x"\n[[axis]]\ntype = "list"\nkey = "gait.period"\nvalues = [1]\n')
    words = f"{path}: this is a sweep: tiltsim sweep {path}\n"
    assert main(["run", str(path)]) == 2
    assert capsys.readouterr().err == f"tiltsim: {words}"
    assert main(["check", str(path)]) == 2
    assert words in capsys.readouterr().out


def test_run_of_a_family_lists_its_variants_and_exits_2(capsys):
    assert main(["run", "ch04_tracking/setpoint"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "rho_065_modified" in error
    assert "rho_minus_065_conventional" in error


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "no/such/scenario"], ["no/such/scenario", "tiltsim list"]),
        (["run", SETPOINT, "--set", "vehicle.mas=1"], ["vehicle.mas", "did you mean mass"]),
        (["run", SETPOINT, "--set", "vehicle.mass=-1"], ["vehicle.mass = -1", "greater than 0"]),
        (["run", SETPOINT, "--set", "vehicle.mass=nan"], ["vehicle.mass = NaN", "finite"]),
        (["run", SETPOINT, "--set", "controller.gains=ch05"], ["controller.gains", "ch03"]),
        (["run", SETPOINT, "--set", "controller.decoupling=exact"], ["Routh", "K1 K2 = 10"]),
        (["run", SETPOINT, "--set", "nonsense"], ["nonsense", "KEY=VALUE"]),
        (
            ["run", SETPOINT, "--set", "vehicle.tilt_servo.max_angle=0.5"],
            ["gait.angles", "0.65", "max_angle = 0.5"],
        ),
        (["check", "no/such/folder"], ["no/such/folder"]),
        (["check", "--jobs", "0"], ["--jobs", "0", "at least 1"]),
        (["check", "--shard", "0/4"], ["--shard", "0/4", "1 <= K <= N"]),
        (["check", "--shard", "5/4"], ["--shard", "5/4", "1/4"]),
        (["check", "--shard", "x"], ["--shard", "x", "K/N"]),
        (["check", "--shard", "1/-4"], ["--shard", "1/-4", "K/N"]),
        (["check", "-k", "zebra"], ["-k zebra", "address, title or source"]),
        (["check", "--json", "no/such/c.json"], ["--json no/such/c.json", "folder"]),
        (["run"], ["SCENARIO"]),
        (["fly"], ["fly", "choose from"]),
        (["run", SETPOINT, "--set", "simulation.duration=1e9"], ["duration", "steps"]),
        (["run", SETPOINT, "--set", "simulation.timestep=1e-320"], ["timestep", "0.000001"]),
        (["run", SETPOINT, "--set", "vehicle.arm_length=1e300"], ["arm_length", "1000000000"]),
        (["run", SETPOINT, "--set", "expect=3"], ["expect = 3", "list"]),
    ],
)
def test_bad_input_is_one_clear_line_and_exit_2(capsys, arguments, words):
    try:
        code = main(arguments)
    except SystemExit as stopped:  # from the argument parser
        code = stopped.code
    assert code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    for word in words:
        assert word in printed.err


def test_unwritable_output_is_noticed_before_the_flight(tmp_path, capsys):
    (tmp_path / "file").write_text("in the way")
    out = tmp_path / "file" / "out"
    assert main(["run", SETPOINT, "--out", str(out)]) == 2
    assert capsys.readouterr().err.startswith(f"tiltsim: {out}: cannot be created: ")


def test_lost_flight_exits_3_with_cause_and_time_and_keeps_its_log(tmp_path, capsys):
    options = ["--set", "initial.attitude=[3.14159, 0.0, 0.0]", "--set", "expect=[]"]
    assert main(["run", SETPOINT, *options, "--out", str(tmp_path)]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert " at t = 0." in error
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["diverged"] is True
    table = pq.read_table(tmp_path / "flight.parquet")
    assert table["time"][-1].as_py() == pytest.approx(metrics["duration"])
    assert table.schema.metadata[b"cause"]
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_nothing_is_left_in_the_users_folder(tmp_path, monkeypatch, capfd, caplog):
    monkeypatch.chdir(tmp_path)
    assert main(["run", SETPOINT, "--set", "expect=[]", *LONGER, *UPSIDE_DOWN]) == 3
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr().err.count("\n") == 1, "only our own line, none of MuJoCo's"
    assert not caplog.records, "which dm_control's handler logs"


def test_check_reports_every_outcome_and_writes_junit(tmp_path, capsys):
    good = tmp_path / "good.toml"
    good.write_text(EXPECTING.format(bound=1.0))
    (tmp_path / "failing.toml").write_text(EXPECTING.format(bound=-1.0))
    (tmp_path / "typo.toml").write_text("titel = 'x'\n")
    upside_down = "[simulation]\nduration = 2.0\n[initial]\nattitude = [3.14159, 0.0, 0.0]\n"
    (tmp_path / "lost.toml").write_text(upside_down)
    junit, file = tmp_path / "junit.xml", tmp_path / "check.json"
    files = ["--junit", str(junit), "--json", str(file)]
    assert main(["check", str(tmp_path), "--jobs", "1", *files]) == 2
    printed = capsys.readouterr().out
    assert "\n\n4 scenarios: 1 failed, 1 passed, 1 lost, 1 invalid\n" in printed
    suite = ElementTree.parse(junit).getroot()[0]
    counts = {key: suite.get(key) for key in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "4", "failures": "2", "errors": "1", "skipped": "0"}
    document = json.loads(file.read_text())
    summary = document["summary"]
    assert (summary["scenarios"], summary["passed"], summary["exit_code"]) == (4, 1, 2)
    found = {Path(entry["address"]).stem: entry for entry in document["scenarios"]}
    codes = {name: (entry["status"], entry["exit_code"]) for name, entry in found.items()}
    assert codes == {
        "failing": ("failed", 1),
        "good": ("passed", 0),
        "lost": ("lost", 3),
        "typo": ("invalid", 2),
    }
    bounds = {"min": None, "max": -1.0, "equals": None, "published": 0.0}
    expected = {"metric": "max_abs_roll", "measured": 0.0, "holds": False, **bounds}
    assert found["failing"]["expectations"] == [expected]
    for case, entry in zip(suite, document["scenarios"], strict=True):
        properties = {item.get("name"): item.get("value") for item in case.iter("property")}
        assert {name: json.loads(value) for name, value in properties.items()} == entry["metrics"]
        errors = case.findall("failure") + case.findall("error")
        assert [error.get("message") for error in errors] == [entry["message"]] * len(errors)
    assert found["lost"]["metrics"]["diverged"] is True
    assert found["typo"]["metrics"] == {}
    assert main(["check", str(good), "--jobs", "1"]) == 0
    assert main(["check", str(tmp_path / "failing.toml"), str(good), "--jobs", "1"]) == 1
    assert main(["check", str(tmp_path / "lost.toml"), "--jobs", "1"]) == 3


def test_check_prints_json_instead_of_the_table_and_can_end_at_a_failure(tmp_path, capsys):
    for name, bound in {"a": 1.0, "b": -1.0, "c": 1.0}.items():
        (tmp_path / f"{name}.toml").write_text(EXPECTING.format(bound=bound))
    junit = tmp_path / "junit.xml"
    options = ["--jobs", "1", "--fail-fast", "--json", "-", "--junit", str(junit)]
    assert main(["check", str(tmp_path), *options]) == 1
    output, error = capsys.readouterr()
    assert "3 scenarios: 1 passed, 1 failed, 1 skipped\n" in error
    document = json.loads(output)
    statuses = [entry["status"] for entry in document["scenarios"]]
    assert statuses == ["passed", "failed", "skipped"]
    assert document["scenarios"][2]["exit_code"] is None
    assert document["summary"]["exit_code"] == 1
    suite = ElementTree.parse(junit).getroot()[0]
    assert suite.get("skipped") == "1"
    assert suite[2][0].tag == "skipped"


def test_a_shard_without_scenarios_passes(tmp_path, capsys):
    (tmp_path / "a.toml").write_text(EXPECTING.format(bound=1.0))
    assert main(["check", str(tmp_path), "--shard", "2/2"]) == 0
    assert capsys.readouterr().out == "\n0 scenarios\n"


def test_check_marks_flights_without_expectations(tmp_path, capsys):
    (tmp_path / "a.toml").write_text("[simulation]\nduration = 0.01\n")
    (tmp_path / "b.toml").write_text(EXPECTING.format(bound=1.0))
    (tmp_path / "c.toml").write_text("titel = 'x'\n")
    junit = tmp_path / "junit.xml"
    good = [str(tmp_path / "a.toml"), str(tmp_path / "b.toml")]
    assert main(["check", *good, "--jobs", "1", "--junit", str(junit)]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row[:3] for row in rows[:2]] == ["ok ", "ok "]
    assert ["no expectations" in row for row in rows[:2]] == [True, False]
    assert "1/1 hold" in rows[1]
    assert rows[-1] == "2 scenarios: 1 without expectations, 1 passed"
    assert len(ElementTree.parse(junit).getroot()[0]) == 2
    assert main(["check", str(tmp_path / "c.toml")]) == 2
    output = capsys.readouterr().out
    assert "hold" not in output
    assert output.endswith("1 scenario: 1 invalid\n")


def test_check_evaluates_the_expectations_for_its_plant(tmp_path, capsys):
    path = tmp_path / "plants.toml"
    path.write_text(
        "[simulation]\nduration = 0.1\n"
        '[[expect]]\nmetric = "max_abs_roll"\nmax = 1.0\nplant = "mujoco"\n'
        '[[expect]]\nmetric = "max_abs_roll"\nmax = -1.0\nplant = "thesis"\n'
    )
    assert main(["check", str(path)]) == 0
    assert main(["check", str(path), "--set", "simulation.plant=thesis"]) == 1
    assert "max_abs_roll = 0, expected <= -1" in capsys.readouterr().out


def test_check_survives_a_file_that_cannot_be_read_as_toml(tmp_path, capsys):
    (tmp_path / "a.toml").write_text("x = 1\nx = 2\n")
    (tmp_path / "b.toml").write_text(EXPECTING.format(bound=1.0))
    heavy = "[vehicle.pod]\nmass = 1.0\n[simulation]\nduration = 0.1\n"
    (tmp_path / "c.toml").write_text(heavy)
    assert main(["check", str(tmp_path), "--jobs", "1"]) == 2
    assert "3 scenarios: 2 invalid, 1 passed" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("jobs", "signal_", "code"),
    [("1", signal.SIGINT, 130), ("2", signal.SIGINT, 130), ("2", signal.SIGTERM, 143)],
)
def test_interrupt_ends_a_whole_check_at_once_and_keeps_what_is_finished(
    tmp_path, jobs, signal_, code
):
    (tmp_path / "a.toml").write_text("[simulation]\nduration = 0.01\n")
    for name in ("b", "c"):
        endless = "[simulation]\nduration = 20000.0\nrecord_timestep = 10.0\n"
        (tmp_path / f"{name}.toml").write_text(endless)
    # One of two processes has the longest flight, the other all flights before it.
    paths = [tmp_path / f"{name}.toml" for name in ("abc" if jobs == "1" else "ab")]
    process = subprocess.Popen(
        [*COMMAND, "check", *map(str, paths), "--jobs", jobs, "--junit", tmp_path / "j.xml"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdout.readline().startswith(b"ok ")  # the short one; a long one is under way
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(timeout=0.5)
    if signal_ == signal.SIGINT:  # the keyboard's go to all processes
        os.killpg(process.pid, signal_)
    else:
        process.send_signal(signal_)
    _, error = process.communicate(timeout=300.0)
    assert process.returncode == code
    assert error.decode().strip().endswith("tiltsim: interrupted")
    suite = ElementTree.parse(tmp_path / "j.xml").getroot()[0]
    unflown = len(paths) - 1
    assert (suite.get("tests"), suite.get("errors")) == (str(len(paths)), str(unflown))
    assert [case.get("name") for case in suite] == [path.name for path in paths]
    errors = [case.find("error") for case in suite]
    assert errors[0] is None
    assert [error.get("message") for error in errors[1:]] == ["not flown: interrupted"] * unflown


def test_interrupted_run_keeps_its_files_and_says_so(tmp_path, capsys, monkeypatch):

    @contextmanager
    def no_bar(**_options):
        class Interrupting(Progress):
            begun = False

            def move(self, time):
                if time > 0.0 and not self.begun:  # native code flies, a second at a time
                    Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
                    self.begun = True

        yield Interrupting()

    monkeypatch.setattr(run_command, "show_progress", no_bar)
    # So few samples that nothing computed from them is worth compiling either.
    long = ["--set", "simulation.duration=2000.0", "--set", "simulation.record_timestep=1.0"]
    assert main(["run", SETPOINT, "--out", str(tmp_path), *long]) == 130
    output, error = capsys.readouterr()
    assert output == ""
    assert error.startswith("tiltsim: interrupted at t = ")
    flown = json.loads((tmp_path / "metrics.json").read_text())["duration"]
    assert 0.0 < flown < 2000.0


@pytest.mark.slow
def test_check_on_several_processes_keeps_the_order_of_junit(tmp_path):
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.toml").write_text(EXPECTING.format(bound=1.0))
    junit = tmp_path / "junit.xml"
    assert main(["check", str(tmp_path), "--jobs", "2", "--junit", str(junit)]) == 0
    names = [case.get("name") for case in ElementTree.parse(junit).getroot()[0]]
    assert names == ["a.toml", "b.toml", "c.toml"]


def split_address(address):
    family, hash_, variant = address.partition("#")
    return [family, hash_ + variant] if variant else [family]


def test_list_shows_every_scenario_with_title_and_source(capsys):
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    family, _, variant = SETPOINT.partition("#")
    first = next(i for i, line in enumerate(lines) if line.startswith(f"{family}  "))
    assert "Setpoint with the trot angle fixed (ch. 4, Sec. 6.1, Fig. 4)" in lines[first]
    member = next(line for line in lines[first:] if line.lstrip().startswith(f"#{variant} "))
    assert "modified decoupler" in member
    assert member.endswith(" (Fig. 4 (B1))")
    assert main(["list", "--json"]) == 0
    entries = json.loads(capsys.readouterr().out)
    assert all(entry["title"] and entry["source"] for entry in entries)
    # A member without a title shows its changes; a title is not repeated.
    trots = [line for line in lines if line.lstrip().startswith("#continuous_t3_modified ")]
    assert all("type = trot_continuous" in line and "period = 3.0" in line for line in trots)
    assert len(trots) == 2
    shown = {line.split()[0] for line in lines if line}
    assert all(part in shown for e in entries for part in split_address(e["scenario"]))


def test_long_lines_are_wrapped_only_on_a_terminal(capsys, monkeypatch):
    assert main(["list"]) == 0
    piped = capsys.readouterr().out
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert main(["list"]) == 0
    shown = capsys.readouterr().out
    assert max(map(len, piped.splitlines())) > 120
    assert max(map(len, shown.splitlines())) <= 80
    assert shown.split() == piped.split()


def test_list_of_scenarios_that_contain_a_word(capsys):
    assert main(["list", "ch02_singular_zone"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all(line.startswith(("ch02_singular_zone", "  #")) for line in lines)
    assert main(["list", "Fig. 4", "--json"]) == 0
    entries = json.loads(capsys.readouterr().out)
    assert {SETPOINT} <= {entry["scenario"] for entry in entries}
    assert all("Fig. 4" in entry["source"] + entry["title"] for entry in entries)
    assert main(["list", SETPOINT.upper()]) == 0
    family, _, variant = SETPOINT.partition("#")
    shown = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert shown == [family, f"#{variant}"]
    assert main(["list", "zebra"]) == 2
    assert (
        capsys.readouterr().err == "tiltsim: zebra: in no address, title or source of the library\n"
    )


def test_schema_knows_every_table_and_the_variants(capsys):
    assert main(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    tables = {"vehicle", "simulation", "initial", "controller", "gait", "reference"}
    tables |= {
        "air",
        "autopilot",
        "downwash",
        "ground",
        "model_error",
        "payload",
        "sensors",
        "tool",
    }
    lists = {"cable", "companion", "disturbance", "expect", "fault", "object", "variant"}
    assert tables | lists | {"title", "source", "without", "ours", "claim"} == set(
        schema["properties"]
    )
    assert schema["additionalProperties"] is False


def test_version_and_module_entry():
    done = tiltsim("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("tiltsim ")


def test_help_names_every_command(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["--help"])
    assert stopped.value.code == 0
    printed = capsys.readouterr().out
    for command in ("run", "check", "list", "bench", "schema"):
        assert command in printed


@pytest.mark.slow
def test_bench_prints_ratios_for_every_engine_and_integrator(capsys, monkeypatch):
    """With few steps a timing; a step of .ci/run takes all of them."""
    for name, steps in (("STEPS", 300), ("PYTHON_STEPS", 40), ("BATCH_STEPS", 20)):
        monkeypatch.setattr(benchmark, name, steps)
    assert main(["bench", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    keys = {"case", "engine", "integrator", "vehicles", "threads", "steps_per_second", "ratio"}
    assert all(keys | {"realtime_factor"} == set(row) for row in rows)
    cases = {(row["case"], row["engine"]) for row in rows}
    assert cases == {
        *(("single", name) for name in ("bare", "empty", "python", "native")),
        *(("recorded", "native"), ("batch", "bare"), ("batch", "native")),
    }
    for case in cases:
        integrators = {r["integrator"] for r in rows if (r["case"], r["engine"]) == case}
        assert integrators == {"RK4", "implicitfast", "Euler"}
    assert all(row["ratio"] == 1.0 for row in rows if row["engine"] == "bare")


@pytest.mark.slow
def test_bench_of_many_flights_prints_time_and_memory():
    done = tiltsim("bench", "--vehicles", "3", "--duration", "0.05", "--json")
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)
    assert (row["case"], row["vehicles"], row["completed"]) == ("flights", 3, 3)
    assert row["steps_per_second"] == pytest.approx(3 * 50 / row["seconds"])
    assert row["realtime_factor"] == pytest.approx(3 * 0.05 / row["seconds"])
    assert 1e7 < row["memory"] < 2**30


def test_bench_of_no_flights_is_a_mistake(capsys):
    assert main(["bench", "--vehicles", "0"]) == 2
    assert capsys.readouterr().err == "tiltsim: --vehicles 0: must be at least 1\n"


def test_library_scenarios_are_shipped_beside_the_package():
    from tiltsim.resources import shipped_folder

    assert (shipped_folder("scenarios") / "ch04_tracking" / "setpoint.toml").is_file()
    assert Path(shipped_folder("mjcf") / "tiltrotor.xml").is_file()


def test_an_override_without_an_equals_sign_is_refused_as_such(capsys):
    assert main(["run", SETPOINT, "--set", "simulation.duration", "10"]) == 2
    assert "simulation.duration: write KEY=VALUE" in capsys.readouterr().err
