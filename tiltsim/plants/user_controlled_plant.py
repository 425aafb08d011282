"""A plant that flies a user's own controller."""

from __future__ import annotations

from typing import Any

from tiltsim.plants.command import CheckedCommand
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.plants.user_controller import own_controller
from tiltsim.scenario.scenario import Scenario


class UserControlledPlant(CommandedPlant):
    """A vehicle under a user's own controller, which is asked at every control sample.

    An interval may be repeated from a saved state, to find the step on which a flight was lost.
    Answers are kept for that, so that a controller with a memory lives through each moment once.
    """

    def __init__(self, scenario: Scenario, controller: Any = None) -> None:
        super().__init__(scenario)
        self._controller = own_controller(scenario, controller)
        self._scenario = scenario
        self._asked = False
        self._every = max(1, scenario.simulation.control_steps)
        self._answers: dict[int, CheckedCommand] = {}

    def advance(self, steps: int) -> None:
        """See `Plant.advance`. Raises `ControllerError` at the time the controller fails."""
        step = self.steps_taken
        self._answers = {known: answer for known, answer in self._answers.items() if known >= step}
        end = step + steps
        while step < end:
            if step % self._every == 0:
                self.apply(self._answer(step))
            chunk = min(end - step, self._every - step % self._every)
            super().advance(chunk)
            step += chunk

    def _answer(self, step: int) -> CheckedCommand:
        if not self._asked:
            self._asked = True
            self._controller.reset(self._scenario)
        if step not in self._answers:
            orders = self._controller.orders(self.seen(), tilting=self.tilting)
            self._answers[step] = orders
        return self._answers[step]
