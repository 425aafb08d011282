"""Fixed-step solvers for the equations of any closed loop: the thesis's ode3, RK4, Euler, MuJoCo's.

One controller runs here and in MuJoCo: the difference between the plants is a result.
MuJoCo's ``implicitfast``, for the rigid body of any rotorcraft, is the semi-implicit Euler method
with the servos' damping taken at the end of the step: first the velocities, then the positions with
the new velocities. For a body without hinges the gyroscopic torque is taken at the end of the step
as well, to first order (MuJoCo 4; for others it is not).
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import Equations
from tiltsim.closed_loop.userdata import just_after, just_before
from tiltsim.equations.actuator_level import Motion, as_in_mujoco
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.attitude import quaternion_product
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.scalar import Triple
from tiltsim_controllers.vehicle.body import Body, inertia_matrix, joined


class Integration(NamedTuple):
    """Constants of the integration of one flight."""

    timestep: float  # s
    control_steps: int  # steps for which the inputs are held; 0: evaluated at every stage
    parameters: Any
    knots: Any
    disturbance: Triple  # m/s^2, world axes


def stage(state: Any, step: Any, rates: Any) -> Any:
    """The state one explicit stage further."""
    return state + step * rates


def _euler(state: Any, step: Any, rates: Any) -> Any:
    return state + step * rates[0]


def _ode3(state: Any, step: Any, rates: Any) -> Any:
    a, b, c = rates
    return state + step * (2.0 / 9.0 * a + 1.0 / 3.0 * b + 4.0 / 9.0 * c)


def _rk4(state: Any, step: Any, rates: Any) -> Any:
    a, b, c, d = rates
    return state + step / 6.0 * (a + 2.0 * (b + c) + d)


class Solver(NamedTuple):
    """An explicit method, each stage of which begins at the rates of the one before."""

    nodes: tuple[float, ...]  # times of the stages after the first, in time steps
    combined: Callable[..., Any]
    """``(state, timestep, rates of the stages) -> state`` at the end of a step."""
    sees_events: bool = False
    """Whether the first stage is just after the beginning of a step and the last just before its
    end, as in MuJoCo; see `tiltsim.closed_loop.userdata.evaluation_time`."""


SOLVERS: Final = {
    "Euler": Solver((), _euler),  # for comparison with other simulators
    "ode3": Solver((0.5, 0.75), _ode3),  # of Bogacki and Shampine
    "RK4": Solver((0.5, 0.5, 1.0), _rk4, sees_events=True),
}
"""By the name of ``simulation.integrator``."""


@cache
def make_step(equations: Equations, solver: str) -> Callable[..., tuple[Any, Any]]:
    """One step of a loop's equations.

    Returns:
        ``(time, state, held, samples, integration) -> state, held``: one step of a solver of
        `SOLVERS`, from a time (s) on. ``held`` are the inputs since the last control sample;
        ``samples`` says whether this step begins with one.
    """
    nodes, combined, sees_events = SOLVERS[solver]
    inputs, rates_of = equations.inputs, equations.rates
    project = equations.project_onto_limits

    @traceable
    def step(
        time: Any, state: Any, held: Any, samples: bool, integration: Integration
    ) -> tuple[Any, Any]:
        timestep, control_steps, parameters, knots, disturbance = integration
        start = just_after(time) if sees_events else time
        if samples:
            held = inputs(start, state, parameters, knots)
        rates = rates_of(start, state, held, parameters, knots, disturbance)
        stages = [rates]
        for node in nodes:
            later, at = stage(state, node * timestep, rates), time + node * timestep
            if sees_events and node == 1.0:
                at = just_before(at)
            if control_steps == 0:
                held = inputs(at, later, parameters, knots)
            rates = rates_of(at, later, held, parameters, knots, disturbance)
            stages = [*stages, rates]
        state = combined(state, timestep, stages)
        if project is not None:
            state = project(state, parameters)
        return state, held

    return step


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
    """One step of the equations of a loop on a `tiltsim.equations.actuator_level`.

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
            turning = turning_at_the_end(mechanics.vehicle.body, now.omega, turning, timestep)
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
