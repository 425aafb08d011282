"""The MuJoCo plant under commands: from a user's own controller, or step by step from outside.

Commands and observations pass the layers of the shipped controllers. Only the delay line of
`tiltsim.laws.layers.actuation` is moved by this plant, as rotors may be commanded speeds that they
take at once. A controller is anything that takes an `Observation` and returns a `Command`: a
function, or an object with ``__call__`` for one with a memory; its command is held until the next.
"""

from collections.abc import Callable, Sequence
from math import inf, nan, sqrt
from typing import Any

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly, program_key
from tiltsim.closed_loop.userdata import EVALUATIONS, HEADER_SIZE
from tiltsim.engines.base import vectors_of
from tiltsim.engines.control import control_callback, control_step
from tiltsim.engines.programs import control_program
from tiltsim.errors import InputError
from tiltsim.laws.assembling import commanded_parameters, planned_servo_commands, with_command
from tiltsim.laws.law import servo_lead
from tiltsim.plants.autopilot import FirmwareController
from tiltsim.plants.command import (
    CheckedCommand,
    Controller,
    ControllerError,
    Observation,
    Observer,
    check_command,
    flip_by_spin,
)
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.law_controller import is_law
from tiltsim.scenario.own_parts import describe, load_function
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft import TILT_1, Layout, layout_of, true_rotors
from tiltsim_controllers.code.arrays import as_arrays
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.records import flatten
from tiltsim_controllers.mathematics.scalar import Floats, Values, clipped
from tiltsim_controllers.vehicle.craft import craft_of, hinge_torques, thrust_axes


class CommandedPlant(MujocoPlant):
    """A vehicle that follows commands, each after the scenario's latency.

    MuJoCo steps without a callback as long as there is no layer and the rotors keep their speeds;
    else the control callback holds the commands.
    """

    def __init__(self, assembly: Assembly, model: mujoco.MjModel | None = None) -> None:
        super().__init__(assembly, model, engine="python")
        vehicle, simulation = assembly.scenario.any_rotorcraft, assembly.scenario.simulation
        self.layout = layout = layout_of(self._loop)
        rotors = layout.rotors
        self._spins, self._coefficients = vehicle.spins, vehicle.thrust_coefficients
        # Along the spin, from the model: limits of the scenario or of a user's file.
        self._limits = [self._limits_along_spin(i, spin) for i, spin in enumerate(vehicle.spins, 1)]
        self._commanded = commanded_parameters(self._setup.parameters)
        self._lead = servo_lead(vehicle.tilt_servo)
        self._observer = Observer(assembly)
        program = control_program(program_key(assembly), "controls")
        self._controls = python_function(program, "controls")
        self._held = control_step(assembly, self.data.userdata[HEADER_SIZE:].tolist(), "hold")
        self._layered = self._loop.within is not None
        self._rates = slice(layout.acceleration_1, layout.further_rates)
        # The activations that a commanded speed is written to: where rotors lag behind it, the ones
        # that the layer keeps after the rotor speeds.
        self._lagging = vehicle.rotor_time_constant is not None
        self._rotor_inertia = vehicle.rotor_inertia
        own = as_arrays(true_rotors(assembly.scenario))
        self._craft = craft_of(own, self._loop.tilt_of_rotor)
        first = rotors if self._lagging else 0
        self._speeds = slice(first, first + rotors)
        # The delay line in ``act``, the newest command first; without latency it is empty. A
        # command is tilts, rotors and whether these are speeds.
        steps, first, size = simulation.latency_steps, 2 * rotors, layout.tilts + rotors + 1
        self._line = self.data.act[first : first + size * steps].reshape(steps, size)
        self._hold_command((*self._commanded.command.tilts, *(0.0,) * rotors))

    def _limits_along_spin(self, rotor: int, spin: float) -> tuple[float, float]:
        """Lowest and highest speed (rad/s) of a rotor along its spin."""
        actuator = self.model.actuator(f"rotor_speed_{rotor}")
        if not actuator.actlimited[0]:
            return -inf, inf
        low, high = sorted(spin * actuator.actrange)
        return float(low), float(high)

    def _prepare_engine(self) -> None:
        """Build none: `advance` holds the commands by its own callback."""

    def apply(self, command: CheckedCommand) -> None:
        """Send a command, once per control sample, and hold the one that arrives until the next.

        Rotors take a commanded speed at once, unless they lag: the observed state has it.
        """
        *arrived, are_speeds = newest = self._external_command(command)
        if len(self._line):
            *arrived, are_speeds = self._line[-1].tolist()
            self._line[1:] = self._line[:-1].copy()
            self._line[0] = newest
        if are_speeds:
            tilts = self.layout.tilts
            self._set_speeds(np.array(arrived[tilts:]))
            arrived[tilts:] = [0.0] * self.layout.rotors
        self._hold_command(tuple(arrived))

    def _set_speeds(self, speeds: Floats) -> None:
        """Command signed rotor speeds (rad/s). A jump of the rotors' momentum turns the body."""
        model, data = self.model, self.data
        if self._rotor_inertia > 0.0 and not self._lagging:
            tilts, jump = data.qpos[TILT_1:], speeds - data.act[: self.layout.rotors]
            impulse, turned = np.zeros((1, model.nv)), np.empty((1, model.nv))
            at_rest = np.zeros(len(jump)), jump, np.zeros(3)
            impulse[0, 3:6] = thrust_axes(self._craft, tilts) @ jump
            impulse[0, 6:] = -hinge_torques(self._craft, tilts, *at_rest)
            mujoco.mj_fwdPosition(model, data)  # the mass matrix of the present tilts
            mujoco.mj_solveM(model, data, turned, impulse)
            data.qvel[:] -= self._rotor_inertia * turned[0]
        data.act[self._speeds] = speeds

    def _external_command(self, command: CheckedCommand) -> Values:
        """Tilts, rotors with their signs, and whether these are speeds, of a command."""
        are_speeds = command.kind != "rotor_accelerations"
        rotors = self._limited_speeds(command) if are_speeds else command.rotors
        tilts = self._tilts_of(command)
        return (*tilts, *flip_by_spin(rotors, self._spins), float(are_speeds))

    def _tilts_of(self, command: CheckedCommand) -> Values:
        """The commanded tilt angles, rad; by default the planned gait."""
        if command.tilt_angles is not None:
            return command.tilt_angles
        time, gait, tilts = self.evaluation_time, self._commanded.gait, self.layout.tilts
        return planned_servo_commands(time, tilts, gait, self._setup.knots, self._lead)

    def _hold_command(self, command: Values) -> None:
        data, knots = self.data, self._setup.knots
        vectors = data.userdata[:HEADER_SIZE], *vectors_of(self._loop, data), data.ctrl
        user = [*flatten(with_command(self._setup.parameters, command)), *knots]
        try:
            data.ctrl[:] = self._controls(*(vector.tolist() for vector in vectors), user)
        except (ArithmeticError, ValueError):
            data.ctrl[:] = nan  # as the engines do; MuJoCo reports it

    def thrusts_and_tilts(self, command: CheckedCommand) -> Floats:
        """A command as thrusts (N), then tilt angles (rad) if the vehicle has any.

        Raises:
            ControllerError: If it commands accelerations, which have no thrust yet.
        """
        if command.kind == "rotor_accelerations":
            raise ControllerError("commanded rotor_accelerations; expected thrusts or rotor_speeds")
        speeds = zip(self._coefficients, self._limited_speeds(command), strict=True)
        thrusts = [coefficient * speed * abs(speed) for coefficient, speed in speeds]
        return np.array([*thrusts, *self._tilts_of(command)])

    def _limited_speeds(self, command: CheckedCommand) -> Values:
        """Commanded speeds along the spin (rad/s), within the rotors' limits."""
        speeds: Sequence[float] = command.rotors
        if command.kind == "thrusts":
            speeds = [
                sqrt(abs(thrust) / coefficient) * (1.0 if thrust >= 0.0 else -1.0)
                for coefficient, thrust in zip(self._coefficients, command.rotors, strict=True)
            ]
        return tuple(clipped(s, *limits) for s, limits in zip(speeds, self._limits, strict=True))

    def advance(self, steps: int) -> None:
        moving = self._layered or self.data.ctrl[self._rates].any()
        end = (self.steps_taken + steps) * self._evaluations_per_step
        with control_callback(self._hold if moving else None):
            self._step(steps)
        self.data.userdata[EVALUATIONS] = end

    def _hold(self, _model: mujoco.MjModel, called: mujoco.MjData) -> None:
        """Between commands, let the thrusts follow the rotor speeds and the layers act."""
        data = self.data
        if called is not data:
            return
        header = data.userdata[:HEADER_SIZE].tolist()
        data.userdata[EVALUATIONS] += 1.0
        state = vectors_of(self._loop, data).lists()
        try:
            data.ctrl[:] = self._held(header, *state, data.ctrl.tolist())
        except (ArithmeticError, ValueError):
            data.ctrl[:] = nan

    def observation(self) -> Observation:
        """The present state as a controller sees it, through the scenario's sensors."""
        return self._observer.observe(self, self.data.act[: self.layout.rotors].tolist())


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
