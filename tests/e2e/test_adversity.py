"""The command line among full disks, missing folders, early interrupts and strange names."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress

import pytest

from tiltsim import cli
from tiltsim.__main__ import main as console_script
from tiltsim.cli import main
from tiltsim.flight.reading import load_flight

SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
SHORT = ("--set", "simulation.duration=0.1", "--set", "expect=[]", "--quiet")
LONG_NAME = "n" * 5000


def refused(capsys, *arguments):
    """The one line with which a command is refused."""
    try:
        code = main([*map(str, arguments)])
    except SystemExit as stopped:  # from the argument parser
        code = stopped.code
    assert code == 2
    output, error = capsys.readouterr()
    assert output == ""
    assert error.count("\n") == 1
    return error


@contextmanager
def nearly_full_disk(size):
    """As if files could only have a few bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_names_the_file(tmp_path, capsys):
    with nearly_full_disk(1000):
        error = refused(capsys, "run", SETPOINT, *SHORT, "--out", tmp_path)
    assert error == f"tiltsim: {tmp_path}/flight.parquet: cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["metrics.json", "scenario.toml"])
def test_unwritable_outputs_are_reported_before_the_flight(tmp_path, capsys, monkeypatch, name):
    monkeypatch.setattr("tiltsim.commands.run.fly", None)
    (tmp_path / name).mkdir()
    assert f"{tmp_path}/{name}: not a file" in refused(
        capsys, "run", SETPOINT, *SHORT, "--out", tmp_path
    )


def test_a_family_is_not_replaced_by_one_of_its_members(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = '[simulation]\nduration = 0.1\n[[variant]]\nname = "a"\n'
    (tmp_path / "scenario.toml").write_text(text)
    error = refused(capsys, "run", "scenario.toml#a", "--quiet", "--out", ".")
    assert "scenario.toml: not written by this version of tiltsim" in error
    assert (tmp_path / "scenario.toml").read_text() == text
    assert [file.name for file in tmp_path.iterdir()] == ["scenario.toml"]


def test_a_working_folder_that_no_longer_exists_is_named(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    for option in ("--out", "--rerun"):
        error = refused(capsys, "run", SETPOINT, *SHORT, option, "a.rrd")
        assert error.endswith("the working folder no longer exists\n")


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", LONG_NAME],
        ["run", f"ch04_tracking/setpoint#{LONG_NAME}"],
        ["run", SETPOINT, "--set", f"{LONG_NAME}=1"],
        ["run", SETPOINT, "--set", f"vehicle.a {LONG_NAME}=1"],
        ["run", SETPOINT, "--set", f"vehicle.mass[{LONG_NAME}]=1"],
        ["run", SETPOINT, "--set", f"controller.decoupler={LONG_NAME}"],
        ["plot", LONG_NAME],
        [LONG_NAME],
    ],
)
def test_long_names_are_cut(capsys, arguments):
    error = refused(capsys, *arguments)
    assert "nnn..." in error
    assert len(error) < 800


def test_an_interrupt_is_one_line_from_the_first_import_on(capsys, monkeypatch):
    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "main", interrupted)
    assert console_script() == 130
    assert capsys.readouterr() == ("", "tiltsim: interrupted\n")
    code = "import sys; before = {*sys.modules}; import tiltsim.__main__; "
    code += "print(*sorted({*sys.modules} - before))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) <= {"__future__", "tiltsim", "tiltsim.__main__"}


def test_an_interrupt_that_became_another_error_stays_one(capsys, monkeypatch):
    """As compiled modules turn it into an ImportError."""

    def imported():
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error

    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr("tiltsim.commands.files.run_list", imported)
    assert main(["list"]) == 130
    assert capsys.readouterr() == ("", "tiltsim: interrupted\n")


def test_an_interrupt_that_compiled_code_turns_into_another_error_stays_one(capsys, monkeypatch):
    """Like pydantic, which names it in the text of its error."""

    def validated():
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise RuntimeError("SchemaError")

    monkeypatch.setattr("tiltsim.commands.files.run_list", validated)
    assert main(["list"]) == 130
    assert capsys.readouterr() == ("", "tiltsim: interrupted\n")


def test_a_scenario_whose_file_name_is_not_utf_8_is_flown_and_saved(tmp_path, capsys):
    file = tmp_path / os.fsdecode(b"caf\xe9.toml")
    file.write_text('title = "one"\n[simulation]\nduration = 0.1\n')
    out = tmp_path / os.fsdecode(b"\xe9")
    assert main(["run", str(file), "--quiet", "--out", str(out)]) == 0
    assert capsys.readouterr() == ("", "")
    assert load_flight(out).scenario.address == rf"{tmp_path}/caf\udce9.toml"
