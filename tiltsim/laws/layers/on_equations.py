"""Any loop around a rotorcraft, whatever its layers, on the thesis's equations.

The loop stays what it is in MuJoCo, a function from time, `qpos`, `qvel` and `act` to controls, and
so does the order in which it reads its sensors, draws its noise and hands on its commands. Only
what the controls act upon is another: `tiltsim.equations.driven`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations
from tiltsim.equations.driven import ACTUATOR_PLANTS, Mechanics, Wrench, mechanics
from tiltsim.laws.layers.layer import around
from tiltsim.models.parts import ExtraActuators
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan

ROTORS = 4


@cache
def _read_actuators(
    actuators: tuple[ExtraActuators, ...], first: int
) -> tuple[Callable[..., Values], Callable[..., Wrench]]:
    """Scalar code that reads what actuators do, from the controls of which theirs begin at one.

    Returns ``rates(ctrl)``, those of the activations in their order, and ``wrench(ctrl)``.
    """
    if not actuators:

        @scalar
        def no_rates(ctrl: Vector) -> Values:
            return ()

        @scalar
        def no_wrench(ctrl: Vector) -> Wrench:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0

        return no_rates, no_wrench

    this = actuators[0]
    memories = first + this.states
    force = memories + this.memories
    end = force + 6 * this.wrench
    further_rates, further_wrench = _read_actuators(actuators[1:], end)

    @scalar
    def rates(ctrl: Vector) -> Values:
        return (*ctrl[first:memories], *further_rates(ctrl))

    if not this.wrench:
        return rates, further_wrench

    @scalar
    def wrench(ctrl: Vector) -> Wrench:
        fx, fy, fz, tx, ty, tz = further_wrench(ctrl)
        return (
            *(fx + ctrl[force], fy + ctrl[force + 1], fz + ctrl[force + 2]),
            *(tx + ctrl[force + 3], ty + ctrl[force + 4], tz + ctrl[force + 5]),
        )

    return rates, wrench


@cache
def on_equations(loop: ClosedLoop) -> ClosedLoop:
    """A loop with equations that do what its controls say.

    Their inputs are the controls, their state is the vehicle's motion followed by the activations.
    """
    driven = ACTUATOR_PLANTS[loop.model]
    first, qpos_of, qvel_of = driven.motion, driven.qpos, driven.qvel
    motion_rates, motion_settled = driven.rates, driven.settled
    controls, held, observe = loop.controls, loop.held, loop.observe
    own = ExtraActuators(states=ROTORS + loop.law_states)
    activation_rates, wrench = _read_actuators((own, *loop.extra_actuators), driven.rotor_states)

    @scalar
    def equation_inputs(time: float, state: Vector, parameters: Any, knots: Vector) -> Values:
        return controls(time, qpos_of(state), qvel_of(state), state[first:], parameters.law, knots)

    @scalar
    def controls_in_force(time: float, state: Vector, inputs: Vector, parameters: Any) -> Values:
        return held(time, qpos_of(state), qvel_of(state), state[first:], inputs, parameters.law)

    @scalar
    def equation_rates(
        time: float,
        state: list[float],
        inputs: Vector,
        parameters: Any,
        knots: Vector,
        disturbance: Triple,
    ) -> Values:
        # A stage may have carried a rotor past its limit by what one step adds.
        state = motion_settled(state, parameters.layer)
        ctrl = controls_in_force(time, state, inputs, parameters)
        return (
            *motion_rates(state, ctrl, wrench(ctrl), parameters.layer, disturbance),
            *activation_rates(ctrl),
        )

    @scalar
    def observe_equations(
        time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector
    ) -> Values:
        ctrl = controls_in_force(time, state, inputs, parameters)
        return observe(qpos_of(state), qvel_of(state), state[first:], ctrl)

    @scalar
    def settled(state: list[float], parameters: Any) -> list[float]:
        return motion_settled(state, parameters.layer)

    equation_inputs.__qualname__ = f"on_equations.{loop.controls.__qualname__}"
    layered = around(loop, Mechanics, mechanics)

    def initial(plan: FlightPlan, setup: ControlSetup) -> Vector:
        return (*driven.initial(plan), *layered.initial_activations(plan, setup))

    return replace(
        layered,
        equations=Equations(
            inputs=equation_inputs,
            inputs_size=loop.sizes.ctrl,
            rates=equation_rates,
            initial=initial,
            observe=observe_equations,
            settled=settled,
        ),
    )
