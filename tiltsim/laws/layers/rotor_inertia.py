"""Rotors with spin inertia: reaction to their acceleration, and their gyroscopic torque.

Lag and limits decide how fast a rotor's speed changes, so this is the outermost layer of a vehicle
that is moved by controls. It adds no state: the torques follow from rotor speeds, their rates,
tilts and body rates.

On the thesis's equations with ideal actuators, pods may jump, which turns the body at once. There
the three states of the body rates hold the total angular momentum instead, which does not jump.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Dynamics, Equations
from tiltsim.equations.tiltrotor import SPEED_1, P, Q, R
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.vehicles.rotorcraft.layout import TILT_1, TILT_RATE_1, layout_of
from tiltsim.vehicles.rotorcraft.rotors import rotor_code, true_rotors
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
from tiltsim_controllers.vehicle.rigid_body import cross
from tiltsim_controllers.vehicle.rotor_inertia import accelerations_within_limits_of, spin_torque_of

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


@cache
def _loads_of(dynamics: Dynamics) -> Callable[..., Values]:
    """Scalar code of the wrench on the body (N, N m, body axes) and torques on the hinges (N m).

    It is ``(qpos, qvel, act, ctrl, layer) -> loads``.
    """
    code, layout = rotor_code(dynamics), layout_of(dynamics)
    rotors, tilts = layout
    axes_of, on_hinges, spin_torque = code.axes, code.on_hinges, spin_torque_of(code)
    tilts_in, rates_in = entries_of(TILT_1, tilts), entries_of(TILT_RATE_1, tilts)
    speeds_in, demanded_in = entries_of(0, rotors), entries_of(layout.acceleration_1, rotors)
    within_limits = accelerations_within_limits_of(dynamics.spins)
    scaled = componentwise("scaled_torques", "inertia, torques", "inertia * torques#", tilts)

    @scalar
    def loads(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, layer: Any) -> Values:
        inertia, speeds, omega = layer.inertia, speeds_in(act), (qvel[3], qvel[4], qvel[5])
        accelerations = within_limits(speeds, demanded_in(ctrl), layer.slowest, layer.fastest)
        axes = axes_of(tilts_in(qpos), layer.vehicle)
        x, y, z = spin_torque(axes, rates_in(qvel), speeds, accelerations, omega)
        hinges = scaled(inertia, on_hinges(axes, speeds, accelerations, omega))
        return (0.0, 0.0, 0.0, inertia * x, inertia * y, inertia * z, *hinges)

    return loads


@cache
def with_rotor_inertia(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose rotors have spin inertia."""
    inner_controls, inner_hold = loop.sampling.controls, loop.sampling.hold
    dynamics, equations = loop.dynamics, loop.equations
    inner_ctrl, code, loads = dynamics.sizes.ctrl, rotor_code(dynamics), _loads_of(dynamics)
    record = make_record_type(
        "SpinningRotors",
        inertia=float,  # kg m^2, of one rotor about its axis
        vehicle=code.record,  # the true one, not the controller's
        slowest=float,  # rad/s, of a rotor along its spin
        fastest=float,
    )

    def read(plan: FlightPlan) -> Any:
        vehicle = plan.scenario.any_rotorcraft
        own = vehicle.rotor_inertia, true_rotors(plan.scenario)
        return record(*own, *vehicle.speeds_along_spin)

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        inner = inner_controls(time, qpos, qvel, act, parameters.inner, knots)
        return (*inner, *loads(qpos, qvel, act, inner, parameters.layer))

    @scalar
    def hold(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: Any
    ) -> Values:
        inner = inner_hold(time, qpos, qvel, act, ctrl[:inner_ctrl], parameters.inner)
        return (*inner, *loads(qpos, qvel, act, inner, parameters.layer))

    layer = Layer(
        "with_rotor_inertia",
        record,
        read,
        controls=controls,
        hold=hold,
        actuators=ExtraActuators(wrench=True, hinge_torques=layout_of(dynamics).tilts),
        equations=None if equations is None else _momentum_equations(equations, dynamics),
    )
    return wrap_loop(loop, layer)


# --- ideal actuators on the thesis's equations -------------------------------------------------


@scalar
def _with_body_rates_ahead(state: list[float], by: Triple, sign: float) -> list[float]:
    """The state with ``sign`` times the spin rates ``by`` (rad/s) added to its body rates."""
    shifted = state[:]
    shifted[P] = state[P] + sign * by[0]
    shifted[Q] = state[Q] + sign * by[1]
    shifted[R] = state[R] + sign * by[2]
    return shifted


def _momentum_equations(equations: Equations, dynamics: Dynamics) -> Equations:
    """Equations of a vehicle whose rotors have spin inertia, and whose pods may jump.

    Their body rates are those at which the body alone had the total angular momentum.
    """
    inner_inputs, inner_rates, inner_observe = equations.inputs, equations.rates, equations.observe
    tilts, code = equations.tilts, rotor_code(dynamics)
    assert tilts is not None  # other vehicles are refused
    axes_of, along, inertia_times, inverse = code.axes, code.along, code.inertia, code.inverse
    speeds_in = entries_of(SPEED_1, len(dynamics.spins))

    @scalar
    def spin_rates(angles: Values, speeds: Values, layer: Any) -> Triple:
        """The body rates (rad/s) at which the body had the momentum of the rotors' spin."""
        x, y, z = along(axes_of(angles, layer.vehicle), speeds)
        inertia = layer.inertia
        return inverse((inertia * x, inertia * y, inertia * z), layer.vehicle)

    @scalar
    def body_state(time: float, state: list[float], parameters: Any, knots: Vector) -> list[float]:
        angles = tilts(time, state, parameters.inner, knots)
        spin = spin_rates(angles, speeds_in(state), parameters.layer)
        return _with_body_rates_ahead(state, spin, -1.0)

    @scalar
    def inputs(time: float, state: list[float], parameters: Any, knots: Vector) -> Values:
        own = body_state(time, state, parameters, knots)
        return inner_inputs(time, own, parameters.inner, knots)

    @scalar
    def rates(
        time: float,
        state: list[float],
        inputs: Vector,
        parameters: Any,
        knots: Vector,
        disturbance: Triple,
    ) -> Values:
        own = body_state(time, state, parameters, knots)
        moving = inner_rates(time, own, inputs, parameters.inner, knots, disturbance)
        # The rotors' momentum turns with the body: -omega x sum_i J_r varpi_i d_i.
        vehicle = parameters.layer.vehicle
        ahead = (state[P] - own[P], state[Q] - own[Q], state[R] - own[R])
        carried = cross((own[P], own[Q], own[R]), inertia_times(ahead, vehicle))
        p_rate, q_rate, r_rate = inverse(carried, vehicle)
        return (
            *moving[:P],
            moving[P] - p_rate,
            moving[Q] - q_rate,
            moving[R] - r_rate,
            *moving[SPEED_1:],
        )

    @scalar
    def observe(
        time: float, state: list[float], inputs: Vector, parameters: Any, knots: Vector
    ) -> Values:
        own = body_state(time, state, parameters, knots)
        return inner_observe(time, own, inputs, parameters.inner, knots)

    def initial(plan: FlightPlan, setup: ControlSetup) -> Vector:
        inner = ControlSetup(setup.parameters.inner, setup.knots)
        own = [*equations.initial(plan, inner)]
        angles = tilts(0.0, own, inner.parameters, inner.knots)
        spin = spin_rates(angles, speeds_in(own), setup.parameters.layer)
        return _with_body_rates_ahead(own, spin, 1.0)

    return replace(equations, inputs=inputs, rates=rates, observe=observe, initial=initial)
