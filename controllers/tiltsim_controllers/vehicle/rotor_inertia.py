"""Torques of the rotors' own spin inertia, which the thesis neglects.

A rotor of inertia ``J_r`` about its axis ``d_i``, the thrust axis, has the angular momentum ``J_r
varpi_i d_i`` beyond what turns with its pod. Its rate acts on the vehicle with the torque ``-d/dt
sum_i J_r varpi_i d_i - omega x sum_i J_r varpi_i d_i``, and across the pod's hinge on its servo:
see `tiltsim_controllers.vehicle.rotor_code.RotorCode`. All sums here are per unit of ``J_r``, in
body axes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from tiltsim_controllers.mathematics.scalar import Triple, Values, scalar
from tiltsim_controllers.mathematics.vectors import tuple_text, written_out
from tiltsim_controllers.vehicle.rigid_body import cross
from tiltsim_controllers.vehicle.rotor_code import RotorCode


@cache
def spin_torque_of(code: RotorCode) -> Callable[..., Triple]:
    """Scalar code of the torque on the vehicle, rad/s^2.

    It is ``(axes, tilt_rates, speeds, accelerations, omega) -> torque``: the axes of `RotorCode`,
    rates of the tilts (rad/s), signed speeds of the rotors (rad/s), their rates, and body rates.
    """
    turning, along = code.turning, code.along

    @scalar
    def spin_torque(
        axes: Any, tilt_rates: Values, speeds: Values, accelerations: Values, omega: Triple
    ) -> Triple:
        momentum = along(axes, speeds)
        faster = along(axes, accelerations)
        tilting = along(turning(axes, tilt_rates), speeds)
        carried = cross(omega, momentum)
        return (
            -faster[0] - tilting[0] - carried[0],
            -faster[1] - tilting[1] - carried[1],
            -faster[2] - tilting[2] - carried[2],
        )

    return spin_torque


@scalar
def acceleration_within_limits(
    speed: float, acceleration: float, min_speed: float, max_speed: float
) -> float:
    """The acceleration (rad/s^2) that a demanded one gives a rotor: none beyond a limit.

    Args:
        speed, acceleration: rad/s and rad/s^2, along the spin
        min_speed, max_speed: limits, rad/s, along the spin
    """
    if speed >= max_speed and acceleration > 0.0:
        return 0.0
    if speed <= min_speed and acceleration < 0.0:
        return 0.0
    return acceleration


@cache
def accelerations_within_limits_of(spins: Values) -> Callable[..., Values]:
    """Scalar code ``(speeds, demanded, low, high) -> accelerations`` of rotors with these spins."""
    senses = "".join("p" if spin > 0.0 else "m" for spin in spins)
    accelerations: Callable[..., Values] = written_out(
        f"accelerations_within_limits_{senses}",
        "speeds, demanded, low, high",
        tuple_text(
            f"within(speeds[{i}], demanded[{i}], low, high)"
            if spin > 0.0
            else f"-within(-speeds[{i}], -demanded[{i}], low, high)"
            for i, spin in enumerate(spins)
        ),
        within=acceleration_within_limits,
    )
    return accelerations
