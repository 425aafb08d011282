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
from typing import TYPE_CHECKING, Any, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations
from tiltsim.equations.tiltrotor import SPEED_1, P, Q, R
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.laws.tiltrotor import four
from tiltsim.models.parts import ExtraActuators
from tiltsim.vehicles.rotorcraft.layout import (
    QUADROTOR_THRUSTS,
    ROTOR_STATES,
    TILT_1,
    TILT_RATE_1,
    TILTROTOR_THRUSTS,
)
from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import sines_and_cosines, trigonometric_rates
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rigid_body import cross
from tiltsim_controllers.vehicle.rotor_inertia import (
    acceleration_within_limits,
    spin_torque,
    spin_torques_on_hinges,
    sum_along_thrust_axes,
)

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


class SpinningRotors(NamedTuple):
    """The parameters of the layer."""

    inertia: float  # kg m^2, of one rotor about its axis
    vehicle: Vehicle  # the true one, not the controller's
    slowest: float  # rad/s, of a rotor along its spin
    fastest: float


@scalar
def _accelerations(speeds: Quad, demanded: Quad, rotors: SpinningRotors) -> Quad:
    """Rates (rad/s^2) of the rotor speeds: the demanded ones, except beyond a limit."""
    low, high = rotors.slowest, rotors.fastest
    return (
        -acceleration_within_limits(-speeds[0], -demanded[0], low, high),
        acceleration_within_limits(speeds[1], demanded[1], low, high),
        -acceleration_within_limits(-speeds[2], -demanded[2], low, high),
        acceleration_within_limits(speeds[3], demanded[3], low, high),
    )


@scalar
def _wrench(
    trig: Octet, turning: Octet, qvel: Vector, act: Vector, demanded: Quad, rotors: SpinningRotors
) -> Values:
    """Force (none) and torque (N m) on the body, body axes.

    Args:
        trig, turning: `sines_and_cosines` of the tilts, and their rates, 1/s.
        qvel, act: MuJoCo's state.
        demanded: Rotor accelerations, rad/s^2.
        rotors: The parameters of the layer.
    """
    speeds, inertia = four(act, 0), rotors.inertia
    accelerations = _accelerations(speeds, demanded, rotors)
    x, y, z = spin_torque(trig, turning, speeds, accelerations, (qvel[3], qvel[4], qvel[5]))
    return 0.0, 0.0, 0.0, inertia * x, inertia * y, inertia * z


@scalar
def _tiltrotor_loads(
    qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, rotors: SpinningRotors
) -> Values:
    """Wrench on the body, and torques (N m) on the four hinges."""
    trig = sines_and_cosines(qpos[TILT_1], qpos[TILT_1 + 1], qpos[TILT_1 + 2], qpos[TILT_1 + 3])
    turning = trigonometric_rates(trig, four(qvel, TILT_RATE_1))
    h1, h2, h3, h4 = spin_torques_on_hinges(trig, four(act, 0), (qvel[3], qvel[4], qvel[5]))
    demanded, inertia = four(ctrl, TILTROTOR_THRUSTS + ROTOR_STATES), rotors.inertia
    wrench = _wrench(trig, turning, qvel, act, demanded, rotors)
    return (*wrench, inertia * h1, inertia * h2, inertia * h3, inertia * h4)


@scalar
def _quadrotor_loads(
    qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, rotors: SpinningRotors
) -> Values:
    """Wrench on the body."""
    upright = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
    at_rest = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    demanded = four(ctrl, QUADROTOR_THRUSTS + ROTOR_STATES)
    return _wrench(upright, at_rest, qvel, act, demanded, rotors)


@cache
def with_rotor_inertia(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose rotors have spin inertia."""
    inner_controls, inner_hold = loop.sampling.controls, loop.sampling.hold
    inner_ctrl = loop.dynamics.sizes.ctrl
    tilting = loop.dynamics.model == "tiltrotor"
    loads: Callable[..., Values] = _tiltrotor_loads if tilting else _quadrotor_loads

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
        SpinningRotors,
        _spinning_rotors,
        controls=controls,
        hold=hold,
        actuators=ExtraActuators(wrench=True, hinge_torques=tilting),
        equations=None if loop.equations is None else _momentum_equations(loop.equations),
    )
    return wrap_loop(loop, layer)


# --- ideal actuators on the thesis's equations -------------------------------------------------


@scalar
def _spin_rates(tilts: Quad, speeds: Quad, rotors: SpinningRotors) -> Triple:
    """The body rates (rad/s) at which the body had the momentum of the rotors' spin."""
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    x, y, z = sum_along_thrust_axes(trig, speeds)
    inertia, vehicle = rotors.inertia, rotors.vehicle
    return (
        inertia * x / vehicle.inertia_xx,
        inertia * y / vehicle.inertia_yy,
        inertia * z / vehicle.inertia_zz,
    )


@scalar
def _with_body_rates_ahead(state: list[float], by: Triple, sign: float) -> list[float]:
    """The state with ``sign`` times the spin rates ``by`` (rad/s) added to its body rates."""
    shifted = state[:]
    shifted[P] = state[P] + sign * by[0]
    shifted[Q] = state[Q] + sign * by[1]
    shifted[R] = state[R] + sign * by[2]
    return shifted


def _momentum_equations(equations: Equations) -> Equations:
    """Equations of a tiltrotor whose rotors have spin inertia, and whose pods may jump.

    Their body rates are those at which the body alone had the total angular momentum.
    """
    inner_inputs, inner_rates, inner_observe = equations.inputs, equations.rates, equations.observe
    tilts = equations.tilts
    assert tilts is not None  # other vehicles are refused

    @scalar
    def body_state(time: float, state: list[float], parameters: Any, knots: Vector) -> list[float]:
        angles = tilts(time, state, parameters.inner, knots)
        spin = _spin_rates(angles, four(state, SPEED_1), parameters.layer)
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
        x = vehicle.inertia_xx * (state[P] - own[P])
        y = vehicle.inertia_yy * (state[Q] - own[Q])
        z = vehicle.inertia_zz * (state[R] - own[R])
        carried = cross((own[P], own[Q], own[R]), (x, y, z))
        return (
            *moving[:P],
            moving[P] - carried[0] / vehicle.inertia_xx,
            moving[Q] - carried[1] / vehicle.inertia_yy,
            moving[R] - carried[2] / vehicle.inertia_zz,
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
        spin = _spin_rates(angles, four(own, SPEED_1), setup.parameters.layer)
        return _with_body_rates_ahead(own, spin, 1.0)

    law = f"{inner_inputs.__module__}.{inner_inputs.__qualname__}"
    inputs.__qualname__ = f"with_rotor_inertia.{law}"
    return replace(equations, inputs=inputs, rates=rates, observe=observe, initial=initial)


def _spinning_rotors(plan: FlightPlan) -> SpinningRotors:
    scenario = plan.scenario
    rotorcraft, vehicle = scenario.rotorcraft, scenario.true_rotorcraft
    return SpinningRotors(rotorcraft.rotor_inertia, vehicle, *rotorcraft.speeds_along_spin)
