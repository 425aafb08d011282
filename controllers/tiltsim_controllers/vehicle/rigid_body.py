"""Rotational kinematics and dynamics: Euler angles, body rates and torque with derivatives."""

from __future__ import annotations

from math import cos, sin

from tiltsim_controllers.mathematics.jets import Jet, jet_cosine, jet_product, jet_sine, jet_sum
from tiltsim_controllers.mathematics.scalar import Triple, scalar


@scalar
def euler_derivatives(
    roll: float, pitch: float, omega: Triple, omega_rate: Triple
) -> tuple[float, float, float, float, float, float]:
    """First and second derivatives of roll, pitch and yaw, in rad/s and rad/s^2.

    Inverts ``omega = M(roll, pitch) eta'`` and ``omega' = M eta'' + M' eta'`` (the exact relation
    that ch. 3, Eq. 8, approximates); divides by ``cos(pitch)``.

    Args:
        roll, pitch: rad
        omega, omega_rate: body rates (rad/s) and their rates (rad/s^2)
    """
    p, q, r = omega
    sr, cr, sp, cp = sin(roll), cos(roll), sin(pitch), cos(pitch)
    yaw_rate = (sr * q + cr * r) / cp
    pitch_rate = cr * q - sr * r
    roll_rate = p + sp * yaw_rate
    # omega' - M' eta'
    p_rate = omega_rate[0] + cp * pitch_rate * yaw_rate
    q_rate = omega_rate[1] - (
        -sr * roll_rate * pitch_rate + (cr * cp * roll_rate - sr * sp * pitch_rate) * yaw_rate
    )
    r_rate = omega_rate[2] - (
        -cr * roll_rate * pitch_rate - (sr * cp * roll_rate + cr * sp * pitch_rate) * yaw_rate
    )
    dd_yaw = (sr * q_rate + cr * r_rate) / cp
    dd_roll, dd_pitch = p_rate + sp * dd_yaw, cr * q_rate - sr * r_rate
    return roll_rate, pitch_rate, yaw_rate, dd_roll, dd_pitch, dd_yaw


@scalar
def angular_jerk(roll: Jet, pitch: Jet, yaw: Jet, jerk: Triple) -> Triple:
    """Second derivatives (rad/s^3) of the body rates.

    ``p = roll' - yaw' sin(pitch)``, ``q = pitch' cos(roll) + yaw' sin(roll) cos(pitch)``, ``r =
    -pitch' sin(roll) + yaw' cos(roll) cos(pitch)``, each differentiated twice.

    Args:
        roll, pitch, yaw: the angles with their first two derivatives, rad and s
        jerk: third derivatives of the three angles, rad/s^3
    """
    sin_roll, cos_roll = jet_sine(roll), jet_cosine(roll)
    sin_pitch, cos_pitch = jet_sine(pitch), jet_cosine(pitch)
    pitch_rate = (pitch[1], pitch[2], jerk[1])
    yaw_rate = (yaw[1], yaw[2], jerk[2])
    across = jet_product(yaw_rate, cos_pitch)
    along = jet_product(yaw_rate, sin_pitch)
    q = jet_sum(1.0, jet_product(pitch_rate, cos_roll), 1.0, jet_product(across, sin_roll))
    r = jet_sum(-1.0, jet_product(pitch_rate, sin_roll), 1.0, jet_product(across, cos_roll))
    return jerk[0] - along[2], q[2], r[2]


@scalar
def cross(a: Triple, b: Triple) -> Triple:
    """The vector product ``a x b``."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@scalar
def angular_acceleration(
    torque: Triple, omega: Triple, inertia: Triple, gyroscopic: float
) -> Triple:
    """The angular acceleration ``I^-1 (torque - gyroscopic omega x I omega)`` (rad/s^2).

    Args:
        torque: n m, body axes
        omega: body rates, rad/s
        inertia: principal moments of inertia, kg m^2
        gyroscopic: factor of the gyroscopic torque, 1 or 0
    """
    ixx, iyy, izz = inertia
    cx, cy, cz = cross(omega, (ixx * omega[0], iyy * omega[1], izz * omega[2]))
    return (
        (torque[0] - gyroscopic * cx) / ixx,
        (torque[1] - gyroscopic * cy) / iyy,
        (torque[2] - gyroscopic * cz) / izz,
    )


@scalar
def torque_rate(
    omega: Triple, omega_rate: Triple, jerk: Triple, inertia: Triple, gyroscopic: float
) -> Triple:
    """Torque rate (N m/s) that gives an angular jerk: derivative of ``I omega' + omega x I omega``.

    Args:
        omega, omega_rate, jerk: body rates (rad/s) and their first two derivatives
        inertia: principal moments of inertia, kg m^2
        gyroscopic: factor of the gyroscopic torque ``omega x I omega``, 1 or 0
    """
    ixx, iyy, izz = inertia
    mx, my, mz = cross(omega_rate, (ixx * omega[0], iyy * omega[1], izz * omega[2]))
    lx, ly, lz = cross(omega, (ixx * omega_rate[0], iyy * omega_rate[1], izz * omega_rate[2]))
    return (
        ixx * jerk[0] + gyroscopic * (mx + lx),
        iyy * jerk[1] + gyroscopic * (my + ly),
        izz * jerk[2] + gyroscopic * (mz + lz),
    )
