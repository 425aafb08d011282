"""A user's own controller: the plant that it flies, its loading, and messages when it fails.

A controller is anything that takes an `Observation` and returns a `Command`: a function, or an
object with ``__call__`` for one with a memory. It is called at every control sample, and its
command is held until the next.
"""

from collections.abc import Callable
from typing import Any

import mujoco

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.errors import InputError
from tiltsim.plants.autopilot import FirmwareController
from tiltsim.plants.command import (
    CheckedCommand,
    Controller,
    ControllerError,
    Observation,
    check_command,
)
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.law_controller import is_law
from tiltsim.scenario.own_code import describe, load_function
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft.layout import Layout


class UserController:
    """A user's controller in a flight: any error in it is raised as a `ControllerError`."""

    def __init__(self, controller: Controller, name: str) -> None:
        self._controller, self._name = controller, name

    def reset(self, scenario: Scenario) -> None:
        """Call the controller's own ``reset``, if it has one. Raises `ControllerError`."""
        reset = getattr(self._controller, "reset", None)
        if reset is not None:
            self._call(reset, scenario)

    def command(self, observation: Observation, layout: Layout) -> CheckedCommand:
        """The checked command for an observation. Raises `ControllerError`."""
        command = self._call(self._controller, observation)
        try:
            return check_command(command, layout)
        except ControllerError as error:
            raise ControllerError(f"the controller {self._name} {error}") from None

    def _call(self, function: Callable[[Any], Any], argument: object) -> Any:
        try:
            return function(argument)
        except ControllerError:
            raise
        except (Exception, SystemExit) as error:
            raise ControllerError(
                f"the controller {self._name} raised {describe(error)}"
            ) from error


def load_controller(scenario: Scenario) -> UserController:
    """The controller of a scenario under the law ``python``: given in Python, or in a file.

    A class makes one without arguments. Raises `InputError` if it cannot be loaded or made.
    """
    table, controller = scenario.controller, scenario.own_controller
    assert isinstance(table, PythonController)
    if scenario.autopilot is not None:
        return UserController(FirmwareController(scenario), "autopilot")
    name = table.function
    if controller is None:
        controller = load_function(scenario)
        if is_law(controller):
            raise InputError(
                f'{scenario.address or "scenario"}: controller.function = "{table.function}": '
                'is a law of arrays; fly it by this key and controller.law = "numpy"'
            )
        name = f"{table.file.name}:{table.attribute}" if table.file is not None else name
    if isinstance(controller, type):
        try:
            controller = controller()
        except (Exception, SystemExit) as error:
            raise InputError(
                f"controller {name}: raised when it was made: {describe(error)}"
            ) from error
    return UserController(controller, name)


class UserControlledPlant(CommandedPlant):
    """A vehicle under a user's own controller, which is called at every control sample.

    An interval may be repeated from a saved state, to find the step on which a flight ended. The
    commands are kept for that, so that a controller with a memory is called once per sample.

    """

    def __init__(self, assembly: Assembly, model: mujoco.MjModel | None = None) -> None:
        super().__init__(assembly, model)
        self._scenario = assembly.scenario
        self._every = max(1, assembly.scenario.simulation.control_steps)
        self.restart()

    def restart(self) -> None:
        """Begin a flight with a controller that remembers nothing."""
        self._controller = load_controller(self._scenario)
        self._was_reset = False
        self._commands: dict[int, CheckedCommand] = {}  # by step

    def advance(self, steps: int) -> None:
        """Raises `ControllerError` at the time the controller fails."""
        step = self.steps_taken
        self._commands = {known: c for known, c in self._commands.items() if known >= step}
        end = step + steps
        while step < end:
            if step % self._every == 0:
                self.apply(self._command(step))
            chunk = min(end - step, self._every - step % self._every)
            super().advance(chunk)
            step += chunk

    def _command(self, step: int) -> CheckedCommand:
        if not self._was_reset:
            self._was_reset = True
            self._controller.reset(self._scenario)
        if step not in self._commands:
            command = self._controller.command(self.observation(), self.layout)
            self._commands[step] = command
        return self._commands[step]
