"""Commands of a built-in controller: in its plant's present state, or for an observation."""

from collections.abc import Sequence

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.engines.base import vectors_of
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.laws.layers.actuation import measured
from tiltsim.laws.layers.contact import felt_among
from tiltsim.laws.layers.instruments import plant_acceleration_of
from tiltsim.laws.layers.on_equations import read_actuators
from tiltsim.plants.command import Command, Observation
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.observing import flip_by_spin
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft.layout import layout_of
from tiltsim.vehicles.rotorcraft.others import others_of
from tiltsim_controllers.mathematics.scalar import Values


def built_in_command(assembly: Assembly, plant: MujocoPlant) -> Command:
    """The command of a rotorcraft's built-in controller now, before latency, servos and motors.

    It goes inward through the layers of the loop, to the inputs of the controller itself.
    """
    loop, parameters, knots = assembly.loop, assembly.setup.parameters, assembly.setup.knots
    time, data = plant.evaluation_time, plant.data
    qpos: Sequence[float]
    qvel: Sequence[float]
    qpos, qvel, act = vectors_of(loop, data).joined()
    while loop.within is not None:
        layer, within, inner = parameters.layer, loop.within, parameters.inner
        if hasattr(layer, "pod_inertias"):  # of measured acceleration: a record for the model
            ctrl = within.controls(time, qpos, (*qvel, 0.0, 0.0, 0.0), act, inner, knots)
            loads = read_actuators(within)[1](ctrl)
            turning = plant_acceleration_of(within)
            qvel = (*qvel, *turning(qpos, qvel, ctrl, loads, layer)[3:])
        elif hasattr(layer, "sensors"):  # of actuation: a record for the number of rotors
            qpos, qvel = measured(time, qpos, qvel, layer.sensors)
        elif hasattr(layer, "timestep"):  # of objects
            felt = felt_among(others_of(assembly.scenario))(qpos, act, layer.attachment)
            act = [*act[: within.sizes.act], *felt]
        elif hasattr(layer, "downwash"):  # of companions, whose state follows this vehicle's
            own, behind = within.sizes, act[loop.sizes.act :]
            qpos, qvel, act = qpos[: own.qpos], qvel[: own.qvel], [*act[: own.act], *behind]
        loop, parameters = within, inner
    ctrl = loop.controls(time, qpos, qvel, act, parameters, knots)
    return _command(assembly, loop, ctrl)


class BuiltInController:
    """The built-in controller of a rotorcraft's scenario, as a function of an observation.

    It integrates its own states, and its supervisor's, over ``simulation.control_timestep``. The
    force on the object that it pushes is the contact force: there must be no other object.

    Args:
        scenario: With a built-in controller.

    Raises:
        InputError: If the controller is a custom one or feeds back a state that is not observed, or
            its vehicle is no rotorcraft.
    """

    def __init__(self, scenario: Scenario) -> None:
        controller, simulation = scenario.controller, scenario.simulation
        observed = scenario.vehicle.model in PythonController.vehicle_models
        felt = scenario.reference.type != "push" or len(scenario.object) == 1
        feeds_back = controller.measures_angular_acceleration or not felt
        if not observed or controller.is_external or feeds_back:
            raise InputError("controller: must be a built-in one that needs observations only")
        self._assembly = assembly = assemble(scenario)
        loop, parameters = assembly.loop, assembly.setup.parameters
        while loop.within is not None:
            loop, parameters = loop.within, parameters.inner
        self._loop, self._parameters = loop, parameters
        setup = assembly.setup._replace(parameters=parameters)
        initial = loop.initial_activations(assembly, setup)
        self._states = list(initial[layout_of(loop).rotors :])
        self._period = simulation.control_timestep or simulation.timestep

    def __call__(self, seen: Observation) -> Command:
        """Its command, before latency, servos and motors: see `built_in_command`."""
        loop, knots = self._loop, self._assembly.setup.knots
        qpos, qvel = [*seen.position, *seen.quaternion], [*seen.velocity, *seen.body_rates]
        if layout_of(loop).tilts:
            qpos, qvel = [*qpos, *seen.tilt_angles], [*qvel, *seen.tilt_rates]
        speeds = flip_by_spin(seen.rotor_speeds.tolist(), loop.spins)
        felt = np.concatenate([seen.contact_force, seen.contact_force, seen.swing, np.zeros(6)])
        act = [*speeds, *self._states, *felt]
        vectors = list(map(float, qpos)), list(map(float, qvel)), act
        ctrl = loop.controls(seen.time, *vectors, self._parameters, knots)
        rates = ctrl[len(ctrl) - len(self._states) :]
        self._states = [
            state + self._period * rate for state, rate in zip(self._states, rates, strict=True)
        ]
        return _command(self._assembly, loop, ctrl)


def _command(assembly: Assembly, loop: ClosedLoop, ctrl: Values) -> Command:
    """The command by a controller's controls; the quadrotor's laws command thrusts."""
    layout = layout_of(loop)
    if loop.model == "quadrotor":
        coefficients = np.array(assembly.scenario.any_rotorcraft.thrust_coefficients)
        return Command(thrusts=coefficients * np.array(ctrl[: layout.rotors]))
    rates = ctrl[layout.acceleration_1 : layout.further_rates]
    return Command(
        rotor_accelerations=np.array(flip_by_spin(rates, loop.spins)),
        tilt_angles=np.array(ctrl[: layout.tilts]) if layout.tilts else None,
    )
