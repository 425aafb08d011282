"""The MuJoCo plant under commands: from a user's own controller, or step by step from outside.

Commands and observations pass the same layers as those of the shipped controllers. Only the delay
line of `tiltsim.laws.layers.delay_line` is moved by this plant, as rotors may be commanded speeds
that they take at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, sqrt
from typing import Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import EVALUATIONS
from tiltsim.engines.callback import control_callback
from tiltsim.laws.commanded import COMMANDED_LOOPS, HeldCommand, commanded_parameters, with_command
from tiltsim.laws.layers.delay_line import EXTERNAL_COMMANDS
from tiltsim.laws.tiltrotor import gait_servo_commands
from tiltsim.plants.command import CheckedCommand, ControllerError, Observation
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.observing import Observer, flip_by_spin
from tiltsim.vehicles.rotorcraft.layout import ROTOR_STATES, TILT_1
from tiltsim_controllers.mathematics.records import slotted
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Values, clipped
from tiltsim_controllers.vehicle.decoupling_matrix import sines_and_cosines
from tiltsim_controllers.vehicle.rotor_inertia import sum_along_thrust_axes

_NONE: Final = (0.0, 0.0, 0.0, 0.0)


class CommandedPlant(MujocoPlant):
    """A vehicle that follows commands, each after the scenario's latency.

    MuJoCo steps without a callback as long as there is no layer and the rotors keep their speeds;
    else the control callback holds the commands.
    """

    def __init__(self, assembly: Assembly, model: mujoco.MjModel | None = None) -> None:
        super().__init__(assembly, model, engine="python")
        vehicle = assembly.scenario.rotorcraft
        self.tilting = vehicle.has_tilting_rotors
        self._min_speed, self._max_speed = vehicle.speeds_along_spin
        self._commanded = commanded_parameters(self._setup.parameters)
        self._observer = Observer(assembly)
        self._slotted = slotted(self._setup.parameters)
        self._layered = self._loop is not COMMANDED_LOOPS[vehicle.model]
        first = 8 if self.tilting else 4  # after servos and thrusts
        self._rates = slice(first, first + 4)
        # The activations that a commanded speed is written to: where rotors lag behind it, the one
        # that the layer keeps after the four rotor speeds.
        self._lagging = vehicle.rotor_time_constant is not None
        self._rotor_inertia = vehicle.rotor_inertia
        first = 4 if self._lagging else 0
        self._speeds = slice(first, first + 4)
        # The delay line in ``act``, the newest command first; without latency it is empty.
        steps, first = assembly.scenario.simulation.latency_steps, 2 * ROTOR_STATES
        line = self.data.act[first : first + EXTERNAL_COMMANDS * steps]
        self._line = line.reshape(steps, EXTERNAL_COMMANDS)
        self._hold_command(self._commanded.command)

    def _prepare_engine(self) -> None:
        """Build none: `advance` holds the commands by a callback of its own."""

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
            self._set_speeds(np.array(arrived[4:]))
            arrived[4:] = _NONE
        self._hold_command(HeldCommand(*arrived))

    def _set_speeds(self, speeds: Floats) -> None:
        """Command signed rotor speeds (rad/s). A jump of the rotors' momentum turns the body."""
        model, data = self.model, self.data
        if self._rotor_inertia > 0.0 and not self._lagging:
            tilts = data.qpos[TILT_1 : TILT_1 + 4].tolist() if self.tilting else _NONE
            trig, jump = sines_and_cosines(*tilts), (speeds - data.act[:4]).tolist()
            impulse, turned = np.zeros((1, model.nv)), np.empty((1, model.nv))
            impulse[0, 3:6] = sum_along_thrust_axes(trig, jump)
            mujoco.mj_fwdPosition(model, data)  # the mass matrix of the present tilts
            mujoco.mj_solveM(model, data, turned, impulse)
            data.qvel[:] -= self._rotor_inertia * turned[0]
        data.act[self._speeds] = speeds

    def _external_command(self, command: CheckedCommand) -> Values:
        """The `EXTERNAL_COMMANDS` that a command amounts to."""
        tilts = command.tilt_angles
        if tilts is None:
            tilts = self._gait_servo_commands() if self.tilting else _NONE
        are_speeds = command.kind != "rotor_accelerations"
        rotors = self._limited_speeds(command) if are_speeds else command.rotors
        return (*tilts, *flip_by_spin(rotors), float(are_speeds))

    def _hold_command(self, command: HeldCommand) -> None:
        data, knots = self.data, self._setup.knots
        state = data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        parameters = with_command(self._setup.parameters, command)
        try:
            data.ctrl[:] = self._loop.sampling.controls(
                self.evaluation_time, *state, parameters, knots
            )
        except (ArithmeticError, ValueError):
            data.ctrl[:] = nan  # as the engines do; MuJoCo reports it

    def thrusts_and_tilts(self, command: CheckedCommand) -> Floats:
        """A command as thrusts (N) and tilt angles (rad), shape (8,) or (4,).

        Raises:
            ControllerError: If it commands accelerations, which have no thrust yet.
        """
        if command.kind == "rotor_accelerations":
            raise ControllerError("commanded rotor_accelerations; expected thrusts or rotor_speeds")
        coefficient = self._commanded.vehicle.thrust_coefficient
        thrusts = [coefficient * speed * abs(speed) for speed in self._limited_speeds(command)]
        if not self.tilting:
            return np.array(thrusts)
        return np.array([*thrusts, *(command.tilt_angles or self._gait_servo_commands())])

    def _gait_servo_commands(self) -> Quad:
        lead, gait = self._commanded.servo_lead, self._commanded.gait
        return gait_servo_commands(self.evaluation_time, lead, gait, self._setup.knots)

    def _limited_speeds(self, command: CheckedCommand) -> Quad:
        """Commanded speeds along the spin (rad/s), within the rotors' limits."""
        speeds: Sequence[float] = command.rotors
        if command.kind == "thrusts":
            coefficient = self._commanded.vehicle.thrust_coefficient
            speeds = [
                sqrt(abs(thrust) / coefficient) * (1.0 if thrust >= 0.0 else -1.0)
                for thrust in command.rotors
            ]
        first, second, third, fourth = (
            clipped(speed, self._min_speed, self._max_speed) for speed in speeds
        )
        return first, second, third, fourth

    def advance(self, steps: int) -> None:
        moving = self._layered or self.data.ctrl[self._rates].any()
        end = (self.steps_taken + steps) * self._evaluations_per_step
        with control_callback(self._hold if moving else None):
            mujoco.mj_step(self.model, self.data, nstep=steps)
        self.data.userdata[EVALUATIONS] = end

    def _hold(self, _model: mujoco.MjModel, called: mujoco.MjData) -> None:
        """Between commands, let the thrusts follow the rotor speeds and the layers act."""
        data = self.data
        if called is not data:
            return
        time = self.evaluation_time
        data.userdata[EVALUATIONS] += 1.0
        state = time, data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        try:
            data.ctrl[:] = self._loop.sampling.hold(*state, data.ctrl.tolist(), self._slotted)
        except (ArithmeticError, ValueError):
            data.ctrl[:] = nan

    def observation(self) -> Observation:
        """The present state as a controller sees it, through the scenario's sensors."""
        return self._observer.observe(self, self.data.act[:4].tolist())
