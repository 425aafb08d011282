"""Observers of disturbances and a prioritized mixer around a law that demands thrusts.

The observers are of Luenberger's kind with a double pole: velocity and body rates of a model that
the measured rotor speeds drive, and the constant acceleration that explains their errors (Chen et
al. 2016, "Disturbance-observer-based control and related methods", sec. III). They take the place
of integrators, and a rotor at its limit does not wind them up, since its speed is measured. The
mixer keeps thrusts within the limits: torque about x and y before lift, yaw and side force
(Faessler, Falanga and Scaramuzza 2017, "Thrust mixing, saturation, and body-rate control for
accurate aggressive quadrotor flight"). Integrators of the law itself rest while it limits.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.allocation import bounded_least_squares, largest
from tiltsim_controllers.laws.keys import Keys, NonNegative, default
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.mathematics.linear import cross, nearest_solution, norm, solved_symmetric
from tiltsim_controllers.mathematics.records import make_record_type, vector_of

STATES: Final = {
    **{f"state_modeled_velocity_{axis}": "m/s" for axis in "xyz"},
    **{f"state_disturbing_acceleration_{axis}": "m/s^2" for axis in "xyz"},
    **{f"state_modeled_rate_{axis}": "rad/s" for axis in "xyz"},
    **{f"state_disturbing_angular_acceleration_{axis}": "rad/s^2" for axis in "xyz"},
}
"""States of the observers, after the law's."""

SOFTNESS: Final = (1.0, 1.0, 1e-6, 1e-9, 1e-9, 1e-3)
"""Softness of side force, lift, torque about x and y, and yaw: the smallest is met first."""


class Compensating(Keys):
    """Keys of `compensated`."""

    observer: NonNegative = default(
        0.0,
        "bandwidth of observers of a disturbing force and torque, which the law then counters; 0: "
        "none [1/s]",
    )
    mixer: Literal["plain", "prioritized"] = default(
        "plain",
        "whether thrusts beyond vehicle.min_rotor_speed and max_rotor_speed are cut off one by "
        "one, or roll and pitch are kept before lift, yaw and side force",
    )


@cache
def record_of_limits(own: type[tuple[Any, ...]], rotors: int) -> Any:
    """The type of the parameters of `compensated`, of the law's own type and a number of rotors."""
    each = vector_of(rotors)
    return make_record_type("Compensated", own=own, observer=float, low=each, high=each)


@cache
def compensated(
    law: Callable[..., Command], turning: bool, integrators: int, observes: bool, mixes: bool
) -> Callable[..., Command]:
    """A law with observers, a mixer or both.

    Args:
        law: It demands thrusts.
        turning: Whether the torque is also countered, since the law does not do so itself.
        integrators: How many of its states, the first ones, are integrators.
        observes: Whether there are observers.
        mixes: Whether there is a mixer.
    """

    def flown(observed: Observed, p: Any) -> Command:
        """The law, with the law's states and `STATES`."""
        first = len(observed.states) - len(STATES) * observes
        _, force, _, torque = (
            observed.states[first:].reshape(4, 3) if observes else xp.zeros((4, 3))
        )
        reference, own = observed.reference, observed.states[:first]
        seen = observed._replace(
            states=own, reference=reference._replace(acceleration=reference.acceleration - force)
        )
        command = law(seen, p.own)
        thrusts, rates = command.thrusts, [xp.zeros(0) if first == 0 else command.rates]
        if observes and turning:
            desired = -(observed.inertia @ torque)
            thrusts = thrusts + nearest_solution(observed.torque, desired, xp.zeros(len(thrusts)))
        if mixes:
            found = mixed(observed, thrusts, xp.array(p.low), xp.array(p.high))
            if integrators:
                miss = thrusts - found
                is_limited = miss @ miss > 1e-12 * (thrusts @ thrusts)
                held = xp.where(is_limited, 0.0, command.rates[:integrators])
                rates = [held, command.rates[integrators:]]
            thrusts = found
        if observes:
            rates.append(observer_rates(observed, first, p.observer))
        return replace(command, thrusts=thrusts, rates=xp.hstack(rates))

    return flown


def mixed(observed: Observed, thrusts: Any, low: Any, high: Any) -> Any:
    """Thrusts within limits whose wrench is, by priority, the one of others, shape (N,).

    Args:
        observed: By the law.
        thrusts: Desired, N, shape (N,).
        low, high: Limits, N, shape (N,).
    """
    lift, scale = norm(observed.force[2]), observed.vehicle.mass * observed.vehicle.gravity
    yaw = nearest_solution(
        observed.torque,
        (observed.torque @ thrusts) * xp.array([0.0, 0.0, 1.0]),
        xp.zeros(len(thrusts)),
    )
    rest = thrusts - yaw
    # Where all of the yaw would put every rotor to a limit, none would be left for roll and pitch.
    size = xp.where(abs(yaw) > 1e-9 * scale, yaw, 1e-9 * scale)
    share = xp.clip(xp.maximum((low - rest) / size, (high - rest) / size), 0.0, 1.0)
    part = -largest(-share)
    desired = xp.where(part < 1.0, rest + part * yaw, thrusts) / scale
    rows = xp.vstack([observed.force / lift, *(row[None] / norm(row) for row in observed.torque)])
    return scale * bounded_least_squares(
        rows,
        rows @ desired,
        xp.array(SOFTNESS),
        xp.ones(len(thrusts)),
        desired,
        low / scale,
        high / scale,
    )


def observer_rates(observed: Observed, first: int, bandwidth: Any) -> Any:
    """Rates of `STATES`, shape (12,), which begin at an index, given the bandwidth (1/s)."""
    velocity, force, omega, torque = observed.states[first:].reshape(4, 3)
    body, J, seen = observed.vehicle, observed.inertia, observed.body_rates
    push = observed.rotation @ (observed.force @ observed.thrusts) / body.mass
    moment = observed.torque @ observed.thrusts - observed.gyroscopic * cross(seen, J @ seen)
    slip, spin = observed.velocity - velocity, seen - omega
    twice, square = 2.0 * bandwidth, bandwidth * bandwidth
    return xp.hstack(
        [
            push - body.gravity * xp.array([0.0, 0.0, 1.0]) + force + twice * slip,
            square * slip,
            solved_symmetric(J, moment) + torque + twice * spin,
            square * spin,
        ]
    )
