"""The thesis's fixed-step solver, ode3, for the equations of motion of any loop.

The equations are those that the thesis prints (`tiltsim.equations`): they leave out what the thesis
leaves out. The same law runs here and in MuJoCo: the difference between the two plants is a result.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tiltsim.closed_loop.loop import Equations
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar

Stepper = Callable[..., tuple[list[float], Values]]


@scalar
def stage(state: Vector, step: float, rates: Vector) -> list[float]:
    """The state one explicit stage further: ``state + step * rates``."""
    return [value + step * rate for value, rate in zip(state, rates)]


@scalar
def identity(state: list[float], parameters: Any) -> list[float]:
    """For equations without limits."""
    return state


def make_stepper(equations: Equations) -> Stepper:
    """The solver around a loop's equations, as scalar code.

    The stepper integrates ``steps`` fixed steps with ode3, the third-order method of Bogacki and
    Shampine. ``control_steps`` is the number of steps for which the law's output is held, 0 to
    evaluate it at every stage. It returns the new state and the inputs held since the last control
    sample; the caller counts the steps.
    """
    inputs, rates = equations.inputs, equations.rates
    project_onto_limits = equations.project_onto_limits or identity

    def advance(
        step_index: int,
        state: list[float],
        held: Values,
        timestep: float,
        steps: int,
        control_steps: int,
        parameters: Any,
        knots: Vector,
        disturbance: Triple,
    ) -> tuple[list[float], Values]:
        continuous = control_steps == 0
        for index in range(step_index, step_index + steps):
            time = index * timestep
            if continuous or index % control_steps == 0:
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
            state = project_onto_limits(state, parameters)
        return state, held

    return advance
