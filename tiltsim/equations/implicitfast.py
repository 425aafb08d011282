"""MuJoCo's integrator ``implicitfast`` for the rigid body of any rotorcraft.

It is the semi-implicit Euler method, with the servos' damping taken at the end of the step: first
the velocities, then the positions with the new velocities. Of a body without hinges the gyroscopic
torque is taken at the end of the step as well, to first order (MuJoCo 4; of others it is not).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import cos, sin, sqrt
from typing import Any

from tiltsim.closed_loop.loop import Equations
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1, TILT_RATE_1
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Vector, scalar
from tiltsim_controllers.mathematics.vectors import entries_of
from tiltsim_controllers.vehicle.multirotor import Body, inertia_times
from tiltsim_controllers.vehicle.rigid_body import cross


@scalar
def _dot(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@scalar
def _column(body: Body, omega: Triple, spin: Triple, axis: Triple, timestep: float) -> Triple:
    """A column of the matrix of `turning_at_the_end`: along an axis, kg m^2."""
    along = inertia_times(body, axis)
    x, y, z = cross(omega, along)
    u, v, w = cross(spin, axis)
    return (
        along[0] + timestep * (x - u),
        along[1] + timestep * (y - v),
        along[2] + timestep * (z - w),
    )


@scalar
def turned(quaternion: Quad, angle: Triple) -> Quad:
    """An attitude followed by a turn about an axis of the body, whose length is the angle (rad)."""
    w, x, y, z = quaternion
    a, b, c = angle
    whole = sqrt(a * a + b * b + c * c + 1e-30)  # never zero: so the quotient has derivatives
    along, about = cos(0.5 * whole), sin(0.5 * whole) / whole
    a, b, c = about * a, about * b, about * c
    return (
        w * along - x * a - y * b - z * c,
        x * along + w * a + y * c - z * b,
        y * along + w * b + z * a - x * c,
        z * along + w * c + x * b - y * a,
    )


@scalar
def turning_at_the_end(body: Body, omega: Triple, turning: Triple, timestep: float) -> Triple:
    """The angular acceleration (rad/s^2) with the gyroscopic torque at the end of a step.

    It solves ``(I + h d(omega x I omega)/d omega) a = I turning`` by Cramer's rule.

    Args:
        body: its inertia I counts
        omega: body rates at the beginning, rad/s
        turning: the angular acceleration with the gyroscopic torque there, rad/s^2
        timestep: h, s
    """
    spin = inertia_times(body, omega)
    first = _column(body, omega, spin, (1.0, 0.0, 0.0), timestep)
    second = _column(body, omega, spin, (0.0, 1.0, 0.0), timestep)
    third = _column(body, omega, spin, (0.0, 0.0, 1.0), timestep)
    torque = inertia_times(body, turning)
    normal_1, normal_2, normal_3 = cross(second, third), cross(third, first), cross(first, second)
    whole = _dot(first, normal_1)
    return (
        _dot(torque, normal_1) / whole,
        _dot(torque, normal_2) / whole,
        _dot(torque, normal_3) / whole,
    )


@cache
def make_implicitfast_step(equations: Equations, tilts: int) -> Callable[..., list[float]]:
    """One step of the equations of a loop on a `tiltsim.equations.rigid_body` with so many tilts.

    Returns:
        Scalar code ``(time, state, inputs, timestep, parameters, knots, disturbance) -> state``,
        from a time (s) on, with the inputs since the last control sample.
    """
    rates_of, project_onto_limits = equations.rates, equations.project_onto_limits
    assert project_onto_limits is not None  # which keeps the quaternion's length
    qvel_1 = TILT_1 + tilts
    rate_1 = qvel_1 + TILT_RATE_1
    quaternion_in: Callable[[Vector], Any] = entries_of(QW, 4)
    body_rates_in: Callable[[Vector], Any] = entries_of(qvel_1 + 3, 3)

    @scalar
    def step(
        time: float,
        state: list[float],
        inputs: Vector,
        timestep: float,
        parameters: Any,
        knots: Vector,
        disturbance: Triple,
    ) -> list[float]:
        mechanics = parameters.layer
        rates = rates_of(time, state, inputs, parameters, knots, disturbance)
        damping = 1.0 + 2.0 * mechanics.servo_damping * mechanics.servo_frequency * timestep
        new = [value + timestep * rate for value, rate in zip(state, rates)]
        if tilts == 0:
            omega, turning = body_rates_in(state), body_rates_in(rates)
            turning = turning_at_the_end(mechanics.vehicle.body, omega, turning, timestep)
            for axis in range(3):
                new[qvel_1 + 3 + axis] = omega[axis] + timestep * turning[axis]
        for axis in range(3):
            new[axis] = state[axis] + timestep * new[qvel_1 + axis]
        for tilt in range(tilts):
            rate = state[rate_1 + tilt] + timestep * rates[rate_1 + tilt] / damping
            new[rate_1 + tilt] = rate
            new[TILT_1 + tilt] = state[TILT_1 + tilt] + timestep * rate
        p, q, r = body_rates_in(new)
        attitude = turned(quaternion_in(state), (timestep * p, timestep * q, timestep * r))
        for entry in range(4):
            new[QW + entry] = attitude[entry]
        return project_onto_limits(new, parameters)

    return step
