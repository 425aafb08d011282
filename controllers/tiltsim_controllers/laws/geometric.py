"""Tracking control on SE(3) for any rotorcraft.

Lee, Leok and McClamroch (2010), "Geometric tracking control of a quadrotor UAV on SE(3)", Eqs. 10
to 16, with these changes:

- the axes have z up, theirs down, so that force and gravity change their signs;
- ``b``, the axis in which the rotors push without torque, replaces the body's third axis; where the
  law commands the tilts of enough rotors, the force has any direction;
- the yaw of the desired attitude comes from the reference, in place of the heading ``b_1d``;
- ``Omega_d`` follows from the reference's jerk, and its derivative counts as zero in Eq. 16;
- gains are bandwidths and damping ratios, ``k_x`` and ``k_v`` per mass, and the feedback of
  position is limited in length.
"""

from typing import Any, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.keys import Keys, Positive, default, required
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.laws.outer_loop import (
    UP,
    allocated_thrusts,
    allocated_with_tilts,
    demanded_acceleration,
    in_components,
    lift_without_torque,
    of_components,
    pointing_attitude,
    pointing_rates,
    push_along,
)
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.mathematics.linear import cross


class Geometric(Keys):
    """Keys of `geometric` and `geometric_with_tilts`."""

    law: Literal["geometric"] = required(
        "tracking control on SE(3) (Lee et al. 2010), from any attitude; force and torque are "
        "allocated to the rotors, or to rotors and tilts (Kamel et al. 2018)"
    )
    position_bandwidth: Positive = default(2.0, "natural frequency of the position's error [rad/s]")
    position_damping: Positive = default(1.0, "its damping ratio [-]")
    attitude_bandwidth: Positive = default(
        10.0,
        "natural frequency of a small error of attitude, about an axis of the mean moment of "
        "inertia [rad/s]",
    )
    attitude_damping: Positive = default(1.0, "its damping ratio [-]")
    max_acceleration: Positive = default(
        1e9, "largest acceleration that the feedback of position demands [m/s^2]"
    )


def geometric(observed: Observed, p: Geometric) -> Command:
    """The law where the tilts follow a gait."""
    acceleration = tracking_acceleration(observed, p)
    lift = lift_without_torque(observed)  # thrusts, N
    b = observed.force @ lift
    R_d = pointing_attitude(observed, acceleration, b)  # turns b along the force of Eq. 12
    Omega_d = pointing_rates(observed, acceleration, b, R_d)
    f = push_along(observed, acceleration, b)  # Eq. 15
    M = moment(observed, p, R_d, Omega_d)  # Eq. 16
    return Command(thrusts=allocated_thrusts(observed, lift, f, M))


def geometric_with_tilts(observed: Observed, p: Geometric) -> Command:
    """The law where it commands the tilts: it also tracks any attitude."""
    acceleration = tracking_acceleration(observed, p)
    m, g = observed.vehicle.mass, observed.vehicle.gravity
    force = m * observed.rotation.T @ (acceleration + g * xp.array(UP))  # body axes
    M = moment(observed, p, rotation_matrix(observed.reference.attitude), xp.zeros(3))
    thrusts, tilts = allocated_with_tilts(observed, force, M)
    return Command(thrusts=thrusts, tilt_angles=tilts)


def geometric_leaning_with_tilts(observed: Observed, p: Geometric) -> Command:
    """The law where it commands the tilts of too few rotors for a force in any direction."""
    components = geometric(in_components(observed), p).thrusts
    thrusts, tilts = of_components(observed.rotors, components)
    return Command(thrusts=thrusts, tilt_angles=tilts)


def tracking_acceleration(observed: Observed, p: Geometric) -> Any:
    """The parenthesis of Eq. 12 per mass, without gravity: m/s^2, world axes, shape (3,)."""
    k_x = p.position_bandwidth**2
    k_v = 2.0 * p.position_damping * p.position_bandwidth
    return demanded_acceleration(observed, k_x, k_v, p.max_acceleration)


def moment(observed: Observed, p: Geometric, attitude: Any, rates: Any) -> Any:
    """The torque (N m, body axes) of Eq. 16, shape (3,).

    Args:
        observed: By the law.
        p: Its gains.
        attitude: Desired, R_d, shape (3, 3).
        rates: Desired, in the present body axes: ``R^T R_d Omega_d``, rad/s, shape (3,).

    The gyroscopic torque is 0 on the thesis's equations, which omit it.
    """
    J, R, Omega = observed.inertia, observed.rotation, observed.body_rates
    j = xp.trace(J) / 3.0  # mean moment of inertia: gains in rad/s for any vehicle
    k_R, k_Omega = j * p.attitude_bandwidth**2, 2.0 * j * p.attitude_damping * p.attitude_bandwidth
    e_R, e_Omega = -attitude_error(R, attitude), Omega - rates  # Eqs. 10 and 11
    gyroscopic = observed.gyroscopic * cross(Omega, J @ Omega)
    return -k_R * e_R - k_Omega * e_Omega + gyroscopic - J @ cross(Omega, rates)
