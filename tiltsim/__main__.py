"""The console script, and ``python -m tiltsim``."""

from __future__ import annotations

import os
import sys


def main() -> int:
    """Run the command line; an interrupt is one line from the first import on.

    Processes that it and its libraries start import nothing from the working folder, where a
    struct.py may lie beside downloaded scenarios.
    """
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    try:
        from tiltsim.cli import main as command_line

        return command_line()
    except KeyboardInterrupt:
        from tiltsim.exit_codes import INTERRUPTED

        print("tiltsim: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
