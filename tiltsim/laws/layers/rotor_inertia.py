"""Rotors with spin inertia: reaction to their acceleration, and their gyroscopic torque.

Lag and limits decide how fast a rotor's speed changes, so this is the outermost layer of a vehicle
that is moved by controls. It adds no state: the torques follow from rotor speeds, their rates,
tilts and body rates.

On the thesis's equations with ideal actuators, pods may jump, which turns the body at once. There
the three states of the body rates hold the total angular momentum instead, which does not jump.
"""

from dataclasses import replace
from functools import cache
from typing import Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft.layout import TILT_1, TILT_RATE_1, layout_of, tilt_of_rotor
from tiltsim.vehicles.rotorcraft.rotors import rotors_record, true_rotors
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Vector
from tiltsim_controllers.vehicle.body import inertia_matrix, inverse_inertia_matrix
from tiltsim_controllers.vehicle.craft import craft_of, thrust_axes
from tiltsim_controllers.vehicle.motion import BODY_STATES, joined, rigid_state
from tiltsim_controllers.vehicle.rotor_inertia import (
    accelerations_within_limits,
    hinge_torques,
    spin_torque,
)


@cache
def with_rotor_inertia(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose rotors have spin inertia."""
    layout, equations = layout_of(loop), loop.equations
    (rotors, tilts), tilted = layout, tilt_of_rotor(loop)
    record = make_record_type(
        "SpinningRotors",
        inertia=float,  # kg m^2, of one rotor about its axis
        vehicle=rotors_record(loop),  # the true one, not the controller's
        slowest=float,  # rad/s, of a rotor along its spin
        fastest=float,
    )

    def read(plan: FlightPlan) -> Any:
        vehicle = plan.scenario.any_rotorcraft
        own = vehicle.rotor_inertia, true_rotors(plan.scenario)
        return record(*own, *vehicle.speeds_along_spin)

    def loads(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, layer: Any) -> Any:
        """The wrench on the body (N, N m, body axes) and torques on the hinges (N m)."""
        craft, speeds, omega = craft_of(layer.vehicle, tilted), act[:rotors], qvel[3:6]
        angles, rates = qpos[TILT_1:], qvel[TILT_RATE_1 : TILT_RATE_1 + tilts]
        demanded = ctrl[layout.accelerations]
        accelerations = accelerations_within_limits(
            xp.array(loop.spins), speeds, demanded, layer.slowest, layer.fastest
        )
        torque = spin_torque(craft, angles, rates, speeds, accelerations, omega)
        hinges = hinge_torques(craft, angles, speeds, accelerations, omega)
        return xp.hstack([xp.zeros(3), layer.inertia * torque, layer.inertia * hinges])

    layer = Layer(
        record,
        read,
        adds=loads,
        actuators=ExtraActuators(wrench=True, hinge_torques=tilts),
        equations=None if equations is None else _momentum_equations(equations, loop),
    )
    return wrap_loop(loop, layer)


# --- ideal actuators on the thesis's equations -------------------------------------------------


def _momentum_equations(equations: Equations, loop: ClosedLoop) -> Equations:
    """Equations of a vehicle whose rotors have spin inertia, and whose pods may jump.

    At their body rates the body alone would have the total angular momentum.
    """
    inner_inputs, inner_rates, inner_observe = equations.inputs, equations.rates, equations.observe
    tilts, tilted, rotors = equations.tilts, tilt_of_rotor(loop), len(loop.spins)
    assert tilts is not None  # other vehicles are refused

    @traceable
    def with_spin(state: Any, angles: Any, layer: Any, sign: float) -> Any:
        """A state with ``sign`` times the body rates that the rotors' momentum gave the body."""
        craft, speeds = craft_of(layer.vehicle, tilted), state[BODY_STATES : BODY_STATES + rotors]
        momentum = layer.inertia * (thrust_axes(craft, angles) @ speeds)
        body = rigid_state(state)
        spin = inverse_inertia_matrix(craft.body) @ momentum
        return joined((*body._replace(omega=body.omega + sign * spin), state[BODY_STATES:]))

    def turning_along(moving: Any, state: Any, own: Any, layer: Any) -> Any:
        """The rotors' momentum turns with the body: ``-omega x sum_i J_r varpi_i d_i``."""
        rates, omega = rigid_state(moving), rigid_state(own).omega
        body = craft_of(layer.vehicle, tilted).body
        momentum = inertia_matrix(body) @ (rigid_state(state).omega - omega)
        lost = inverse_inertia_matrix(body) @ cross(omega, momentum)
        return joined((*rates._replace(omega=rates.omega - lost), moving[BODY_STATES:]))

    def body_state(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        angles = tilts(time, state, parameters.inner, knots)
        return with_spin(state, angles, parameters.layer, -1.0)

    @traceable
    def inputs(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        own = body_state(time, state, parameters, knots)
        return inner_inputs(time, own, parameters.inner, knots)

    @traceable
    def rates(
        time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        own = body_state(time, state, parameters, knots)
        moving = inner_rates(time, own, inputs, parameters.inner, knots, disturbance)
        return turning_along(moving, state, own, parameters.layer)

    @traceable
    def observe(time: Any, state: Any, inputs: Any, parameters: Any, knots: Any) -> Any:
        own = body_state(time, state, parameters, knots)
        return inner_observe(time, own, inputs, parameters.inner, knots)

    def initial(plan: FlightPlan, setup: ControlSetup) -> Vector:
        inner = ControlSetup(setup.parameters.inner, setup.knots)
        own = (*equations.initial(plan, inner),)
        angles = tilts(0.0, own, inner.parameters, inner.knots)
        start: Vector = with_spin(own, angles, setup.parameters.layer, 1.0)
        return start

    return replace(equations, inputs=inputs, rates=rates, observe=observe, initial=initial)
