"""The cascade that a practitioner would try first, as in PX4 and ArduPilot.

Position (P) demands a velocity, velocity (PI) an acceleration, whose force demands an attitude,
attitude (P) demands rates, and rates (PID) an angular acceleration. The integrator of velocity
stops while its demand is limited.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

from tiltsim_controllers.laws.full_pose import attitude_error
from tiltsim_controllers.laws.geometric import Commands
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.laws.outer_loop import (
    pointing_attitude,
    push_along,
    shortened,
    tracking_errors,
)
from tiltsim_controllers.laws.rotor_allocation import planned_allocation_of
from tiltsim_controllers.mathematics.scalar import scalar
from tiltsim_controllers.vehicle.multirotor import inertia_times

STATES: Final = {
    **{f"state_velocity_integral_{axis}": "m" for axis in "xyz"},
    **{f"state_rate_integral_{axis}": "rad" for axis in "xyz"},
    **{f"state_filtered_rate_{axis}": "rad/s" for axis in "xyz"},
}


class Parameters(NamedTuple):
    """Gains and limits."""

    position: float  # 1/s
    max_speed: float  # m/s
    velocity: float  # 1/s
    velocity_integral: float  # 1/s^2
    max_acceleration: float  # m/s^2
    attitude: float  # 1/s
    rates: float  # 1/s
    rates_integral: float  # 1/s^2
    rates_derivative: float  # 1
    derivative_filter: float  # 1/s


@cache
def pid_law_of(rotors: int) -> Callable[..., Commands]:
    """The law of vehicles with this many rotors, whose tilts follow a gait."""
    lift_of, axis_of, thrusts_of = planned_allocation_of(rotors)

    @scalar
    def pid(observed: Observed, parameters: Parameters) -> Commands:
        c, reference = parameters, observed.reference
        sx, sy, sz, sp, sq, sr, fp, fq, fr = observed.states
        (ex, ey, ez), _ = tracking_errors(observed)
        ux, uy, uz = shortened((c.position * ex, c.position * ey, c.position * ez), c.max_speed)
        vx, vy, vz = observed.velocity
        ux, uy, uz = (
            reference.velocity[0] + ux - vx,
            reference.velocity[1] + uy - vy,
            reference.velocity[2] + uz - vz,
        )
        demand = (
            c.velocity * ux + c.velocity_integral * sx,
            c.velocity * uy + c.velocity_integral * sy,
            c.velocity * uz + c.velocity_integral * sz,
        )
        ax, ay, az = shortened(demand, c.max_acceleration)
        goes_on = 1.0 if (ax, ay, az) == demand else 0.0
        wx, wy, wz = reference.acceleration
        acceleration = (ax + wx, ay + wy, az + wz)
        lift = lift_of(observed)
        axis = axis_of(observed, lift)
        desired = pointing_attitude(observed, acceleration, axis)
        rx, ry, rz = attitude_error(observed.rotation, desired)
        p, q, r = observed.body_rates
        ep, eq, er = c.attitude * rx - p, c.attitude * ry - q, c.attitude * rz - r
        dp, dq, dr = (
            c.derivative_filter * (p - fp),
            c.derivative_filter * (q - fq),
            c.derivative_filter * (r - fr),
        )
        turning = (
            c.rates * ep + c.rates_integral * sp - c.rates_derivative * dp,
            c.rates * eq + c.rates_integral * sq - c.rates_derivative * dq,
            c.rates * er + c.rates_integral * sr - c.rates_derivative * dr,
        )
        torque = inertia_times(observed.vehicle, turning)
        push = push_along(observed, acceleration, axis)
        return (
            thrusts_of(observed, lift, axis, push, torque),
            (),
            (goes_on * ux, goes_on * uy, goes_on * uz, ep, eq, er, dp, dq, dr),
        )

    return pid
