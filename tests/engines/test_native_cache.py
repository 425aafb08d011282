"""The cache of compiled code: one process after the other, and for our functions only."""

from __future__ import annotations

import importlib
import os
import resource
import subprocess
import sys
from inspect import unwrap
from pathlib import Path

import pytest
from numba.core import config
from numba.core.caching import FunctionCache, IndexDataCacheFile

import tiltsim.engines.native_engine  # noqa: F401  as whoever flies
from tiltsim.engines import cache, compiling
from tiltsim.engines.cache import native_code_folder

ENTRIES = 150

SAVE = """
import sys
from tiltsim.engines.compiling import NativeCodeCache
from tiltsim_controllers.mathematics.scalar import clipped

cache = NativeCodeCache(clipped)
cache._impl.locator.ensure_cache_path()
index = cache._cache_file
for entry in range(int(sys.argv[1])):
    index.save(("other", entry), ("other", entry))
    print(end=".", flush=True)
"""


def test_processes_that_compile_at_once_find_what_they_compiled(tmp_path, monkeypatch):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-c", SAVE, str(ENTRIES)]
    folder = tmp_path / "tiltsim" / native_code_folder().name
    monkeypatch.setattr(compiling, "native_code_folder", lambda: folder)
    index = compiling.NativeCodeCache(named("clipped"))._cache_file
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE) as other:
        assert other.stdout.read(1)  # it has saved the first of its entries
        for entry in range(ENTRIES):
            index.save(("this", entry), ("this", entry))
        other.stdout.read()  # to the end, so that it never writes to a closed pipe
    assert other.returncode == 0
    keys = [(name, entry) for name in ("this", "other") for entry in range(ENTRIES)]
    assert [index.load(key) for key in keys] == keys


def test_equal_sources_in_another_place_have_a_folder_of_their_own(tmp_path, monkeypatch):
    here = Path(cache.__file__)
    (tmp_path / "tiltsim").symlink_to(here.parents[1])
    folder = native_code_folder()
    monkeypatch.setattr(cache, "__file__", str(tmp_path / "tiltsim" / "engines" / "cache.py"))
    moved = unwrap(native_code_folder)()
    assert moved.parent == folder.parent
    assert moved != folder
    monkeypatch.setattr(cache, "__file__", str(here))
    assert unwrap(native_code_folder)() == folder


def named(name):
    return next(f for f in compiling.scalar_functions() if f.__name__ == name)


def test_compiled_code_of_others_is_cached_where_numba_puts_it(tmp_path, monkeypatch):
    code = "import numba\n\n\n@numba.njit(cache=True)\ndef twice(x):\n    return 2.0 * x\n"
    (tmp_path / "foreign.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    twice = importlib.import_module("foreign").twice
    assert twice(2.0) == 4.0
    assert type(twice._cache) is FunctionCache
    assert IndexDataCacheFile.save.__module__ == "numba.core.caching"
    assert not str(config.CACHE_DIR).startswith(str(native_code_folder()))
    assert list((tmp_path / "__pycache__").glob("foreign.twice-*.nbi"))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of compiled code."""
    folder = tmp_path / "tiltsim" / "digest"
    for module in (cache, compiling):
        monkeypatch.setattr(module, "native_code_folder", lambda: folder)
    monkeypatch.setattr(cache, "failed_saves", [])
    monkeypatch.setattr(compiling, "failed_saves", cache.failed_saves)
    return folder


def code_files(folder):
    return sorted(folder.rglob("*clipped*.nb[ic]"))


def clip():
    """Load or compile the native code of a function, and call it."""
    function = compiling.compiled(named("clipped"))
    assert function(2.0, -1.0, 1.0) == 1.0
    return function.stats


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("damage", ["truncated", "empty", "garbled"])
def test_damaged_code_is_compiled_again(folder, damage, place):
    index = compiling.NativeCodeCache(named("clipped"))._cache_file
    compiling.NativeCodeCache(named("clipped"))._impl.locator.ensure_cache_path()
    index.save("key", "code")
    file = code_files(folder)[place]
    content = file.read_bytes()
    flipped = bytes([*content[:-3], content[-3] ^ 1, *content[-2:]])
    file.write_bytes({"truncated": content[:-9], "empty": b"", "garbled": flipped}[damage])
    assert index.load("key") is None
    index.save("key", "code")
    assert index.load("key") == "code"


def test_code_is_loaded_or_compiled_again_with_the_same_result(folder):
    assert clip().cache_misses
    assert clip().cache_hits
    for file in code_files(folder):
        file.write_bytes(file.read_bytes()[:-1])
    assert clip().cache_misses
    assert clip().cache_hits


def test_code_that_cannot_be_saved_is_used_all_the_same(folder):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    try:
        assert clip().cache_misses
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    cache.mark_native_code_compiled("clipped")
    assert not cache.native_code_is_cached("clipped")


def test_the_folder_of_code_is_private_whatever_the_umask(folder):
    folder.parent.mkdir()
    folder.parent.chmod(0o777)  # by an earlier version
    previous = os.umask(0)
    try:
        assert cache.native_code_is_cacheable()
    finally:
        os.umask(previous)
    assert [path.stat().st_mode & 0o777 for path in (folder.parent, folder)] == [0o700, 0o700]


def test_a_folder_of_somebody_else_is_not_trusted(folder, monkeypatch):
    cache.mark_native_code_compiled("clipped")
    assert cache.native_code_is_cached("clipped")
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert not cache.native_code_is_cached("clipped")
    assert not clip().cache_hits
    assert not code_files(folder)
