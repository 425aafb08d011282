"""Fixed-step solvers for the equations of any closed loop: the thesis's ode3, RK4 and Euler.

One controller runs here and in MuJoCo: the difference between the plants is a result.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

from tiltsim.closed_loop.loop import Equations
from tiltsim.closed_loop.userdata import just_after, just_before
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.scalar import Triple


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
    """An explicit method, each stage of which begins at the rates of the one before.

    Attributes:
        nodes: Times of the stages after the first, in time steps.
        combined: ``(state, timestep, rates of the stages) -> state`` at the end of a step.
        sees_events: Whether the first stage is just after the beginning of a step and the last just
            before its end, as in MuJoCo; see `tiltsim.closed_loop.userdata.evaluation_time`.
    """

    nodes: tuple[float, ...]
    combined: Callable[..., Any]
    sees_events: bool = False


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
