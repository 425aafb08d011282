"""Files that are written atomically."""

from __future__ import annotations

import os
import re
import resource
from pathlib import Path

import pytest

from tiltsim.errors import InputError
from tiltsim.system.files import locked, prepare_file, prepare_folder, remove_leftovers, replacing

HEX = "0123456789abcdef"
"""Digits of the random part of the names of files that are being written."""


@pytest.mark.parametrize("durable", [False, True])
def test_a_file_appears_complete_or_keeps_its_content(tmp_path, durable):
    path = tmp_path / "file"
    with replacing(path, durable=durable) as temporary:
        temporary.write_bytes(b"before")
        assert not path.exists()
    words = "file: cannot be written: No such file"
    with pytest.raises(InputError, match=words), replacing(path, durable=durable):
        pass  # nothing was written
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_durable_file_replaces_another_only_once_it_is_on_disk(tmp_path, monkeypatch):
    def no_disk(_descriptor):
        raise OSError("no disk")

    path = tmp_path / "file"
    path.write_bytes(b"before")
    monkeypatch.setattr(os, "fsync", no_disk)
    with pytest.raises(InputError, match="no disk"), replacing(path, durable=True) as temporary:
        temporary.write_bytes(b"after")
    assert path.read_bytes() == b"before"


@pytest.mark.parametrize(
    ("attempt", "begins"),
    [
        (prepare_folder, "a\0b"),
        (lambda path: prepare_file("--junit", path), "--junit a\0b"),
        (lambda path: prepare_file("--junit", path / "file"), "--junit a\0b/file"),
        (lambda path: replacing(path).__enter__(), "a\0b"),
    ],
)
def test_a_name_with_a_null_character_is_a_mistake(attempt, begins):
    with pytest.raises(InputError) as caught:
        attempt(Path("a\0b"))
    assert str(caught.value) == f"{begins}: no file can have a null character in its name"


def test_a_full_disk_names_the_file_and_leaves_the_old_one(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"before")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        words = "file: cannot be written: File too large"
        with pytest.raises(InputError, match=words), replacing(path) as temporary:
            temporary.write_bytes(b"after" * 100)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_nobody_can_guess_the_temporary_name_and_make_a_link_of_it(tmp_path):
    names = set()
    for _ in range(3):
        with replacing(tmp_path / "file") as temporary:
            temporary.touch()
            names.add(temporary.name)
    assert len(names) == 3
    assert all(re.fullmatch(r"\.file\.[0-9a-f]{16}\.new", name) for name in names)


def test_a_device_is_written_and_stays_one():
    with replacing(Path("/dev/null")) as path:
        path.write_bytes(b"nothing")
    assert Path("/dev/null").is_char_device()
    words = "/dev/full: cannot be written: No space left on device"
    with pytest.raises(InputError, match=words), replacing(Path("/dev/full")) as path:
        path.write_bytes(b"nothing")


def test_a_lock_changes_no_file_and_follows_no_link(tmp_path):
    (tmp_path / "file").write_bytes(b"content")
    with locked(tmp_path / "file", wait=False):
        pass
    assert (tmp_path / "file").read_bytes() == b"content"
    (tmp_path / "link").symlink_to(tmp_path / "file")
    with pytest.raises(OSError, match="link"), locked(tmp_path / "link", wait=False):
        pass


def test_only_what_killed_processes_left_is_removed(tmp_path):
    left = f".part.{HEX}.new"
    others = {".part.new", ".part.123.new", f".part.{HEX}0.new", f".part.{HEX.upper()}.new"}
    for name in {left, *others, f".other.{HEX}.new", f".part.{HEX}.old", "part", ".my part.new"}:
        (tmp_path / name).touch()
    (tmp_path / f".part.{HEX[::-1]}.new").mkdir()
    before = {file.name for file in tmp_path.iterdir()}
    remove_leftovers(tmp_path, re.compile("part"))
    assert {file.name for file in tmp_path.iterdir()} == before - {left}
