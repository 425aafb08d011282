"""The console script, and ``python -m tiltsim``."""

import os
import sys


def main() -> int:
    """Run the command line; an interrupt is one line from the first import on."""
    try:
        from tiltsim.system.environment import variables_for_processes

        os.environ |= variables_for_processes()
        from tiltsim.cli import main as command_line

        return command_line()
    except KeyboardInterrupt:
        from tiltsim.errors import INTERRUPTED

        print("tiltsim: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
