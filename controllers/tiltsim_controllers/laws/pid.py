"""The cascade that a practitioner would try first, as in PX4 and ArduPilot.

Position (P) demands a velocity, velocity (PI) an acceleration, whose force demands an attitude,
attitude (P) demands rates, and rates (PID) an angular acceleration. The integrator of velocity
stops while its demand is limited.
"""

from typing import Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.keys import Gains2, Keys, Positive, Vector3, default, required
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.laws.outer_loop import (
    allocated_thrusts,
    lift_without_torque,
    pointing_attitude,
    push_along,
    shortened,
    tracking_errors,
)
from tiltsim_controllers.mathematics.attitude import attitude_error

STATES: Final = {
    **{f"state_velocity_integral_{axis}": "m" for axis in "xyz"},
    **{f"state_rate_integral_{axis}": "rad" for axis in "xyz"},
    **{f"state_filtered_rate_{axis}": "rad/s" for axis in "xyz"},
}


class Pid(Keys):
    """Keys of `pid`."""

    law: Literal["pid"] = required(
        "cascade: position (P), velocity (PI), attitude (P) and rates (PID)"
    )
    position_gain: Positive = default(1.0, "velocity demanded per error of position [1/s]")
    max_speed: Positive = default(3.0, "largest velocity that the error of position demands [m/s]")
    velocity_gains: Gains2 = default(
        (3.0, 0.9), "acceleration demanded per error of velocity and per its integral [1/s, 1/s^2]"
    )
    max_acceleration: Positive = default(
        5.0, "largest acceleration that the feedback demands [m/s^2]"
    )
    attitude_gain: Positive = default(9.0, "rates demanded per error of attitude [1/s]")
    rate_gains: Vector3 = default(
        (27.0, 72.9, 0.1),
        "angular acceleration demanded per error of the rates, per its integral, and per minus "
        "the derivative of the rates [1/s, 1/s^2, 1]",
    )
    derivative_filter: Positive = default(
        100.0, "of the rates whose derivative is taken, a lag of first order [1/s]"
    )


def pid(observed: Observed, p: Pid) -> Command:
    """The law, with the states `STATES`."""
    velocity_integral, rate_integral, slow_rates = observed.states.reshape(3, 3)
    reference, omega = observed.reference, observed.body_rates
    position_error, _ = tracking_errors(observed)
    approach = shortened(p.position_gain * position_error, p.max_speed)
    velocity_error = reference.velocity + approach - observed.velocity
    demand = p.velocity_gains[0] * velocity_error + p.velocity_gains[1] * velocity_integral
    is_limited = demand @ demand > p.max_acceleration**2
    acceleration = shortened(demand, p.max_acceleration) + reference.acceleration

    lift = lift_without_torque(observed)
    axis = observed.force @ lift
    desired = pointing_attitude(observed, acceleration, axis)
    rate_error = p.attitude_gain * attitude_error(observed.rotation, desired) - omega
    omega_rate = p.derivative_filter * (omega - slow_rates)
    k_p, k_i, k_d = p.rate_gains
    turning = k_p * rate_error + k_i * rate_integral - k_d * omega_rate
    push = push_along(observed, acceleration, axis)
    return Command(
        thrusts=allocated_thrusts(observed, lift, push, observed.inertia @ turning),
        rates=xp.hstack([xp.where(is_limited, 0.0, velocity_error), rate_error, omega_rate]),
    )
