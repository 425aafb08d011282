"""What is kept of compiled code, when several processes compile at once."""

from __future__ import annotations

import subprocess
import sys

from numba.core.caching import IndexDataCacheFile

ENTRIES = 150

SAVE = """
import sys
import tiltsim.engines.native_engine
from numba.core.caching import IndexDataCacheFile

folder, name, count = sys.argv[1:]
index = IndexDataCacheFile(folder, "law", "stamp")
for entry in range(int(count)):
    index.save((name, entry), (name, entry))
"""


def test_processes_that_compile_at_once_find_what_they_compiled(tmp_path):
    names = ("a", "b")
    savers = [
        subprocess.Popen([sys.executable, "-c", SAVE, str(tmp_path), name, str(ENTRIES)])
        for name in names
    ]
    assert [saver.wait(timeout=60) for saver in savers] == [0, 0]
    index = IndexDataCacheFile(str(tmp_path), "law", "stamp")
    keys = [(name, entry) for name in names for entry in range(ENTRIES)]
    assert [index.load(key) for key in keys] == keys
