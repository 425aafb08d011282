"""A flight that is stepped by its caller, with MuJoCo's own model and data."""

from collections.abc import Iterable, Mapping
from os import PathLike
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.plants.built_in import built_in_command
from tiltsim.plants.command import Command, Controller, ControllerError, Observation, Observer
from tiltsim.plants.commanded_plant import UserControlledPlant
from tiltsim.plants.mujoco_plant import MujocoPlant, flight_model
from tiltsim.plants.plant import take_sample
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.simulate import TerminationMonitor, failure, fly_chunk, make_plant
from tiltsim.system.arguments import whole_number
from tiltsim_controllers.mathematics.scalar import Floats


class Simulation:
    """A flight in MuJoCo, stepped by its caller.

    Steps equal `tiltsim.simulate` bit for bit, as long as you do not change `data`. It may go on
    beyond ``simulation.duration``, unless a function of time was sampled up to there.

    Args:
        scenario: See `tiltsim.simulate`.
        controller: A custom controller in place of the scenario's; see `tiltsim.load_scenario`.
        reference: A custom motion, as a function of time or a table; see `tiltsim.load_scenario`.
        gait: A custom gait, likewise.

    Raises:
        InputError: If the scenario is invalid or not simulated by MuJoCo, the vehicle cannot be
            built, or your controller cannot be used.
    """

    def __init__(
        self,
        scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
        *,
        controller: Controller | type | str | None = None,
        reference: object = None,
        gait: object = None,
    ) -> None:
        named = not isinstance(scenario, Scenario)
        self.scenario = load_scenario(
            scenario, controller=controller, reference=reference, gait=gait, trusted=named
        )
        simulation = self.scenario.simulation
        if simulation.plant != "mujoco":
            raise InputError(
                f'simulation.plant = "{simulation.plant}": stepwise simulation needs "mujoco"'
            )
        self._assembly = assemble(self.scenario)
        native = simulation.engine == "native"
        model = flight_model(self._assembly, visuals=True)
        plant = make_plant(self._assembly, "native" if native else "python", model)
        assert isinstance(plant, MujocoPlant)
        self._plant, self._beginning = plant, plant.state
        self._begin()

    def __repr__(self) -> str:
        """The scenario and the time, in one line."""
        name = self.scenario.address or self.scenario.title
        return f"<Simulation of {name}: {self.time:g} s{f', {self.end.kind}' if self.end else ''}>"

    def reset(self) -> None:
        """Go back to time zero, in the same `model` and `data`."""
        self._plant.state = self._beginning
        if isinstance(self._plant, UserControlledPlant):
            self._plant.restart()
        self._begin()

    def _begin(self) -> None:
        self._monitor = TerminationMonitor(self._assembly)
        self._samples = [take_sample(self._plant)]
        self._end = self._monitor.check(self._plant, self._samples[0])
        self._wall_time = 0.0

    def step(self, steps: int = 1) -> None:
        """Take physics steps of ``simulation.timestep``, under the scenario's controller.

        Args:
            steps: Number of physics steps; at least 1.

        Raises:
            InputError: If that is no such number, the flight has ended (see `end`), or it would go
                on beyond a table that does not hold.
            ControllerError: If a custom controller fails, which is then the `end`.
        """
        steps = whole_number("steps", steps)
        if self._end is not None:
            raise InputError(f"step: {self._end.message}; begin again with reset()")
        self._check_tables(self._plant.steps_taken + steps)
        start = perf_counter()
        samples: Iterable[Floats] = ()
        try:
            samples, self._end = fly_chunk(self._plant, self._monitor, 1, steps)
        except ControllerError as error:
            samples, self._end = failure(self._plant, self._monitor, self._samples[-1][0], error)
            raise
        finally:
            self._samples += samples
            self._wall_time += perf_counter() - start

    def _check_tables(self, steps: int) -> None:
        """Raise `InputError` if a table ends before this number of steps."""
        simulation = self.scenario.simulation
        for name, table in self.scenario.time_tables.items():
            if steps > simulation.steps and table.ends_before(steps * simulation.timestep):
                raise InputError(
                    f"step: the {name} ends at {table.table[-1][0]:g} s; make simulation.duration "
                    f"longer, or set {name}.hold = true"
                )

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._plant.time

    @property
    def end(self) -> End | None:
        """Kind, time and cause of an early end of the flight; None as long as it goes on."""
        return self._end

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model, with visuals and sensors, for your renderers and sensors."""
        return self._plant.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data; the next step starts from the values that you write, such as ``qpos``."""
        return self._plant.data

    def observation(self) -> Observation:
        """The state as a controller sees it now, through the scenario's sensors.

        Raises `InputError` for vehicles in a plane, which have none.
        """
        self.scenario.require_rotorcraft("observation")
        values = dict(zip(self._assembly.loop.sample_fields[1:], self._plant.observe()))
        speeds = [values[f"rotor_speed_{rotor}"] for rotor in self._assembly.loop.kind.rotors]
        return Observer(self._assembly).observe(self._plant, speeds)

    def command(self) -> Command:
        """The command of the built-in controller now, before latency, servos and motors.

        Rotor accelerations and tilt angles; thrusts for the quadrotor. Raises `InputError` for
        vehicles in a plane, and if the scenario has a custom controller.
        """
        self.scenario.require_rotorcraft("command")
        if self.scenario.controller.is_external:
            raise InputError("command: the controller is your own; call it with observation()")
        return built_in_command(self._assembly, self._plant)

    def flight(self) -> Flight:
        """The flight so far, with one sample at the beginning and one after every `step`."""
        end = self._end
        if end is None and self._plant.steps_taken >= self.scenario.simulation.steps:
            end = End("completed", self.time)
        elif end is None:
            end = End("interrupted", self.time, "the simulation has not ended")
        samples = np.array(self._samples)
        return Flight(self._assembly, samples, end, self._plant.engine, self._wall_time)
