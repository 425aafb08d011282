"""The thesis's fixed-step solver, ode3, for the equations of any closed loop.

The equations are those that the thesis prints (`tiltsim.equations`), with its omissions. The same
controller runs here and in MuJoCo: the difference between the two plants is a result.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from tiltsim.closed_loop.loop import Equations
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar

Stepper = Callable[..., tuple[list[float], Values]]


class Integration(NamedTuple):
    """Constants of the integration of one flight."""

    timestep: float  # s
    control_steps: int  # steps for which the inputs are held; 0: evaluated at every stage
    parameters: Any
    knots: Any
    disturbance: Triple  # m/s^2, world axes


@scalar
def stage(state: Vector, step: float, rates: Vector) -> list[float]:
    """The state one explicit stage further: ``state + step * rates``."""
    return [value + step * rate for value, rate in zip(state, rates)]


@scalar
def identity(state: list[float], parameters: Any) -> list[float]:
    """For equations without limits."""
    return state


@cache
def make_step(equations: Equations) -> Callable[..., tuple[list[float], Values]]:
    """One step of a loop's equations, as scalar code.

    Returns:
        ``(time, state, held, samples, integration) -> state, held``: one step of ode3, the
        third-order method of Bogacki and Shampine, from a time (s) on. ``held`` are the inputs
        since the last control sample; ``samples`` says whether this step begins with one.
    """
    inputs, rates = equations.inputs, equations.rates
    project_onto_limits = equations.project_onto_limits or identity

    @scalar
    def step(
        time: float, state: list[float], held: Values, samples: bool, integration: Integration
    ) -> tuple[list[float], Values]:
        timestep, control_steps, parameters, knots, disturbance = integration
        continuous = control_steps == 0
        if samples:
            held = inputs(time, state, parameters, knots)
        k1 = rates(time, state, held, parameters, knots, disturbance)
        half = stage(state, 0.5 * timestep, k1)
        half_time = time + 0.5 * timestep
        if continuous:
            held = inputs(half_time, half, parameters, knots)
        k2 = rates(half_time, half, held, parameters, knots, disturbance)
        late = stage(state, 0.75 * timestep, k2)
        late_time = time + 0.75 * timestep
        if continuous:
            held = inputs(late_time, late, parameters, knots)
        k3 = rates(late_time, late, held, parameters, knots, disturbance)
        state = [
            value + timestep * (2.0 / 9.0 * a + 1.0 / 3.0 * b + 4.0 / 9.0 * c)
            for value, a, b, c in zip(state, k1, k2, k3)
        ]
        return project_onto_limits(state, parameters), held

    return step


def make_stepper(equations: Equations) -> Stepper:
    """The solver for a loop's equations, as scalar code.

    Returns:
        ``(step_index, state, held, steps, integration) -> state, held``: as many steps of
        `make_step`, from a step on.
    """
    step = make_step(equations)

    def advance(
        step_index: int, state: list[float], held: Values, steps: int, integration: Integration
    ) -> tuple[list[float], Values]:
        control_steps = integration.control_steps
        for index in range(step_index, step_index + steps):
            samples = control_steps == 0 or index % control_steps == 0
            time = index * integration.timestep
            state, held = step(time, state, held, samples, integration)
        return state, held

    return advance
