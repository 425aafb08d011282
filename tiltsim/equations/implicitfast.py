"""MuJoCo's integrator ``implicitfast`` for the tiltrotor at the level of its actuators.

It is the semi-implicit Euler method, with the servos' damping taken at the end of the step: first
the velocities, then the positions with the new velocities. The body has its gyroscopic torque, as
in MuJoCo; the pods are massless.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import sin, sqrt
from typing import Any, Final

from tiltsim.closed_loop.loop import Equations
from tiltsim.equations.tiltrotor import P, Q, R, rotation_of, velocity_of
from tiltsim_controllers.laws.yaw_position import gyroscopic_acceleration
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.multirotor import BODY_STATES

TILT_1: Final = BODY_STATES
RATE_1: Final = TILT_1 + 4
SPEED_1: Final = RATE_1 + 4
"""Where tilts, their rates and the rotor speeds begin in a tiltrotor's state."""


@scalar
def turned(rotation: Values, angle: Triple) -> Values:
    """A rotation, rows first, followed by one about an axis of the body, whose length is the angle.

    By Rodrigues' formula ``1 + sin(a) / a W + (1 - cos(a)) / a^2 W W``.
    """
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    x, y, z = angle
    whole = sqrt(x * x + y * y + z * z + 1e-30)  # never zero: so quotients have derivatives
    half = sin(0.5 * whole) / (0.5 * whole)
    first, second = sin(whole) / whole, 0.5 * half * half
    t11, t22, t33 = (
        1.0 - second * (y * y + z * z),
        1.0 - second * (x * x + z * z),
        1.0 - second * (x * x + y * y),
    )
    t12, t21 = second * x * y - first * z, second * x * y + first * z
    t13, t31 = second * x * z + first * y, second * x * z - first * y
    t23, t32 = second * y * z - first * x, second * y * z + first * x
    return (
        r11 * t11 + r12 * t21 + r13 * t31,
        r11 * t12 + r12 * t22 + r13 * t32,
        r11 * t13 + r12 * t23 + r13 * t33,
        r21 * t11 + r22 * t21 + r23 * t31,
        r21 * t12 + r22 * t22 + r23 * t32,
        r21 * t13 + r22 * t23 + r23 * t33,
        r31 * t11 + r32 * t21 + r33 * t31,
        r31 * t12 + r32 * t22 + r33 * t32,
        r31 * t13 + r32 * t23 + r33 * t33,
    )


@cache
def make_implicitfast_step(equations: Equations) -> Callable[..., list[float]]:
    """One step of the equations of a loop that `tiltsim.laws.layers.on_equations` has wrapped.

    Returns:
        Scalar code ``(time, state, inputs, timestep, parameters, knots, disturbance) -> state``,
        from a time (s) on, with the inputs since the last control sample.
    """
    rates_of, project_onto_limits = equations.rates, equations.project_onto_limits
    assert project_onto_limits is not None  # at the level of actuators there are limits

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
        gyroscopic = gyroscopic_acceleration(state[P], state[Q], state[R], mechanics.vehicle)
        damping = 1.0 + 2.0 * mechanics.servo_damping * mechanics.servo_frequency * timestep
        new = [value + timestep * rate for value, rate in zip(state, rates)]
        for axis in range(3):
            new[P + axis] += timestep * gyroscopic[axis]
        for rotor in range(4):
            rate = state[RATE_1 + rotor] + timestep * rates[RATE_1 + rotor] / damping
            new[RATE_1 + rotor] = rate
            new[TILT_1 + rotor] = state[TILT_1 + rotor] + timestep * rate
        vx, vy, vz, p, q, r = velocity_of(new)
        position = (state[0] + timestep * vx, state[1] + timestep * vy, state[2] + timestep * vz)
        rotation = turned(rotation_of(state), (timestep * p, timestep * q, timestep * r))
        moved = [*position, vx, vy, vz, *rotation, p, q, r, *new[TILT_1:]]
        return project_onto_limits(moved, parameters)

    return step
