"""The law ``steady`` of tiltsim: computed torque, and an integral that removes steady errors."""

from typing import ClassVar, Literal

from pydantic import Field

import tiltsim
from tiltsim_controllers.analysis.stability import linear_loop
from tiltsim_controllers.laws.outer_loop import (
    allocated_thrusts,
    lift_without_torque,
    pointing_attitude,
    push_along,
    torque_for,
    tracking_errors,
)
from tiltsim_controllers.mathematics.attitude import attitude_error


class SteadyController(tiltsim.LawController):
    """The table ``[controller]`` with ``law = "steady"``."""

    law: Literal["steady"] = Field(
        description="computed torque, and an integral that removes steady errors of position"
    )
    position_bandwidth: float = Field(
        1.5, gt=0.0, description="triple pole of the position loop, negated [rad/s]"
    )
    attitude_bandwidth: float = Field(
        12.0, gt=0.0, description="double pole of the attitude loop, negated [rad/s]"
    )

    states: ClassVar = {f"state_integral_{axis}": "m s" for axis in "xyz"}

    @staticmethod
    def control(observed, p):
        """The law; `p` are the keys above: other gains need no other compiled code."""
        w, a = p.position_bandwidth, p.attitude_bandwidth
        error, speed = tracking_errors(observed)
        feedback = 3.0 * w**2 * error + 3.0 * w * speed + w**3 * observed.states
        acceleration = observed.reference.acceleration + feedback
        # The attitude that points the rotors' force there, and the torque that turns to it.
        lift = lift_without_torque(observed)
        axis = observed.force @ lift
        desired = pointing_attitude(observed, acceleration, axis)
        turning = a**2 * attitude_error(observed.rotation, desired) - 2.0 * a * observed.body_rates
        torque = torque_for(observed, turning)
        push = push_along(observed, acceleration, axis)
        return tiltsim.Command(thrusts=allocated_thrusts(observed, lift, push, torque), rates=error)

    def error_loops(self, vehicle):
        w, a = self.position_bandwidth, self.attitude_bandwidth
        return [
            linear_loop("position", [3.0 * w, 3.0 * w * w, w * w * w]),
            linear_loop("attitude", [2.0 * a, a * a]),
        ]
