"""Machine code and the folder that keeps it, for this user alone."""

from __future__ import annotations

import ctypes
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from tiltsim.engines import machine_code
from tiltsim.engines.glue import filled
from tiltsim.engines.machine_code import MachineCode

TWICE = """
define double @twice(double %x) nounwind {
  %y = fmul double %x, <factor>
  ret double %y
}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of compiled code."""
    folder = tmp_path / "tiltsim" / "machine_code"
    monkeypatch.setattr(machine_code, "code_folder", lambda: folder)
    return folder


def twice(factor=2.0):
    """Load or compile a function, and call it."""
    code = MachineCode(filled(TWICE, factor=factor))
    assert code.function("twice", ctypes.c_double, ctypes.c_double)(3.0) == 3.0 * factor
    return "compiled" if code.compiled else "loaded"


def test_code_is_compiled_once(folder):
    assert [twice(), twice(), twice(2.5), twice(2.5)] == ["compiled", "loaded"] * 2
    assert len([*folder.iterdir()]) == 2


@pytest.mark.parametrize("damage", ["truncated", "empty", "garbled"])
def test_damaged_code_is_compiled_again(folder, damage):
    assert twice() == "compiled"
    (file,) = folder.iterdir()
    content = file.read_bytes()
    flipped = bytes([*content[:-3], content[-3] ^ 1, *content[-2:]])
    file.write_bytes({"truncated": content[:-9], "empty": b"", "garbled": flipped}[damage])
    assert [twice(), twice()] == ["compiled", "loaded"]


def test_code_lives_as_long_as_its_function(folder):
    function = MachineCode(filled(TWICE, factor=4.0)).function(
        "twice", ctypes.c_double, ctypes.c_double
    )
    for factor in range(5, 15):  # others take the memory that would be free
        twice(float(factor))
    assert function(1.0) == 4.0


def test_code_that_cannot_be_saved_is_used_all_the_same(folder):
    assert machine_code.is_usable(folder)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    try:
        assert [twice(), twice()] == ["compiled", "compiled"]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [*folder.iterdir()] == []


def test_the_folder_is_private_whatever_the_umask(folder):
    folder.parent.mkdir()
    folder.parent.chmod(0o777)
    previous = os.umask(0)
    try:
        assert machine_code.is_usable(folder)
    finally:
        os.umask(previous)
    assert [path.stat().st_mode & 0o777 for path in (folder.parent, folder)] == [0o700, 0o700]


def test_a_folder_of_another_user_is_not_trusted(folder, monkeypatch):
    assert [twice(), twice()] == ["compiled", "loaded"]
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert not machine_code.is_usable(folder)
    assert twice() == "compiled"


def test_the_next_process_loads_what_the_last_one_compiled(tmp_path):
    program = (
        "import os, tiltsim\n"
        "from tiltsim.engines import machine_code\n"
        "made, start = [], machine_code.MachineCode.__init__\n"
        "def noted(self, text):\n"
        "    start(self, text)\n"
        "    made.append(self.compiled)\n"
        "machine_code.MachineCode.__init__ = noted\n"
        "tables = {'simulation': {'engine': 'native', 'duration': 0.01}}\n"
        "for _ in range(2):\n"
        "    if os.fork() == 0:\n"
        "        tiltsim.simulate(tables)\n"
        "        print(made, flush=True)\n"
        "        os._exit(0)\n"
        "    os.wait()\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=environment
    )
    assert done.stdout.splitlines() == ["[True, True]", "[False, False]"], done.stderr
    assert Path(tmp_path / "tiltsim" / "machine_code").is_dir()


def test_a_relative_folder_of_caches_is_ignored(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert machine_code.code_folder().parent == tmp_path / "tiltsim"
    for relative in ("rel", "./rel", ""):
        monkeypatch.setenv("XDG_CACHE_HOME", relative)
        assert machine_code.code_folder().parent == Path.home() / ".cache" / "tiltsim"
