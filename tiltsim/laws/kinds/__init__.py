"""Closed loops of the kinds of vehicles in `tiltsim.scenario.kinds`.

All files of this folder are discovered at import; each lists its loops in ``LOOPS``.
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import Final

from tiltsim.closed_loop.loop import ClosedLoop

LOOPS_OF_KINDS: Final[dict[str, ClosedLoop]] = {
    name: loop
    for file in iter_modules(__path__)
    for name, loop in import_module(f"{__name__}.{file.name}").LOOPS.items()
}
"""Loops by their names; see `tiltsim.scenario.controller_table.ControllerTable.loop_name`."""
