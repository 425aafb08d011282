"""The rotors' spin about their thrust axes: angular momentum that a law takes along."""

from __future__ import annotations

from tiltsim_controllers.mathematics.jets import Jets3
from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import trigonometric_rates
from tiltsim_controllers.vehicle.rigid_body import cross
from tiltsim_controllers.vehicle.rotor_code import sum_along_thrust_axes


@scalar
def spin_momentum(trig: Octet, tilt_rates: Quad, speeds: Quad, inertia: float) -> Jets3:
    """Angular momentum (N m s, body axes) of the rotors' spin, with its derivatives.

    Only the pods' motion at constant rates counts. The rotors' acceleration is what the controller
    computes, so its reaction is not known before.

    Args:
        trig: `sines_and_cosines` of the tilt angles
        tilt_rates: rad/s
        speeds: of the rotors, rad/s, signed
        inertia: of a rotor about its axis, kg m^2
    """
    if inertia == 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    turning = trigonometric_rates(trig, tilt_rates)
    x, y, z = sum_along_thrust_axes(trig, speeds)
    x_rate, y_rate, z_rate = sum_along_thrust_axes(turning, speeds)
    xx, yy, zz = sum_along_thrust_axes(trigonometric_rates(turning, tilt_rates), speeds)
    return (
        (inertia * x, inertia * x_rate, inertia * xx),
        (inertia * y, inertia * y_rate, inertia * yy),
        (inertia * z, inertia * z_rate, inertia * zz),
    )


@scalar
def _momentum_rate(momentum: Triple, rate: Triple, omega: Triple) -> Triple:
    """Rate of a momentum that rotates with the body, from its rate in body axes."""
    x, y, z = cross(omega, momentum)
    return rate[0] + x, rate[1] + y, rate[2] + z


@scalar
def spin_torques(spin: Jets3, omega: Triple, omega_rate: Triple) -> tuple[Triple, Triple]:
    """Torque (N m) that the rotors' spin takes, and its rate (N m/s), body axes.

    Args:
        spin: their angular momentum
        omega, omega_rate: body rates (rad/s) and their rates (rad/s^2)
    """
    x, y, z = spin
    momentum, rate = (x[0], y[0], z[0]), (x[1], y[1], z[1])
    swept = cross(omega_rate, momentum)
    second = (x[2] + swept[0], y[2] + swept[1], z[2] + swept[2])
    return _momentum_rate(momentum, rate, omega), _momentum_rate(rate, second, omega)
