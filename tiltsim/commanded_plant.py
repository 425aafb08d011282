"""The MuJoCo plant under commands: from a user's own controller, or step by step from outside."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import mujoco
import numpy as np

from controllers.gaits import tilt_reference
from controllers.references import reference_derivatives
from controllers.rotation import euler_from_quaternion
from controllers.scalar import Quad
from controllers.vehicle import SPIN
from tiltsim.controller import (
    ControllerError,
    Observation,
    Orders,
    Reference,
    observation,
    own_controller,
)
from tiltsim.engine import control_callback
from tiltsim.loop import Floats
from tiltsim.loops.commanded import ControlParameters, planned_servo_commands
from tiltsim.loops.tiltrotor import rotor_thrust_controls
from tiltsim.plants import MujocoPlant, quiet_warnings
from tiltsim.scenario import Scenario


class CommandedPlant(MujocoPlant):
    """A vehicle that does what it was last told.

    MuJoCo steps by itself as long as the rotors keep their speeds; the control callback is there
    for commanded accelerations alone.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.tilting = scenario.vehicle.model == "tiltrotor"
        self._first_thrust = 4 if self.tilting else 0
        self._first_rate = self._first_thrust + 4
        vehicle = scenario.rotorcraft
        self._slowest = vehicle.min_rotor_speed
        self._fastest = vehicle.max_rotor_speed
        data, setup = self.data, self._setup
        state = data.qpos.tolist(), data.qvel.tolist(), data.act.tolist()
        data.ctrl[:] = self._loop.controls(0.0, *state, setup.parameters, setup.table)

    def apply(self, orders: Orders) -> None:
        """Obey until told otherwise; the plant's observed state has the new speeds at once."""
        ctrl, act = self.data.ctrl, self.data.act
        if self.tilting:
            ctrl[:4] = orders.tilt_angles or self._planned_servo_commands()
        rates = (0.0, 0.0, 0.0, 0.0)
        if orders.kind == "rotor_accelerations":
            rates = _signed(orders.rotors)
        else:
            act[:] = _signed(self._along_spin(orders))
            ctrl[self._first_thrust : self._first_rate] = rotor_thrust_controls(act.tolist())
        ctrl[self._first_rate : self._first_rate + 4] = rates

    def thrusts_and_tilts(self, orders: Orders) -> Floats:
        """What orders come to as thrusts (N) and tilt angles (rad), shape (8,) or (4,).

        Raises `ControllerError` for accelerations, which are no thrust yet.
        """
        if orders.kind == "rotor_accelerations":
            raise ControllerError(
                "commanded rotor_accelerations; thrusts or rotor_speeds are wanted"
            )
        coefficient = self._setup.parameters.vehicle.thrust_coefficient
        thrusts = [coefficient * speed * abs(speed) for speed in self._along_spin(orders)]
        if not self.tilting:
            return np.array(thrusts)
        return np.array([*thrusts, *(orders.tilt_angles or self._planned_servo_commands())])

    def _planned_servo_commands(self) -> tuple[float, ...]:
        parameters: ControlParameters = self._setup.parameters
        lead, gait = parameters.servo_lead, parameters.gait
        return planned_servo_commands(float(self.data.time), lead, gait, self._setup.table)

    def _along_spin(self, orders: Orders) -> Quad:
        """Commanded speeds, within the rotors' limits."""
        first, second, third, fourth = orders.rotors
        if orders.kind == "thrusts":
            coefficient = self._setup.parameters.vehicle.thrust_coefficient
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
        low, high = self._slowest, self._fastest
        if high is not None:
            speed = min(high, max(-high, speed))
        return speed if low is None else max(low, speed)

    def advance(self, steps: int) -> None:
        """See `Plant.advance`."""
        accelerating = self.data.ctrl[self._first_rate : self._first_rate + 4].any()
        with control_callback(self._hold if accelerating else None), quiet_warnings():
            mujoco.mj_step(self.model, self.data, nstep=steps)

    def _hold(self, _model: mujoco.MjModel, called: mujoco.MjData) -> None:
        """Let the thrusts follow the rotor speeds, all other controls held."""
        data = self.data
        if called is data:
            data.ctrl[:] = self._loop.refresh(data.ctrl.tolist(), data.act.tolist())

    @property
    def steps_taken(self) -> int:
        """Physics steps since time zero."""
        return round(float(self.data.time) / float(self.model.opt.timestep))

    def seen(self) -> Observation:
        """The present state as a controller sees it."""
        data, parameters = self.data, self._setup.parameters
        time = float(data.time)
        motion = np.array(reference_derivatives(time, parameters.reference, self._setup.table)[:9])
        wanted = parameters.reference
        planned = np.zeros(8)
        if self.tilting:
            planned[:] = tilt_reference(time, parameters.gait, self._setup.table)
        reference = Reference(
            position=motion[:3],
            velocity=motion[3:6],
            acceleration=motion[6:],
            attitude=np.array((wanted.roll, wanted.pitch, wanted.yaw)),
            tilt_angles=planned[:4],
            tilt_rates=planned[4:],
        )
        qpos = data.qpos
        attitude = euler_from_quaternion(*qpos[3:7].tolist())
        speeds = _signed(data.act.tolist())
        return observation(time, qpos, data.qvel, speeds, attitude, reference, parameters.vehicle)

    def _controls_in_force(self, *_state: Sequence[float]) -> Sequence[float]:
        return list(self.data.ctrl.tolist())


def _signed(values: Sequence[float]) -> Quad:
    """Speeds along the spin from signed ones, and back."""
    first, second, third, fourth = values
    return SPIN[0] * first, SPIN[1] * second, SPIN[2] * third, SPIN[3] * fourth


class ControlledPlant(CommandedPlant):
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
        self._answers: dict[int, Orders] = {}

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

    def _answer(self, step: int) -> Orders:
        if not self._asked:
            self._asked = True
            self._controller.reset(self._scenario)
        if step not in self._answers:
            orders = self._controller.orders(self.seen(), tilting=self.tilting)
            self._answers[step] = orders
        return self._answers[step]
