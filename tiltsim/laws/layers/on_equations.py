"""Any closed loop of a rotorcraft, with any layers, on the thesis's equations.

The controls are the same function of time, `qpos`, `qvel` and `act` as in MuJoCo, with the same
sensors, noise and latency. Only the plant on which they act differs:
`tiltsim.equations.actuator_level`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Dynamics, Equations
from tiltsim.equations.actuator_level import (
    ACTUATOR_PLANTS,
    Loads,
    Mechanics,
    limit_speeds,
    mechanics,
)
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.models.parts import WRENCH_SIZE, ExtraActuators
from tiltsim.vehicles.rotorcraft.layout import ROTOR_STATES
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


def read_actuators(dynamics: Dynamics) -> tuple[Callable[..., Values], Callable[..., Loads]]:
    """Scalar code that reads what a model's controls do besides thrusts and servos.

    Returns ``rates(ctrl)`` of the activations, in their order, and ``loads(ctrl)``.
    """
    own = ExtraActuators(states=ROTOR_STATES + dynamics.controller_states)
    first = ACTUATOR_PLANTS[dynamics.model].rotor_states
    return _read_actuators((own, *dynamics.extra_actuators), first)


@cache
def _read_actuators(
    actuators: tuple[ExtraActuators, ...], first: int
) -> tuple[Callable[..., Values], Callable[..., Loads]]:
    """`read_actuators` of these, whose controls begin at an index."""
    if not actuators:

        @scalar
        def no_rates(ctrl: Vector) -> Values:
            return ()

        @scalar
        def no_loads(ctrl: Vector) -> Loads:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0

        return no_rates, no_loads

    this = actuators[0]
    memories = first + this.states
    force = memories + this.memories
    hinge = force + WRENCH_SIZE * this.wrench
    further_rates, further_loads = _read_actuators(actuators[1:], first + this.controls)
    wrench, on_hinges = this.wrench, this.hinge_torques

    @scalar
    def rates(ctrl: Vector) -> Values:
        return (*ctrl[first:memories], *further_rates(ctrl))

    if not (wrench or on_hinges):
        return rates, further_loads

    @scalar
    def loads(ctrl: Vector) -> Loads:
        fx, fy, fz, tx, ty, tz, t1, t2, t3, t4 = further_loads(ctrl)
        if wrench:
            fx, fy, fz = fx + ctrl[force], fy + ctrl[force + 1], fz + ctrl[force + 2]
            tx, ty, tz = tx + ctrl[force + 3], ty + ctrl[force + 4], tz + ctrl[force + 5]
        if on_hinges:
            t1, t2 = t1 + ctrl[hinge], t2 + ctrl[hinge + 1]
            t3, t4 = t3 + ctrl[hinge + 2], t4 + ctrl[hinge + 3]
        return fx, fy, fz, tx, ty, tz, t1, t2, t3, t4

    return rates, loads


def _projection(
    project_motion: Callable[..., list[float]], first: int, actuators: tuple[ExtraActuators, ...]
) -> Callable[..., list[float]]:
    """A projection of the motion and of commanded rotor speeds onto their limits.

    The states of the actuators begin at ``first``. In scalar code, ``(state, mechanics) -> state``.
    """
    for this in actuators:
        if this.begins_with_rotor_speeds:
            break
        first += this.states
    else:
        return project_motion

    @scalar
    def project(state: list[float], mechanics: Mechanics) -> list[float]:
        return limit_speeds(project_motion(state, mechanics), first, mechanics)

    return project


@cache
def on_equations(loop: ClosedLoop) -> ClosedLoop:
    """A loop with equations in which its controls act on the thesis's rigid body.

    Their inputs are the controls, their state is the vehicle's motion followed by the activations.
    """
    dynamics = loop.dynamics
    plant = ACTUATOR_PLANTS[dynamics.model]
    first, qpos_of, qvel_of = plant.motion, plant.qpos, plant.qvel
    motion_rates = plant.rates
    controls, held = loop.sampling.controls, loop.sampling.hold
    observe = loop.columns.observe
    activation_rates, loads = read_actuators(dynamics)
    further = first + ROTOR_STATES + dynamics.controller_states
    project_motion = _projection(plant.project_onto_limits, further, dynamics.extra_actuators)

    @scalar
    def equation_inputs(time: float, state: Vector, parameters: Any, knots: Vector) -> Values:
        return controls(
            time, qpos_of(state), qvel_of(state), state[first:], parameters.inner, knots
        )

    @scalar
    def controls_in_force(time: float, state: Vector, inputs: Vector, parameters: Any) -> Values:
        return held(time, qpos_of(state), qvel_of(state), state[first:], inputs, parameters.inner)

    @scalar
    def equation_rates(
        time: float,
        state: list[float],
        inputs: Vector,
        parameters: Any,
        knots: Vector,
        disturbance: Triple,
    ) -> Values:
        # A stage may pass a rotor's limit by up to one step.
        state = project_motion(state, parameters.layer)
        ctrl = controls_in_force(time, state, inputs, parameters)
        return (
            *motion_rates(state, ctrl, loads(ctrl), parameters.layer, disturbance),
            *activation_rates(ctrl),
        )

    @scalar
    def observe_equations(
        time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector
    ) -> Values:
        ctrl = controls_in_force(time, state, inputs, parameters)
        return observe(qpos_of(state), qvel_of(state), state[first:], ctrl)

    @scalar
    def project_onto_limits(state: list[float], parameters: Any) -> list[float]:
        return project_motion(state, parameters.layer)

    def initial(plan: FlightPlan, setup: ControlSetup) -> Vector:
        inner = ControlSetup(setup.parameters.inner, setup.knots)
        return (*plant.initial(plan), *dynamics.initial_activations(plan, inner))

    equation_inputs.__qualname__ = f"on_equations.{controls.__qualname__}"
    equations = Equations(
        inputs=equation_inputs,
        inputs_size=dynamics.sizes.ctrl,
        rates=equation_rates,
        initial=initial,
        observe=observe_equations,
        project_onto_limits=project_onto_limits,
    )
    return wrap_loop(loop, Layer("on_equations", Mechanics, mechanics, equations=equations))
