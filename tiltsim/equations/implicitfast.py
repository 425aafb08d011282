"""MuJoCo's integrator ``implicitfast`` for the rigid body of any rotorcraft.

It is the semi-implicit Euler method, with the servos' damping taken at the end of the step: first
the velocities, then the positions with the new velocities. For a body without hinges the gyroscopic
torque is taken at the end of the step as well, to first order (MuJoCo 4; for others it is not).
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from tiltsim.closed_loop.loop import Equations
from tiltsim.equations.actuator_level import Motion, as_in_mujoco
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.attitude import quaternion_product
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.vehicle.body import Body, inertia_matrix
from tiltsim_controllers.vehicle.craft import body_in
from tiltsim_controllers.vehicle.motion import joined


def turned(quaternion: Any, angle: Any) -> Any:
    """An attitude after a turn about an axis of the body, whose length is the angle (rad)."""
    whole = xp.sqrt(angle @ angle + 1e-30)  # never zero: so the quotient has derivatives
    half = 0.5 * whole
    return quaternion_product(quaternion, xp.hstack([xp.cos(half), xp.sin(half) / whole * angle]))


def turning_at_the_end(body: Body, omega: Any, turning: Any, timestep: float) -> Any:
    """The angular acceleration (rad/s^2), shape (3,), with the gyroscopic torque at a step's end.

    It solves ``(I + h d(omega x I omega)/d omega) a = I turning`` by Cramer's rule.

    Args:
        body: Its inertia I counts.
        omega: Body rates at the beginning, rad/s, shape (3,).
        turning: The angular acceleration with the gyroscopic torque there, rad/s^2, shape (3,).
        timestep: h, s.
    """
    inertia = inertia_matrix(body)
    slope = cross(omega, inertia) - cross(inertia @ omega, np.eye(3))
    a, b, c = (inertia + timestep * slope).T
    normals = xp.array([cross(b, c), cross(c, a), cross(a, b)])
    return normals @ (inertia @ turning) / (a @ normals[0])


@cache
def make_implicitfast_step(equations: Equations, tilts: int) -> Callable[..., Any]:
    """One step of the equations of a loop on a `tiltsim.equations.rigid_body`.

    Args:
        equations: Equations of the loop.
        tilts: Number of the vehicle's tilts.

    Returns:
        ``(time, state, inputs, timestep, parameters, knots, disturbance) -> state``,
        from a time (s) on, with the inputs since the last control sample.
    """
    rates_of, project_onto_limits = equations.rates, equations.project_onto_limits
    assert project_onto_limits is not None  # which keeps the quaternion's length
    layout = as_in_mujoco(tilts)

    def advanced(state: Any, rates: Any, timestep: Any, mechanics: Any) -> Any:
        now, change = layout.split(state), layout.split(rates)
        turning = change.omega
        if tilts == 0:
            turning = turning_at_the_end(body_in(mechanics.vehicle), now.omega, turning, timestep)
        damping = 1.0 + 2.0 * mechanics.servo_damping * mechanics.servo_frequency * timestep
        velocity, omega = now.velocity + timestep * change.velocity, now.omega + timestep * turning
        tilt_rates = now.tilt_rates + timestep * change.tilt_rates / damping
        moved = Motion(
            position=now.position + timestep * velocity,
            attitude=turned(now.attitude, timestep * omega),
            velocity=velocity,
            omega=omega,
            tilts=now.tilts + timestep * tilt_rates,
            tilt_rates=tilt_rates,
        )
        activations = state[layout.size :] + timestep * rates[layout.size :]
        return joined((layout.joined(moved), activations))

    @traceable
    def step(
        time: Any,
        state: Any,
        inputs: Any,
        timestep: Any,
        parameters: Any,
        knots: Any,
        disturbance: Any,
    ) -> Any:
        rates = rates_of(time, state, inputs, parameters, knots, disturbance)
        return project_onto_limits(advanced(state, rates, timestep, parameters.layer), parameters)

    return step
