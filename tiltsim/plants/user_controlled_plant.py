"""A vehicle that a user's own controller flies."""

from __future__ import annotations

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.plants.command import CheckedCommand, Controller
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.plants.user_controller import load_controller


class UserControlledPlant(CommandedPlant):
    """A vehicle under a user's own controller, which is called at every control sample.

    An interval may be repeated from a saved state, to find the step on which a flight ended. The
    commands are kept for that, so that a controller with a memory is called once per sample.

    Parameters
    ----------
    assembly
        The flight.
    controller
        Default: the one that the scenario names.
    """

    def __init__(self, assembly: Assembly, controller: Controller | type | None = None) -> None:
        super().__init__(assembly)
        self._controller = load_controller(assembly.scenario, controller)
        self._scenario = assembly.scenario
        self._was_reset = False
        self._every = max(1, assembly.scenario.simulation.control_steps)
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
            command = self._controller.command(self.observation(), tilting=self.tilting)
            self._commands[step] = command
        return self._commands[step]
