"""Processes that libraries start while the command line loads them."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tiltsim.system.environment import variables_for_processes

WATCHED = """
import sys

STARTED = ("subprocess.Popen", "os.posix_spawn", "os.fork")
sys.addaudithook(lambda event, _: event in STARTED and print(event, file=sys.stderr))
flight = "ch04_tracking/setpoint#rho_065_modified"
sys.argv = ["tiltsim", "run", flight, "--set", "simulation.duration=0.01", "--quiet"]
from tiltsim.__main__ import main

sys.exit(main())
"""


def test_a_flight_starts_no_process(monkeypatch):
    """One that is just starting prints a traceback if a signal ends the command."""
    for name in ("PYGLFW_LIBRARY", "PYTHONSAFEPATH"):
        monkeypatch.delenv(name, raising=False)
    command = [sys.executable, "-c", WATCHED]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("file", "session"),
    [("x11/libglfw.so", ""), ("wayland/libglfw.so", "Wayland"), ("libglfw.3.dylib", "")],
)
def test_the_library_in_the_package_is_chosen(tmp_path, monkeypatch, file, session):
    library = tmp_path / "glfw" / file
    library.parent.mkdir(parents=True)
    library.touch()
    (tmp_path / "glfw/__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "glfw", raising=False)
    monkeypatch.setenv("XDG_SESSION_TYPE", session)
    for name in ("PYGLFW_LIBRARY", "PYGLFW_LIBRARY_VARIANT"):
        monkeypatch.delenv(name, raising=False)
    assert variables_for_processes()["PYGLFW_LIBRARY"] == str(library)
    library.unlink()
    assert "PYGLFW_LIBRARY" not in variables_for_processes()
    monkeypatch.setenv("PYGLFW_LIBRARY", "mine")
    assert "PYGLFW_LIBRARY" not in variables_for_processes()


def test_matrices_take_one_core_unless_the_user_says_how_many(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert variables_for_processes()["OPENBLAS_NUM_THREADS"] == "1"
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    assert "OPENBLAS_NUM_THREADS" not in variables_for_processes()
