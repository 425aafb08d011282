"""Tracking control on SE(3) for any rotorcraft.

Lee, Leok and McClamroch (2010), "Geometric tracking control of a quadrotor UAV on SE(3)", Eqs. 10
to 16. The force is that of Eq. 12 along the axis in which the rotors push without torque, or, where
the tilts are the law's, in any direction. The torque is Eq. 16 with the desired angular
acceleration zero.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from tiltsim_controllers.laws.full_pose import attitude_error
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.laws.outer_loop import (
    demanded_acceleration,
    pointing_attitude,
    pointing_rates,
    push_along,
)
from tiltsim_controllers.laws.rotor_allocation import planned_allocation_of, tilting_allocation_of
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_body
from tiltsim_controllers.mathematics.scalar import Triple, Values, scalar
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor
from tiltsim_controllers.vehicle.multirotor import inertia_times
from tiltsim_controllers.vehicle.rigid_body import cross

Commands = tuple[Values, Values, Values]
"""Thrusts (N), tilts (rad) and rates of the law's states."""


class Parameters(NamedTuple):
    """Gains; those of position per mass."""

    position: float  # k_x / m, 1/s^2
    velocity: float  # k_v / m, 1/s
    attitude: float  # k_R, N m
    rates: float  # k_Omega, N m s
    max_acceleration: float  # m/s^2
    gyroscopic: float  # 1 where the vehicle has gyroscopic torque, else 0


@scalar
def attitude_torque(
    observed: Observed, desired: Values, rates: Triple, parameters: Parameters
) -> Triple:
    """The torque (N m, body axes) of Eq. 16.

    Args:
        observed: by the law
        desired: rotation, rows first
        rates: desired, rad/s, the present body axes
        parameters: of the law
    """
    omega = observed.body_rates
    ex, ey, ez = attitude_error(observed.rotation, desired)  # minus Lee's
    body, p = observed.vehicle, parameters
    # Omega x J Omega - J (Omega x R^T R_d Omega_d): of the desired rates, seen from the body.
    gx, gy, gz = cross(omega, inertia_times(body, omega))
    tx, ty, tz = inertia_times(body, cross(omega, rates))
    return (
        p.attitude * ex - p.rates * (omega[0] - rates[0]) + p.gyroscopic * gx - tx,
        p.attitude * ey - p.rates * (omega[1] - rates[1]) + p.gyroscopic * gy - ty,
        p.attitude * ez - p.rates * (omega[2] - rates[2]) + p.gyroscopic * gz - tz,
    )


@cache
def geometric_law_of(rotors: int) -> Callable[..., Commands]:
    """The law of vehicles with this many rotors, whose tilts follow a gait."""
    lift_of, axis_of, thrusts_of = planned_allocation_of(rotors)

    @scalar
    def geometric(observed: Observed, parameters: Parameters) -> Commands:
        acceleration = demanded_acceleration(
            observed, parameters.position, parameters.velocity, parameters.max_acceleration
        )
        lift = lift_of(observed)
        axis = axis_of(observed, lift)
        desired = pointing_attitude(observed, acceleration, axis)
        rates = pointing_rates(observed, acceleration, axis, desired)
        torque = attitude_torque(observed, desired, rates, parameters)
        push = push_along(observed, acceleration, axis)
        return thrusts_of(observed, lift, axis, push, torque), (), ()

    return geometric


@cache
def free_geometric_law_of(layout: TiltOfRotor) -> Callable[..., Commands]:
    """The law of vehicles of a layout whose tilts are its own: it tracks any attitude, too."""
    allocated = tilting_allocation_of(layout)

    @scalar
    def free_geometric(observed: Observed, parameters: Parameters) -> Commands:
        body, attitude = observed.vehicle, observed.reference.attitude
        ax, ay, az = demanded_acceleration(
            observed, parameters.position, parameters.velocity, parameters.max_acceleration
        )
        mass = body.mass
        force = to_body(observed.rotation, (mass * ax, mass * ay, mass * (az + body.gravity)))
        desired = rotation_from_euler(attitude[0], attitude[1], attitude[2])
        torque = attitude_torque(observed, desired, (0.0, 0.0, 0.0), parameters)
        thrusts, tilts = allocated(observed, force, torque)
        return thrusts, tilts, ()

    return free_geometric
