"""Files that are written atomically."""

from __future__ import annotations

import os

import pytest

from tiltsim.system.files import replacing


@pytest.mark.parametrize("durable", [False, True])
def test_a_file_appears_complete_or_keeps_its_content(tmp_path, durable):
    path = tmp_path / "file"
    with replacing(path, durable=durable) as temporary:
        temporary.write_bytes(b"before")
        assert not path.exists()
    with pytest.raises(FileNotFoundError), replacing(path, durable=durable):
        pass  # nothing was written
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_durable_file_replaces_another_only_once_it_is_on_disk(tmp_path, monkeypatch):
    def no_disk(_descriptor):
        raise OSError("no disk")

    path = tmp_path / "file"
    path.write_bytes(b"before")
    monkeypatch.setattr(os, "fsync", no_disk)
    with pytest.raises(OSError, match="no disk"), replacing(path, durable=True) as temporary:
        temporary.write_bytes(b"after")
    assert path.read_bytes() == b"before"
