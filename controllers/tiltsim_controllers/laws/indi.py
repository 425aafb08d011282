"""Incremental nonlinear dynamic inversion of the attitude.

Smeur, Chu and de Croon (2016), "Adaptive incremental nonlinear dynamic inversion for attitude
control of micro air vehicles", Eqs. 10 to 21. The torque is an increment of the torque that makes
the present angular acceleration, so that no model of other torques is needed. The angular
acceleration comes from filtered rates, and the thrusts that go with it pass the same filter; then
it follows its demand as the rotors follow theirs.

Increments are of the torque, not of each thrust, which is equivalent for four thrusts; more would
keep forever the part of them that makes neither torque nor push, and with tilts a force to the
side.
"""

from typing import Any, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.keys import Keys, Positive, default, required
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.laws.outer_loop import (
    allocated_thrusts,
    demanded_acceleration,
    lift_without_torque,
    pointing_attitude,
    push_along,
)
from tiltsim_controllers.mathematics.attitude import attitude_error


class Indi(Keys):
    """Keys of `indi`."""

    law: Literal["indi"] = required(
        "incremental nonlinear dynamic inversion of the attitude (Smeur et al. 2016), with "
        "filtered rates and thrusts"
    )
    position_bandwidth: Positive = default(
        2.0, "natural frequency of the position's error, critically damped [rad/s]"
    )
    attitude_gain: Positive = default(9.0, "rates demanded per error of attitude [1/s]")
    rate_gain: Positive = default(
        27.0, "angular acceleration demanded per error of the rates [1/s]"
    )
    filter_frequency: Positive = default(
        50.0, "natural frequency of the filter of rates and thrusts [rad/s]"
    )
    filter_damping: Positive = default(0.55, "its damping ratio [-]")
    max_acceleration: Positive = default(
        5.0, "largest acceleration that the feedback of position demands [m/s^2]"
    )


def state_units(rotors: int) -> dict[str, str]:
    """The filters of rates and thrusts: values, then their derivatives."""
    axes, numbers = "xyz", range(1, rotors + 1)
    return {
        **{f"state_filtered_rate_{axis}": "rad/s" for axis in axes},
        **{f"state_angular_acceleration_{axis}": "rad/s^2" for axis in axes},
        **{f"state_filtered_thrust_{i}": "N" for i in numbers},
        **{f"state_thrust_rate_{i}": "N/s" for i in numbers},
    }


def indi(observed: Observed, p: Indi) -> Command:
    """The law, with the states `state_units`."""
    omega, thrusts, N = observed.body_rates, observed.thrusts, len(observed.thrusts)
    slow_omega, omega_rate = observed.states[:3], observed.states[3:6]
    slow_thrusts, thrust_rates = observed.states[6 : 6 + N], observed.states[6 + N :]

    w = p.position_bandwidth
    acceleration = demanded_acceleration(observed, w**2, 2.0 * w, p.max_acceleration)
    lift = lift_without_torque(observed)
    axis = observed.force @ lift
    desired = pointing_attitude(observed, acceleration, axis)
    error = attitude_error(observed.rotation, desired)
    demand = p.rate_gain * (p.attitude_gain * error - omega)
    torque = observed.torque @ slow_thrusts + observed.inertia @ (demand - omega_rate)

    def filtered(value: Any, state: Any, rate: Any) -> Any:
        """Second derivative of the state of a filter with gain 1."""
        w, zeta = p.filter_frequency, p.filter_damping
        return w * (w * (value - state) - 2.0 * zeta * rate)

    push = push_along(observed, acceleration, axis)
    return Command(
        thrusts=allocated_thrusts(observed, lift, push, torque),
        rates=xp.hstack(
            [
                *(omega_rate, filtered(omega, slow_omega, omega_rate)),
                *(thrust_rates, filtered(thrusts, slow_thrusts, thrust_rates)),
            ]
        ),
    )
