"""Exit codes of the command line, the same for every command."""

from typing import Final

DONE: Final = 0
EXPECTATION_FAILED: Final = 1
INVALID_INPUT: Final = 2
VEHICLE_LOST: Final = 3
INTERRUPTED: Final = 130
TERMINATED: Final = 143
