"""The law ``steady`` of tiltsim: computed torque, and an integral that removes steady errors."""

from functools import cache
from typing import Literal, NamedTuple

from pydantic import Field

import tiltsim
from tiltsim_controllers.analysis.stability import linear_loop
from tiltsim_controllers.laws.full_pose import attitude_error
from tiltsim_controllers.laws.outer_loop import (
    pointing_attitude,
    push_along,
    torque_for,
    tracking_errors,
)
from tiltsim_controllers.laws.rotor_allocation import planned_allocation_of


class Gains(NamedTuple):
    """The numbers of one flight. They are data: other gains need no other compiled code."""

    position: float  # 1/s^2
    velocity: float  # 1/s
    integral: float  # 1/s^3
    attitude: float  # 1/s^2
    rates: float  # 1/s
    gyroscopic: float  # 1 where the plant has gyroscopic torque


@cache
def law_of(rotors):
    """The law of vehicles with this many rotors: native code wants to know how many there are."""
    lift_of, axis_of, thrusts_of = planned_allocation_of(rotors)

    @tiltsim.scalar
    def steady(observed, gains):
        sums, omega = observed.states, observed.body_rates
        error, speed = tracking_errors(observed)
        ax, ay, az = observed.reference.acceleration
        k, d, i = gains.position, gains.velocity, gains.integral
        acceleration = (
            ax + k * error[0] + d * speed[0] + i * sums[0],
            ay + k * error[1] + d * speed[1] + i * sums[1],
            az + k * error[2] + d * speed[2] + i * sums[2],
        )
        # The attitude that points the rotors' force there, and the torque that turns to it.
        lift = lift_of(observed)
        axis = axis_of(observed, lift)
        desired = pointing_attitude(observed, acceleration, axis)
        ex, ey, ez = attitude_error(observed.rotation, desired)
        turning = (
            gains.attitude * ex - gains.rates * omega[0],
            gains.attitude * ey - gains.rates * omega[1],
            gains.attitude * ez - gains.rates * omega[2],
        )
        torque = torque_for(observed.vehicle, omega, turning, gains.gyroscopic)
        push = push_along(observed, acceleration, axis)
        return thrusts_of(observed, lift, axis, push, torque), (), error

    return steady


class SteadyController(tiltsim.ScalarController):
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

    def scalar_law(self, airframe):
        return law_of(airframe.rotors)

    def law_parameters(self, airframe):
        w, a = self.position_bandwidth, self.attitude_bandwidth
        return Gains(3.0 * w * w, 3.0 * w, w * w * w, a * a, 2.0 * a, airframe.gyroscopic)

    def state_units(self, airframe):
        return {f"state_integral_{axis}": "m s" for axis in "xyz"}

    def error_loops(self, vehicle):
        w, a = self.position_bandwidth, self.attitude_bandwidth
        return [
            linear_loop("position", [3.0 * w, 3.0 * w * w, w * w * w]),
            linear_loop("attitude", [2.0 * a, a * a]),
        ]
