"""Torques of the rotors' own spin inertia, which the thesis neglects.

A rotor of inertia ``J_r`` about its axis ``d_i``, the thrust axis, has the angular momentum ``J_r
varpi_i d_i`` beyond what turns with its pod. Its rate acts on the vehicle with the torque ``-d/dt
sum_i J_r varpi_i d_i - omega x sum_i J_r varpi_i d_i``, and across the pod's hinge on its servo.
All sums here are per unit of ``J_r``, in body axes, of rotors on the cross.
"""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import body_force
from tiltsim_controllers.vehicle.rigid_body import cross


@scalar
def sum_along_thrust_axes(trig: Octet, values: Quad) -> Triple:
    """``sum_i values_i d_i``: of rotor speeds (rad/s), their total momentum.

    ``trig`` are the `sines_and_cosines` of the tilt angles, or their rates for ``values_i d_i'``.
    """
    return body_force(trig, -values[0], values[1], -values[2], values[3])


@scalar
def spin_torque(
    trig: Octet, turning: Octet, speeds: Quad, accelerations: Quad, omega: Triple
) -> Triple:
    """The torque on the vehicle, rad/s^2.

    Args:
        trig: `sines_and_cosines` of the tilt angles
        turning: their `trigonometric_rates`, 1/s
        speeds: of the rotors, rad/s, signed
        accelerations: their rates, rad/s^2
        omega: body rates, rad/s
    """
    momentum = sum_along_thrust_axes(trig, speeds)
    faster = sum_along_thrust_axes(trig, accelerations)
    tilting = sum_along_thrust_axes(turning, speeds)
    carried = cross(omega, momentum)
    return (
        -faster[0] - tilting[0] - carried[0],
        -faster[1] - tilting[1] - carried[1],
        -faster[2] - tilting[2] - carried[2],
    )


@scalar
def spin_torques_on_hinges(trig: Octet, speeds: Quad, omega: Triple) -> Quad:
    """The torques about the tilt axes on the four pods, rad/s^2: ``-varpi_i (omega x d_i)``.

    Neither a rotor's acceleration nor the motion of its pod has a part about the hinge.

    Args:
        trig: `sines_and_cosines` of the tilt angles
        speeds: of the rotors, rad/s, signed
        omega: body rates, rad/s
    """
    s1, c1, s2, c2, s3, c3, s4, c4 = trig
    p, q, r = omega
    return (
        -speeds[0] * (q * c1 + r * s1),
        -speeds[1] * (r * s2 - p * c2),
        -speeds[2] * (r * s3 - q * c3),
        -speeds[3] * (r * s4 + p * c4),
    )


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
