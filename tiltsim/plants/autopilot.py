"""A firmware in lockstep: its outputs command the rotors, and it waits for readings."""

import numpy as np

from tiltsim.plants.autopilot_links import LINKS, Link, Readings
from tiltsim.plants.autopilot_mixer import Mixer
from tiltsim.plants.command import Command, ControllerError, Observation
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.simulation_table import AutopilotTable
from tiltsim_controllers.mathematics.attitude import FLIP, rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats


class FirmwareController:
    """The controller of a scenario with ``[autopilot]``: called once per exchange.

    Args:
        scenario: The scenario.

    Raises:
        InputError: If its outputs do not fit the vehicle, or the port is in use.
    """

    def __init__(self, scenario: Scenario) -> None:
        assert scenario.autopilot is not None
        self._table: AutopilotTable = scenario.autopilot
        self._mixer = Mixer(scenario)
        self._step = self._table.control_timestep
        self._weight = self._mixer.vehicle.mass * self._mixer.vehicle.gravity
        self._gravity = np.array([0.0, 0.0, self._mixer.vehicle.gravity])
        self._velocity: Floats | None = None
        self._exchanges = 0
        self._link: Link = LINKS[self._table.type](
            self._table, self._mixer.signed, scenario.address
        )

    def reset(self, _scenario: Scenario) -> None:
        """Hold the vehicle at rest until the firmware lifts it."""
        command = self._mixer.command(self._link.exchange(None))
        zero, upright = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        while self._mixer.lift(command) <= self._weight:
            if self._exchanges * self._step > self._table.hold:
                raise ControllerError(
                    f"autopilot.hold: {self._table.hold:g} s of simulated time without lift-off"
                )
            command = self._exchange(zero, zero, upright, zero, self._gravity)

    def __call__(self, observation: Observation) -> Command:
        """Send the sensors' readings, and wait for outputs."""
        rotation = rotation_of_quaternion(observation.quaternion)
        before = observation.velocity if self._velocity is None else self._velocity
        accelerated = (observation.velocity - before) / self._step + self._gravity
        self._velocity = observation.velocity
        return self._exchange(
            observation.position,
            observation.velocity,
            observation.quaternion,
            observation.body_rates,
            rotation.T @ accelerated,  # the mean specific force since the last exchange
        )

    def _exchange(
        self, position: Floats, velocity: Floats, turn: Floats, rates: Floats, force: Floats
    ) -> Command:
        """Turn readings into the firmware's frames, send them and receive its outputs."""
        self._exchanges += 1
        now = self._exchanges * self._step
        rows = [row for row in self._table.rc if row[0] <= now]
        sticks = rows[-1][1:] if rows else ()
        vectors = (
            FLIP * position,
            FLIP * velocity,
            turn * [1.0, *FLIP],
            FLIP * rates,
            FLIP * force,
        )
        return self._mixer.command(self._link.exchange(Readings(now, *vectors, sticks)))
