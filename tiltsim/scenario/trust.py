"""The one decision whether the Python code that a scenario names may be executed.

The permission is a property of the scenario and goes with it, also to other processes. Reading a
scenario gives none; `tiltsim.scenario.own_code`, which alone executes such files, checks it here.
"""

import os
from typing import Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import OwnFunctionController
from tiltsim.scenario.messages import show
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.numbers import true_or_false

VARIABLE: Final = "TILTSIM_TRUST"
"""Environment variable that, set to 1, stands for ``--trust``."""


def is_trusted(option: bool) -> bool:
    """Whether ``--trust`` is given, or the environment variable in its place."""
    return true_or_false("trusted", option) or os.environ.get(VARIABLE) == "1"


def with_trust(scenario: Scenario, trusted: bool = True) -> Scenario:
    """The scenario with permission to execute the Python code that it names, if it is trusted."""
    if not trusted or not isinstance(scenario.controller, OwnFunctionController):
        return scenario
    allowed = scenario.model_copy()
    allowed._trusted = True
    return allowed


def require_trust(scenario: Scenario) -> None:
    """Raise `InputError` for a scenario that names a file of Python code, without permission."""
    table = scenario.controller
    if not isinstance(table, OwnFunctionController) or table.file is None:
        return
    if not scenario._trusted and scenario.own_controller is None:
        raise InputError(
            f"{scenario.address or 'scenario'}: controller.function = {show(table.function)}: is "
            f"Python code to execute; allow it with --trust or {VARIABLE}=1 "
            "(in Python: load_scenario(..., trusted=True))"
        )
