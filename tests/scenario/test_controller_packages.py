"""A broken package of controllers is left out with one line, and stops nothing."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import pytest

from tiltsim.scenario.controller import installed_controllers

TABLE = """
from typing import Annotated, Literal

import tiltsim


class Table(tiltsim.LawController):
    law: Literal["LAW"]

    @staticmethod
    def control(observed, p):
        raise LookupError
"""
BROKEN = {
    "sys.exit": ("import sys\nsys.exit(7)", "SystemExit: 7"),
    "exit without a code": ("raise SystemExit", "SystemExit"),
    "base exception": ("raise BaseException('base')", "BaseException: base"),
    "keyboard interrupt": ("raise KeyboardInterrupt", "KeyboardInterrupt"),
    "control characters": ("raise ValueError('\\x1b[31mred\\nline')", "\\x1b[31mred line"),
    "no text": (
        "class Mute(Exception):\n    def __str__(self):\n        raise ValueError\nraise Mute",
        "Mute",
    ),
    "unresolved annotation": (TABLE + "    other: 'Missing' = None\n", "Missing"),
    "no schema": (
        TABLE + "    call: Annotated[object, 0] = None\n    other: type(lambda: 0) = None\n",
        "Pydantic",
    ),
    "raises in its schema": (
        TABLE + "\n    @classmethod\n    def __get_pydantic_json_schema__(cls, *_):\n"
        "        raise OSError('no')\n",
        "OSError: no",
    ),
}


def install(folder, package, text, entry_points=None):
    """A package with one controller, LAW, in a folder of the path."""
    (folder / f"{package}.py").write_text(text.replace("LAW", "plain"))
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    known = entry_points or f"[tiltsim.controllers]\nplain = {package}:Table\n".encode()
    (info / "entry_points.txt").write_bytes(known)


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    before = {*sys.modules}
    yield tmp_path
    for name in {*sys.modules} - before:
        if name.startswith("package_"):
            del sys.modules[name]


def found():
    """The packages' controllers, and the lines of warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tables = installed_controllers(())
    return tables, [str(one.message) for one in caught]


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_package_is_left_out_with_one_line(site, name):
    text, shown = BROKEN[name]
    install(site, "package_a", text)
    install(site, "package_b", TABLE)
    tables, (line,) = found()
    assert line.startswith("the controller plain of the package package_a is left out: ")
    assert shown in line
    assert line.isprintable()
    assert tables["plain"].__module__ == "package_b"


@pytest.mark.parametrize("content", [b"[tiltsim.controllers]\nplain\n", b"[x]\n\xff = y\n"])
def test_a_broken_list_of_entry_points_leaves_out_its_package(site, content):
    install(site, "package_a", TABLE, content)
    install(site, "package_b", TABLE)
    tables, (line,) = found()
    assert line.startswith("the package package_a is left out: its entry_points.txt: ")
    assert tables["plain"].__module__ == "package_b"


def test_of_two_packages_with_one_controller_the_second_is_named(site):
    install(site, "package_b", TABLE)
    install(site, "package_a", TABLE)
    tables, (line,) = found()
    assert tables["plain"].__module__ == "package_a"
    assert line == (
        "the controller plain of the package package_b is left out: "
        "the package package_a has a controller of this name"
    )


def test_an_interrupt_from_the_keyboard_is_none_of_a_package(site):
    install(site, "package_a", "import signal\nsignal.raise_signal(signal.SIGINT)\n" + TABLE)
    with pytest.raises(KeyboardInterrupt):
        found()


def test_the_command_line_prints_one_line(site):
    install(site, "package_a", BROKEN["control characters"][0])
    install(site, "package_b", BROKEN["raises in its schema"][0])
    done = subprocess.run(
        [sys.executable, "-m", "tiltsim", "schema", "controller"],
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    first, second = done.stderr.splitlines()
    assert first.startswith("tiltsim: warning: the controller plain of the package package_a")
    assert second.startswith("tiltsim: warning: the controller plain of the package package_b")
