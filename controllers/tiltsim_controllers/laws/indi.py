"""Incremental nonlinear dynamic inversion of the attitude.

Smeur, Chu and de Croon (2016), "Adaptive incremental nonlinear dynamic inversion for attitude
control of micro air vehicles", Eqs. 10 to 21. The torque is a change of that which makes the
present angular acceleration, so that no model of other torques is needed. The angular acceleration
comes from filtered rates, and the thrusts that go with it pass the same filter; then it follows its
demand as the rotors follow theirs.

Increments are of the torque, not of each thrust. Of four thrusts that is the same; more would keep
forever the part of them that makes neither torque nor push, and with tilts a force to the side.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from tiltsim_controllers.laws.full_pose import attitude_error
from tiltsim_controllers.laws.geometric import Commands
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.laws.outer_loop import demanded_acceleration, pointing_attitude, push_along
from tiltsim_controllers.laws.rotor_allocation import planned_allocation_of
from tiltsim_controllers.mathematics.scalar import scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of, vectors_of
from tiltsim_controllers.vehicle.multirotor import inertia_times


class Parameters(NamedTuple):
    """Gains and the filter."""

    position: float  # 1/s^2
    velocity: float  # 1/s
    max_acceleration: float  # m/s^2
    attitude: float  # k_eta, 1/s
    rates: float  # k_Omega, 1/s
    filter_frequency: float  # rad/s
    filter_damping: float


def state_units(rotors: int) -> dict[str, str]:
    """The filters of rates and thrusts: values, then their derivatives."""
    axes, numbers = "xyz", range(1, rotors + 1)
    return {
        **{f"state_filtered_rate_{axis}": "rad/s" for axis in axes},
        **{f"state_angular_acceleration_{axis}": "rad/s^2" for axis in axes},
        **{f"state_filtered_thrust_{i}": "N" for i in numbers},
        **{f"state_thrust_rate_{i}": "N/s" for i in numbers},
    }


@scalar
def filtered(value: float, state: float, rate: float, frequency: float, damping: float) -> float:
    """Second derivative of a filter's state, of gain 1.

    Args:
        value: of what is filtered
        state, rate: of the filter
        frequency: rad/s, natural
        damping: ratio
    """
    return frequency * (frequency * (value - state) - 2.0 * damping * rate)


@cache
def indi_law_of(rotors: int) -> Callable[..., Commands]:
    """The law of vehicles with this many rotors, whose tilts follow a gait."""
    lift_of, axis_of, thrusts_of = planned_allocation_of(rotors)
    dot = vectors_of(rotors).dot
    slow_in, rates_in = entries_of(6, rotors), entries_of(6 + rotors, rotors)
    all_filtered = componentwise(
        "all_filtered", "x, state, rate, f, d", "filtered(x#, state#, rate#, f, d)", rotors,
        filtered=filtered,
    )  # fmt: skip

    @scalar
    def indi(observed: Observed, parameters: Parameters) -> Commands:
        c, states = parameters, observed.states
        p, q, r = observed.body_rates
        fp, fq, fr, dp, dq, dr = states[0], states[1], states[2], states[3], states[4], states[5]
        slow, rates = slow_in(states), rates_in(states)
        acceleration = demanded_acceleration(observed, c.position, c.velocity, c.max_acceleration)
        lift = lift_of(observed)
        axis = axis_of(observed, lift)
        desired = pointing_attitude(observed, acceleration, axis)
        ex, ey, ez = attitude_error(observed.rotation, desired)
        tx, ty, tz = inertia_times(
            observed.vehicle,
            (
                c.rates * (c.attitude * ex - p) - dp,
                c.rates * (c.attitude * ey - q) - dq,
                c.rates * (c.attitude * ez - r) - dr,
            ),
        )
        rows = observed.torque
        torque = tx + dot(rows[0], slow), ty + dot(rows[1], slow), tz + dot(rows[2], slow)
        push = push_along(observed, acceleration, axis)
        thrusts = thrusts_of(observed, lift, axis, push, torque)
        f, d = c.filter_frequency, c.filter_damping
        filters = (
            dp, dq, dr,
            filtered(p, fp, dp, f, d), filtered(q, fq, dq, f, d), filtered(r, fr, dr, f, d),
            *rates,
            *all_filtered(observed.thrusts, slow, rates, f, d),
        )  # fmt: skip
        return thrusts, (), filters

    return indi
