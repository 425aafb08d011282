"""Any closed loop of a rotorcraft, with any layers, on equations of motion.

The controls are the same function of time, `qpos`, `qvel` and `act` as in MuJoCo, with the same
sensors, noise and latency. Only the plant on which they act differs: the thesis's vehicle
(`tiltsim.equations.actuator_level`) or a rigid body (`tiltsim.equations.actuator_level`).
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations
from tiltsim.equations.actuator_level import ActuatorPlant, limit_speeds_of, mechanics
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.models.parts import WRENCH_SIZE, ExtraActuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft.layout import layout_of
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.scalar import Vector


@cache
def read_actuators(loop: ClosedLoop) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Functions of a model's controls, except thrusts and servos.

    Returns:
        ``rates(ctrl)`` of the activations, in their order, and ``loads(ctrl)``: force and torque on
        the body, then torques about the hinges; see `ActuatorPlant.rates`.
    """
    layout = layout_of(loop)
    own = ExtraActuators(states=layout.rotors + loop.controller_states)
    first, wrenches, hinges = layout.acceleration_1, [], []
    states: list[slice] = []
    for this in (own, *loop.extra_actuators):
        states.append(slice(first, first + this.states))
        force = first + this.states + this.memories
        hinge = force + WRENCH_SIZE * this.wrench
        wrenches += [slice(force, hinge)] if this.wrench else []
        hinges += [slice(hinge, hinge + layout.tilts)] if this.hinge_torques else []
        first += this.controls

    def rates(ctrl: Any) -> Any:
        return xp.hstack([ctrl[part] for part in states])

    def loads(ctrl: Any) -> Any:
        wrench = sum((ctrl[part] for part in wrenches), np.zeros(WRENCH_SIZE))
        torques = sum((ctrl[part] for part in hinges), np.zeros(layout.tilts))
        return xp.hstack([wrench, torques])

    return rates, loads


def _projection(plant: ActuatorPlant, loop: ClosedLoop) -> Callable[..., Any]:
    """Function ``(state, mechanics) -> state`` with motion and speed commands within limits."""
    first = plant.motion + len(loop.spins) + loop.controller_states
    projections = [plant.project_onto_limits] if plant.project_onto_limits else []
    for this in loop.extra_actuators:
        if this.begins_with_rotor_speeds:
            projections += [limit_speeds_of(loop.spins, first)]
        first += this.states

    def project(state: Any, mechanics: Any) -> Any:
        for projection in projections:
            state = projection(state, mechanics)
        return state

    return project


@cache
def on_equations(loop: ClosedLoop, plant: ActuatorPlant) -> ClosedLoop:
    """A loop with equations in which its controls act on a plant.

    Their inputs are the controls, their state is the vehicle's motion followed by the activations.
    """
    first, qpos_of, qvel_of = plant.motion, plant.qpos, plant.qvel
    motion_rates, finish = plant.rates, plant.finish
    activation_rates, loads = read_actuators(loop)
    project_motion = _projection(plant, loop)

    @traceable
    def equation_inputs(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        return loop.controls(
            time, qpos_of(state), qvel_of(state), state[first:], parameters.inner, knots
        )

    def controls_in_force(time: Any, state: Any, inputs: Any, parameters: Any) -> Any:
        return loop.hold(
            time, qpos_of(state), qvel_of(state), state[first:], inputs, parameters.inner
        )

    @traceable
    def equation_rates(
        time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        # A stage may pass a rotor's limit by up to one step.
        state = project_motion(state, parameters.layer)
        ctrl = controls_in_force(time, state, inputs, parameters)
        moved = motion_rates(state, ctrl, loads(ctrl), parameters.layer, disturbance)
        return xp.hstack([moved, activation_rates(ctrl)])

    @traceable
    def observe_equations(time: Any, state: Any, inputs: Any, parameters: Any, knots: Any) -> Any:
        ctrl = controls_in_force(time, state, inputs, parameters)
        return loop.observe(qpos_of(state), qvel_of(state), state[first:], ctrl)

    @traceable
    def project_onto_limits(state: Any, parameters: Any) -> Any:
        if finish is not None:
            state = finish(state, parameters.layer)
        return project_motion(state, parameters.layer)

    def initial(plan: FlightPlan, setup: ControlSetup) -> Vector:
        inner = ControlSetup(setup.parameters.inner, setup.knots)
        return (*plant.initial(plan), *loop.initial_activations(plan, inner))

    equations = Equations(
        inputs=equation_inputs,
        inputs_size=loop.sizes.ctrl,
        rates=equation_rates,
        initial=initial,
        observe=observe_equations,
        project_onto_limits=project_onto_limits,
        states=plant.names,
    )
    return wrap_loop(loop, Layer(plant.mechanics, mechanics, equations=equations))
