"""Whether the Python code that scenario files name may be executed."""

from __future__ import annotations

import os
from typing import Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import OwnFunctionController
from tiltsim.scenario.messages import show
from tiltsim.scenario.scenario import Scenario

VARIABLE: Final = "TILTSIM_TRUST"
"""Environment variable that, set to 1, stands for ``--trust``."""


def is_trusted(option: bool) -> bool:
    """Whether ``--trust`` is given, or the environment variable in its place."""
    return option or os.environ.get(VARIABLE) == "1"


def require_trust(scenario: Scenario, trusted: bool) -> None:
    """Raise `InputError` for a scenario that executes Python code, unless it is trusted.

    For commands that fly many scenarios, whose files nobody has to have read.
    """
    table = scenario.controller
    if not trusted and isinstance(table, OwnFunctionController):
        raise InputError(
            f"{scenario.address or 'scenario'}: controller.function = {show(table.function)}: is "
            f"Python code to execute; allow it with --trust or {VARIABLE}=1"
        )
