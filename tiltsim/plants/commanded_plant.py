"""The MuJoCo plant under commands: from a user's own controller, or step by step from outside.

The commands and what is seen go through the same layers as those of the shipped laws. Only their
latency is another: a rotor may be told a speed, to be taken at once, and no line of activations
(`tiltsim.laws.layers.actuation`) can hand on a jump. So commands under way are a state of this
plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, sqrt
from typing import NamedTuple

import mujoco
import numpy as np

from tiltsim.engines.callback import control_callback
from tiltsim.laws.commanded import COMMANDED_LOOPS, HeldCommand, commanded_parameters, with_command
from tiltsim.laws.layers.actuation import measured_qpos, measured_qvel, sensor_parameters
from tiltsim.laws.tiltrotor import gait_servo_commands
from tiltsim.plants.command import (
    CheckedCommand,
    ControllerError,
    Observation,
    Reference,
    observation,
)
from tiltsim.plants.mujoco_plant import MujocoPlant, quiet_warnings
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.mathematics.records import flatten, slotted
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Quad, clipped
from tiltsim_controllers.references.trajectories import reference_derivatives
from tiltsim_controllers.vehicle.parameters import SPIN


class _Sent(NamedTuple):
    """A command as it travels: numbers alone."""

    speeds: float  # whether the rotors are told speeds, not accelerations
    rotors: Quad  # rad/s or rad/s^2, with their signs
    tilts: Quad  # rad


class CommandedPlant(MujocoPlant):
    """A vehicle that does what it was told, a latency ago.

    MuJoCo steps by itself as long as no layer has a say and the rotors keep their speeds; else the
    control callback holds the commands.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        vehicle = scenario.rotorcraft
        self.tilting = vehicle.model == "tiltrotor"
        self._slowest, self._fastest = vehicle.speeds_along_spin
        self._commanded = commanded_parameters(self._setup.parameters)
        self._sensors = sensor_parameters(scenario)
        self._slotted = slotted(self._setup.parameters)
        self._layered = self._loop is not COMMANDED_LOOPS[vehicle.model]
        first = 8 if self.tilting else 4  # after servos and thrusts
        self._rates = slice(first, first + 4)
        # The activations that a commanded speed is written to: where rotors lag behind it, the one
        # that the layer keeps after the four rotor speeds.
        first = 0 if vehicle.rotor_time_constant is None else 4
        self._speeds = slice(first, first + 4)
        # Before the first command arrives the servos hold the pods where they are.
        waiting = _Sent(0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
        if self.tilting:
            waiting = waiting._replace(tilts=initial_tilts(scenario)[0])
        self._under_way = [waiting] * scenario.simulation.latency_steps  # the oldest first
        self._write_controls(self._commanded.told)

    @property
    def state(self) -> Floats:
        """See `Plant.state`: MuJoCo's, and the commands under way."""
        return np.array([*super().state, *flatten(tuple(self._under_way))])

    @state.setter
    def state(self, value: Floats) -> None:
        length = len(value) - 9 * len(self._under_way)
        MujocoPlant.state.fset(self, value[:length])  # type: ignore[attr-defined]
        self._under_way = [
            _Sent(speeds, (r1, r2, r3, r4), (a1, a2, a3, a4))
            for speeds, r1, r2, r3, r4, a1, a2, a3, a4 in value[length:].reshape(-1, 9).tolist()
        ]

    def apply(self, orders: CheckedCommand) -> None:
        """Send a command, once a control sample, and obey the one that arrives until the next.

        Rotors take a commanded speed at once, unless they lag: the plant's observed state has it.
        """
        self._under_way.append(self._sent(orders))
        arrived = self._under_way.pop(0)
        rates = arrived.rotors
        if arrived.speeds:
            self.data.act[self._speeds] = arrived.rotors
            rates = (0.0, 0.0, 0.0, 0.0)
        self._write_controls(HeldCommand(*arrived.tilts, *rates))

    def _sent(self, orders: CheckedCommand) -> _Sent:
        tilts = orders.tilt_angles
        if tilts is None:
            tilts = self._planned_servo_commands() if self.tilting else (0.0, 0.0, 0.0, 0.0)
        if orders.kind == "rotor_accelerations":
            return _Sent(0.0, _signed(orders.rotors), tilts)
        return _Sent(1.0, _signed(self._along_spin(orders)), tilts)

    def _write_controls(self, told: HeldCommand) -> None:
        data, knots = self.data, self._setup.knots
        state = data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        parameters = with_command(self._setup.parameters, told)
        try:
            data.ctrl[:] = self._loop.controls(float(data.time), *state, parameters, knots)
        except (ArithmeticError, ValueError):
            data.ctrl[:] = nan  # as the engines do; MuJoCo reports it

    def thrusts_and_tilts(self, orders: CheckedCommand) -> Floats:
        """What orders come to as thrusts (N) and tilt angles (rad), shape (8,) or (4,).

        Raises `ControllerError` for accelerations, which are no thrust yet.
        """
        if orders.kind == "rotor_accelerations":
            raise ControllerError(
                "commanded rotor_accelerations; thrusts or rotor_speeds are wanted"
            )
        coefficient = self._commanded.vehicle.thrust_coefficient
        thrusts = [coefficient * speed * abs(speed) for speed in self._along_spin(orders)]
        if not self.tilting:
            return np.array(thrusts)
        return np.array([*thrusts, *(orders.tilt_angles or self._planned_servo_commands())])

    def _planned_servo_commands(self) -> Quad:
        lead, gait = self._commanded.servo_lead, self._commanded.gait
        return gait_servo_commands(float(self.data.time), lead, gait, self._setup.knots)

    def _along_spin(self, orders: CheckedCommand) -> Quad:
        """Commanded speeds, within the rotors' limits."""
        first, second, third, fourth = orders.rotors
        if orders.kind == "thrusts":
            coefficient = self._commanded.vehicle.thrust_coefficient
            first, second, third, fourth = (
                sqrt(abs(thrust) / coefficient) * (1.0 if thrust >= 0.0 else -1.0)
                for thrust in orders.rotors
            )
        return (
            self._limited(first),
            self._limited(second),
            self._limited(third),
            self._limited(fourth),
        )

    def _limited(self, speed: float) -> float:
        return clipped(speed, self._slowest, self._fastest)

    def advance(self, steps: int) -> None:
        """See `Plant.advance`."""
        moving = self._layered or self.data.ctrl[self._rates].any()
        with control_callback(self._hold if moving else None), quiet_warnings():
            mujoco.mj_step(self.model, self.data, nstep=steps)

    def _hold(self, _model: mujoco.MjModel, called: mujoco.MjData) -> None:
        """Let the thrusts follow the rotor speeds, and layers do what they do, between commands."""
        data = self.data
        if called is not data:
            return
        state = float(data.time), data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        try:
            data.ctrl[:] = self._loop.held(*state, data.ctrl.tolist(), self._slotted)
        except (ArithmeticError, ValueError):
            data.ctrl[:] = nan

    @property
    def steps_taken(self) -> int:
        """Physics steps since time zero."""
        return round(float(self.data.time) / float(self.model.opt.timestep))

    def seen(self) -> Observation:
        """The present state as a controller sees it, through the scenario's sensors."""
        data, parameters = self.data, self._commanded
        time, qpos, qvel = float(data.time), data.qpos, data.qvel
        if self._sensors.active:
            qpos = np.array(measured_qpos(time, qpos.tolist(), self._sensors))
            qvel = np.array(measured_qvel(time, qvel.tolist(), self._sensors))
        motion = np.array(reference_derivatives(time, parameters.reference, self._setup.knots)[:9])
        wanted = parameters.reference
        planned = np.zeros(8)
        if self.tilting:
            planned[:] = tilt_reference(time, parameters.gait, self._setup.knots)
        reference = Reference(
            position=motion[:3],
            velocity=motion[3:6],
            acceleration=motion[6:],
            attitude=np.array((wanted.roll, wanted.pitch, wanted.yaw)),
            tilt_angles=planned[:4],
            tilt_rates=planned[4:],
        )
        attitude = euler_from_quaternion(*qpos[3:7].tolist())
        speeds = _signed(data.act[:4].tolist())
        return observation(time, qpos, qvel, speeds, attitude, reference, parameters.vehicle)

    def _controls_in_force(self, *_state: Sequence[float]) -> Sequence[float]:
        return list(self.data.ctrl.tolist())


def _signed(values: Sequence[float]) -> Quad:
    """Speeds along the spin from signed ones, and back."""
    first, second, third, fourth = values
    return SPIN[0] * first, SPIN[1] * second, SPIN[2] * third, SPIN[3] * fourth
