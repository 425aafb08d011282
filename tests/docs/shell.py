"""The commands of a shell block, as bash reads them: loops, quotes and redirections included."""

from __future__ import annotations

import subprocess
from pathlib import Path

RECORDER = r"""
# The commands of a pipeline run at once: each is appended by a single write.
command_not_found_handle() { local IFS=$'\x1f'; printf '%s\x1f\x1e' "$*" >> "$CALLS"; }
cd() { :; }
source() { :; }
"""


def commands(code: str, folder: Path) -> list[list[str]]:
    """Every command that a block would run, in order, with its arguments; none is run.

    Args:
        code: the block; programs of the environment are named with or without ``.venv/bin/``
        folder: where it redirects its output to
    """
    calls = folder / "calls"
    calls.write_text("")
    subprocess.run(
        ["/bin/bash", "-euo", "pipefail", "-c", RECORDER + code.replace(".venv/bin/", "")],
        env={"PATH": "/nowhere", "CALLS": str(calls)},
        cwd=folder,
        check=True,
    )
    return [call.split("\x1f")[:-1] for call in calls.read_text().split("\x1e")[:-1]]
