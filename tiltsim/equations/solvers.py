"""Fixed-step solvers for the equations of any closed loop: the thesis's ode3, and RK4.

The same controller runs here and in MuJoCo: the difference between the plants is a result.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

from tiltsim.closed_loop.loop import Equations
from tiltsim.closed_loop.userdata import just_after, just_before
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar


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


def _stage_of(equations: Equations) -> Callable[..., tuple[Values, Values]]:
    """Scalar code of the rates after a part of a step, and of the inputs in force there."""
    inputs, rates = equations.inputs, equations.rates

    @scalar
    def rates_after(
        time: float,
        state: list[float],
        step: float,
        before: Values,
        held: Values,
        integration: Integration,
    ) -> tuple[Values, Values]:
        _, control_steps, parameters, knots, disturbance = integration
        later = stage(state, step, before)
        if control_steps == 0:
            held = inputs(time, later, parameters, knots)
        return rates(time, later, held, parameters, knots, disturbance), held

    return rates_after


def _euler_of(equations: Equations) -> Callable[..., tuple[list[float], Values]]:
    """Euler's explicit method, for comparison with other simulators; see `make_step`."""
    inputs, rates = equations.inputs, equations.rates

    @scalar
    def euler_step(
        time: float, state: list[float], held: Values, samples: bool, integration: Integration
    ) -> tuple[list[float], Values]:
        timestep, _, parameters, knots, disturbance = integration
        if samples:
            held = inputs(time, state, parameters, knots)
        return stage(
            state, timestep, rates(time, state, held, parameters, knots, disturbance)
        ), held

    return euler_step


def _ode3_of(equations: Equations) -> Callable[..., tuple[list[float], Values]]:
    """The third-order method of Bogacki and Shampine; see `make_step`."""
    inputs, rates, rates_after = equations.inputs, equations.rates, _stage_of(equations)

    @scalar
    def ode3_step(
        time: float, state: list[float], held: Values, samples: bool, integration: Integration
    ) -> tuple[list[float], Values]:
        timestep, _, parameters, knots, disturbance = integration
        if samples:
            held = inputs(time, state, parameters, knots)
        k1 = rates(time, state, held, parameters, knots, disturbance)
        half, late = 0.5 * timestep, 0.75 * timestep
        k2, held = rates_after(time + half, state, half, k1, held, integration)
        k3, held = rates_after(time + late, state, late, k2, held, integration)
        return [
            value + timestep * (2.0 / 9.0 * a + 1.0 / 3.0 * b + 4.0 / 9.0 * c)
            for value, a, b, c in zip(state, k1, k2, k3)
        ], held

    return ode3_step


def _rk4_of(equations: Equations) -> Callable[..., tuple[list[float], Values]]:
    """The classical fourth-order method, which sees events between steps as MuJoCo's does.

    See `tiltsim.closed_loop.userdata.evaluation_time`, and `make_step`.
    """
    inputs, rates, rates_after = equations.inputs, equations.rates, _stage_of(equations)

    @scalar
    def rk4_step(
        time: float, state: list[float], held: Values, samples: bool, integration: Integration
    ) -> tuple[list[float], Values]:
        timestep, _, parameters, knots, disturbance = integration
        start, end = just_after(time), just_before(time + timestep)
        if samples:
            held = inputs(start, state, parameters, knots)
        k1 = rates(start, state, held, parameters, knots, disturbance)
        half = 0.5 * timestep
        k2, held = rates_after(time + half, state, half, k1, held, integration)
        k3, held = rates_after(time + half, state, half, k2, held, integration)
        k4, held = rates_after(end, state, timestep, k3, held, integration)
        return [
            value + timestep / 6.0 * (a + 2.0 * (b + c) + d)
            for value, a, b, c, d in zip(state, k1, k2, k3, k4)
        ], held

    return rk4_step


SOLVERS: Final = {"Euler": _euler_of, "ode3": _ode3_of, "RK4": _rk4_of}
"""By the name of ``simulation.integrator``."""


@cache
def make_step(equations: Equations, solver: str) -> Callable[..., tuple[list[float], Values]]:
    """One step of a loop's equations, as scalar code.

    Returns:
        ``(time, state, held, samples, integration) -> state, held``: one step of a solver of
        `SOLVERS`, from a time (s) on. ``held`` are the inputs since the last control sample;
        ``samples`` says whether this step begins with one.
    """
    one_step = SOLVERS[solver](equations)
    project_onto_limits = equations.project_onto_limits or identity

    @scalar
    def step(
        time: float, state: list[float], held: Values, samples: bool, integration: Integration
    ) -> tuple[list[float], Values]:
        state, held = one_step(time, state, held, samples, integration)
        return project_onto_limits(state, integration.parameters), held

    return step
