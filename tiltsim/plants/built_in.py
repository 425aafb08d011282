"""Built-in controllers as functions of observations."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.closed_loop.userdata import Header
from tiltsim.engines.base import vectors_of
from tiltsim.engines.control import control_step
from tiltsim.engines.programs import KEPT
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.laws.layers.instruments import instruments_of
from tiltsim.plants.command import Command, Observation, flip_by_spin
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft import is_fixed_cross, layout_of
from tiltsim_controllers.mathematics.scalar import Values


def built_in_command(assembly: Assembly, plant: MujocoPlant) -> Command:
    """The command of a rotorcraft's built-in controller now, before latency, servos and motors.

    It goes inward through the layers of the loop, to the inputs of the controller itself.
    """
    loop, parameters, knots = assembly.loop, assembly.setup.parameters, assembly.setup.knots
    time, data = plant.evaluation_time, plant.data
    qpos, qvel, act = vectors_of(loop, data).joined()
    while loop.within is not None:
        qpos, qvel, act = loop.sees(time, qpos, qvel, act, parameters, knots)
        loop, parameters = loop.within, parameters.inner
    return _command(assembly, loop, _law(assembly).controls(plant.time, qpos, qvel, act))


def _readings(scenario: Scenario) -> int:
    """The number of readings of the instruments, which stand behind the velocities."""
    return sum(len(each.columns) for each in instruments_of(scenario))


class _Law:
    """The controller of a flight without the layers around it."""

    def __init__(self, assembly: Assembly) -> None:
        loop, parameters = assembly.loop, assembly.setup.parameters
        while loop.within is not None:
            loop, parameters = loop.within, parameters.inner
        scenario = assembly.scenario
        behind = 3 * scenario.controller.measures_angular_acceleration + _readings(scenario)
        if behind:  # the velocities
            loop = replace(loop, sizes=loop.sizes._replace(qvel=loop.sizes.qvel + behind))
        self.loop, self.setup = loop, assembly.setup._replace(parameters=parameters)
        bare = replace(assembly, loop=loop, setup=self.setup)
        self._step = control_step(bare, self.setup.userdata.tolist(), "controls")

    def controls(self, time: float, *state: Sequence[float]) -> Values:
        """Its controls at a time (s), where a step begins, by qpos, qvel and act.

        The forces felt are last in act.
        """
        now, own = Header(timestep=time, evaluations=1.0), self.loop.sizes.act
        qpos, qvel, act = (list(map(float, vector)) for vector in state)
        return tuple(self._step(now, qpos, qvel, act[:own], (), act[own:], ()))


_law = lru_cache(maxsize=KEPT)(_Law)


class BuiltInController:
    """The built-in controller of a rotorcraft's scenario, as a function of an observation.

    It integrates its own states, and its supervisor's, over ``simulation.control_timestep``. The
    force on the object that it pushes is the contact force: there must be no other object.

    Args:
        scenario: With a built-in controller.

    Raises:
        InputError: If the controller is a custom one, feeds back a state that is not observed or
            has instruments, or its vehicle is no rotorcraft.
    """

    def __init__(self, scenario: Scenario) -> None:
        controller, simulation = scenario.controller, scenario.simulation
        observed = scenario.vehicle.model in PythonController.vehicle_models
        felt = scenario.reference.type != "push" or len(scenario.object) == 1
        measures = controller.measures_angular_acceleration or scenario.sensors.instruments
        feeds_back = measures or not felt
        if not observed or controller.is_external or feeds_back:
            raise InputError("controller: must be a built-in one that needs observations only")
        self._assembly = assembly = assemble(scenario)
        self._law = _Law(assembly)
        loop = self._law.loop
        initial = loop.initial_activations(assembly, self._law.setup)
        self._states = list(initial[layout_of(loop).rotors :])
        self._period = simulation.control_timestep or simulation.timestep

    def __call__(self, seen: Observation) -> Command:
        """Its command, before latency, servos and motors: see `built_in_command`."""
        loop = self._law.loop
        qpos, qvel = [*seen.position, *seen.quaternion], [*seen.velocity, *seen.body_rates]
        if layout_of(loop).tilts:
            qpos, qvel = [*qpos, *seen.tilt_angles], [*qvel, *seen.tilt_rates]
        speeds = flip_by_spin(seen.rotor_speeds.tolist(), loop.spins)
        felt = [*seen.contact_force, *seen.contact_force, *seen.swing, *[0.0] * 6]
        ctrl = self._law.controls(seen.time, qpos, qvel, [*speeds, *self._states, *felt])
        rates = ctrl[len(ctrl) - len(self._states) :]
        self._states = [
            state + self._period * rate for state, rate in zip(self._states, rates, strict=True)
        ]
        return _command(self._assembly, loop, ctrl)


def _command(assembly: Assembly, loop: ClosedLoop, ctrl: Values) -> Command:
    """The command by a controller's controls; rotors on a fixed cross make thrusts."""
    layout = layout_of(loop)
    if is_fixed_cross(loop):
        coefficients = np.array(assembly.scenario.any_rotorcraft.thrust_coefficients)
        return Command(thrusts=coefficients * np.array(ctrl[: layout.rotors]))
    rates = ctrl[layout.acceleration_1 : layout.further_rates]
    return Command(
        rotor_accelerations=np.array(flip_by_spin(rates, loop.spins)),
        tilt_angles=np.array(ctrl[: layout.tilts]) if layout.tilts else None,
    )
