"""Torques of the rotors' own spin inertia, which the thesis neglects.

A rotor of inertia ``J_r`` about its axis ``d_i``, the thrust axis, has the angular momentum ``J_r
varpi_i d_i`` beyond the part that turns with its pod. Its rate acts on the vehicle with the torque
``-d/dt sum_i J_r varpi_i d_i - omega x sum_i J_r varpi_i d_i``, and across the pod's hinge on its
servo. All sums here are per unit of ``J_r``, in body axes.
"""

from __future__ import annotations

from typing import Any

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.vehicle.craft import Craft, axis_slopes, thrust_axes
from tiltsim_controllers.vehicle.rotors import of_rotors, of_tilts


def spin_torque(
    craft: Craft, tilts: Any, tilt_rates: Any, speeds: Any, accelerations: Any, omega: Any
) -> Any:
    """The torque on the vehicle per unit of spin inertia, rad/s^2, shape (3,).

    Args:
        craft: N rotors on M pods.
        tilts, tilt_rates: rad and rad/s, shape (M,).
        speeds, accelerations: Signed, rad/s and rad/s^2, shape (N,).
        omega: Body rates, rad/s, shape (3,).
    """
    axes, slopes = thrust_axes(craft, tilts), axis_slopes(craft, tilts)
    tilting = slopes @ (of_rotors(craft.rotors, tilt_rates) * speeds)
    return -(axes @ accelerations) - tilting - cross(omega, axes @ speeds)


def hinge_torques(craft: Craft, tilts: Any, speeds: Any, accelerations: Any, omega: Any) -> Any:
    """The torques on the pods about their hinges per unit of spin inertia, rad/s^2, shape (M,).

    Each is the sum of ``varpi_i omega . d d_i / d alpha - varpi_i' a . d_i`` over the rotors of a
    pod, with its hinge along ``a``.

    Args:
        craft: N rotors on M pods.
        tilts: rad, shape (M,).
        speeds, accelerations: Signed, rad/s and rad/s^2, shape (N,).
        omega: Body rates, rad/s, shape (3,).
    """
    gyroscopic = speeds * (omega @ axis_slopes(craft, tilts))
    return of_tilts(craft.rotors, gyroscopic - craft.along_hinges * accelerations)


def accelerations_within_limits(
    spins: Any, speeds: Any, demanded: Any, min_speed: Any, max_speed: Any
) -> Any:
    """The accelerations (rad/s^2) that rotors have: none beyond a speed limit.

    Args:
        spins: Signs of the speeds, shape (N,).
        speeds, demanded: Signed, rad/s and rad/s^2, shape (N,).
        min_speed, max_speed: Limits along the spin, rad/s.
    """
    along, faster = spins * speeds, spins * demanded
    stops = ((along >= max_speed) & (faster > 0.0)) | ((along <= min_speed) & (faster < 0.0))
    return xp.where(stops, 0.0, demanded)
