"""The cache of compiled code: one process after the other, and for our functions only."""

from __future__ import annotations

import os
import subprocess
import sys

import tiltsim.engines.compiling as compiling
from tiltsim.engines.cache import native_code_folder

ENTRIES = 150

SAVE = """
import sys
from tiltsim.engines.compiling import NativeCodeCache
from tiltsim_controllers.mathematics.scalar import clipped

name, count = sys.argv[1:]
cache = NativeCodeCache(clipped)
cache._impl.locator.ensure_cache_path()
index = cache._cache_file
for entry in range(int(count)):
    index.save((name, entry), (name, entry))
"""

FOREIGN = """
import sys
import numba
import tiltsim.engines.native_engine
from tiltsim.engines.cache import native_code_folder
sys.path.insert(0, sys.argv[1])
from foreign import twice

assert twice(2.0) == 4.0
folder = str(native_code_folder())
assert not twice._cache.cache_path.startswith(folder), twice._cache.cache_path
assert type(twice._cache) is numba.core.caching.FunctionCache
assert not numba.core.config.CACHE_DIR.startswith(folder)
assert numba.core.caching.IndexDataCacheFile.save.__module__ == "numba.core.caching"
"""


def environment(folder):
    return {**os.environ, "XDG_CACHE_HOME": str(folder)}


def test_processes_that_compile_at_once_find_what_they_compiled(tmp_path, monkeypatch):
    names = ("a", "b")
    savers = [
        subprocess.Popen(
            [sys.executable, "-c", SAVE, name, str(ENTRIES)], env=environment(tmp_path)
        )
        for name in names
    ]
    assert [saver.wait(timeout=60) for saver in savers] == [0, 0]
    folder = tmp_path / "tiltsim" / native_code_folder().name
    monkeypatch.setattr(compiling, "native_code_folder", lambda: folder)
    index = compiling.NativeCodeCache(named("clipped"))._cache_file
    keys = [(name, entry) for name in names for entry in range(ENTRIES)]
    assert [index.load(key) for key in keys] == keys


def named(name):
    return next(f for f in compiling.scalar_functions() if f.__name__ == name)


def test_compiled_code_of_others_is_cached_where_numba_puts_it(tmp_path):
    code = "import numba\n\n\n@numba.njit(cache=True)\ndef twice(x):\n    return 2.0 * x\n"
    (tmp_path / "foreign.py").write_text(code, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", FOREIGN, str(tmp_path)], env=environment(tmp_path / "cache")
    )
    assert done.returncode == 0
    assert list((tmp_path / "__pycache__").glob("foreign.twice-*.nbi"))
