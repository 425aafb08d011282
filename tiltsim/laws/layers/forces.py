"""Layers that add forces: of the air, of given loads, of the rotors' spin inertia.

They act through six actuators on the body, force and torque in body axes, which only such models
have; MuJoCo's fluid forces are for boxes and ellipsoids in a constant wind. The filters of the
turbulence are activations, so a flight restarts anywhere.

Lag and limits decide how fast a rotor's speed changes, so the layer of spin inertia is the
outermost one of a vehicle that is moved by controls. It adds no state: the torques follow from
rotor speeds, their rates, tilts and body rates. On the thesis's equations with ideal actuators,
pods may jump, which turns the body at once. There the three states of the body rates hold the total
angular momentum instead, which does not jump.
"""

from dataclasses import replace
from functools import cache
from math import inf
from typing import Any, Final

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.scenario.surroundings import Force, Torque
from tiltsim.vehicles.rotorcraft import QW, TILT_1, TILT_RATE_1, layout_of, true_rotors
from tiltsim_controllers.code.arrays import branch, traceable, xp
from tiltsim_controllers.code.tracing import make
from tiltsim_controllers.mathematics.attitude import rotation_matrix, rotation_of_quaternion
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Vector
from tiltsim_controllers.vehicle.air import (
    DRYDEN_STATES,
    Air,
    Drag,
    GroundEffect,
    Gust,
    Turbulence,
    air_velocity,
    drag_force,
    dryden_rates,
    ground_effect,
    low_altitude_turbulence,
    stationary_states,
)
from tiltsim_controllers.vehicle.body import (
    BODY_STATES,
    Load,
    inertia_matrix,
    inverse_inertia_matrix,
    joined,
    rigid_state,
    wrench_of_loads,
)
from tiltsim_controllers.vehicle.craft import (
    Craft,
    accelerations_within_limits,
    craft_of,
    hinge_torques,
    places,
    spin_torque,
    thrust_axes,
    wrench_of_lift,
)

AIR_COLUMNS: Final = ("air_vx", "air_vy", "air_vz")
DRYDEN_FIELDS: Final = tuple(f"dryden_{index}" for index in range(1, DRYDEN_STATES + 1))


def air_wrench(
    time: Any, qpos: Any, qvel: Any, states: Any, thrusts: Any, air: Air, craft: Craft
) -> Any:
    """Force (N) and torque (N m) of the air, body axes, shape (6,): drag and ground effect.

    Args:
        time: s.
        qpos, qvel: MuJoCo's vectors.
        states: States of the turbulence's filters, shape (5,).
        thrusts: Controls of the thrust actuators, (rad/s)^2, shape (N,).
        air: The air.
        craft: The vehicle.
    """
    position, tilts = qpos[:3], qpos[TILT_1:]
    rotation = rotation_of_quaternion(qpos[QW:TILT_1])
    drag = drag_force(rotation.T @ (qvel[:3] - air_velocity(time, states, air)), air.drag)
    radius = air.ground.rotor_radius

    def lift() -> Any:
        # Each rotor by its own height; the drag torque about its axis stays (equal power).
        above = position[2] - air.ground.height + rotation[2] @ places(craft, tilts)
        gains = ground_effect(above, radius) - 1.0
        return wrench_of_lift(craft, tilts, craft.thrusts * thrusts * gains)

    return xp.hstack([drag, xp.zeros(3)]) + branch(radius > 0.0, lift, lambda: 0.0 * qvel[:6])


@cache
def with_air(loop: ClosedLoop) -> ClosedLoop:
    """A loop in air with wind, turbulence, gusts, drag and ground effect."""
    layout, first, rotors = layout_of(loop), loop.sizes.act, loop.tilt_of_rotor
    record = make_record_type("Surroundings", air=Air, vehicle=loop.vehicle_record)

    def forces(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, layer: Any) -> Any:
        states = act[first : first + DRYDEN_STATES]
        thrusts, craft = ctrl[layout.thrusts], craft_of(layer.vehicle, rotors)
        wrench = air_wrench(time, qpos, qvel, states, thrusts, layer.air, craft)
        return xp.hstack([dryden_rates(time, states, layer.air.turbulence), wrench])

    layer = Layer(
        record,
        lambda plan: record(_air(plan), true_rotors(plan.scenario)),
        adds=forces,
        actuators=ExtraActuators(states=DRYDEN_STATES, wrench=True),
        initial_activations=lambda _plan, air, _inner: stationary_states(air.air.turbulence),
        columns=lambda time, states, own: air_velocity(time, states, own.air),
        columns_from=DRYDEN_FIELDS,
        fields=dict.fromkeys(DRYDEN_FIELDS, "1/s^0.5"),
        units=dict.fromkeys(AIR_COLUMNS, "m/s"),
    )
    return wrap_loop(loop, layer)


def _air(plan: FlightPlan) -> Air:
    scenario = plan.scenario
    table = scenario.air
    turbulence = Turbulence()
    if table.turbulence is not None:
        (x, y, _), wind = table.wind, table.turbulence.wind_at_6m
        squares = x * x + y * y
        turbulence = low_altitude_turbulence(
            wind,
            table.turbulence.height,
            speed=xp.sqrt(xp.where(squares == 0.0, wind * wind, squares)),
            direction=make("atan2", y, x),
            sample_time=table.turbulence.sample_time,
            seed=float(scenario.simulation.seed),
        )
    gust, ground = Gust(), GroundEffect()
    if table.gust is not None:
        times = table.gust.start, table.gust.rise, table.gust.duration
        gust = Gust(*times, table.gust.velocity)
    if table.ground_effect is not None:
        ground = GroundEffect(table.ground_effect.rotor_radius, table.ground_effect.height)
    drag = Drag(table.drag.linear, table.drag.area, table.density)
    return Air(table.wind, drag, gust, turbulence, ground)


LOAD_COLUMNS: Final = tuple(f"load_{kind}_{axis}" for kind in ("force", "torque") for axis in "xyz")


@cache
def with_loads(loop: ClosedLoop, count: int) -> ClosedLoop:
    """A loop on whose vehicle a number of loads act."""
    record = make_record_type("Loads", **{f"load_{i + 1}": Load for i in range(count)})

    def forces(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, loads: Any) -> Any:
        return wrench_of_loads(time, rotation_of_quaternion(qpos[QW:TILT_1]), loads)

    layer = Layer(
        record,
        lambda plan: record(*map(_load, plan.scenario.loads)),
        adds=forces,
        actuators=ExtraActuators(wrench=True),
        columns=lambda time, attitude, own: wrench_of_loads(time, rotation_matrix(attitude), own),
        columns_from=("roll", "pitch", "yaw"),
        units={name: "N" if "force" in name else "N m" for name in LOAD_COLUMNS},
    )
    return wrap_loop(loop, layer)


def _load(table: Force | Torque) -> Load:
    end, in_body = table.end or inf, float(table.frame == "body")
    load = Load(table.start, end, in_body)
    if isinstance(table, Torque):
        return load._replace(torque=table.value)
    return load._replace(force=table.value, point=table.point)


@cache
def with_rotor_inertia(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose rotors have spin inertia."""
    layout, equations = layout_of(loop), loop.equations
    (rotors, tilts), tilted = layout, loop.tilt_of_rotor
    record = make_record_type(
        "SpinningRotors",
        inertia=float,  # kg m^2, of one rotor about its axis
        vehicle=loop.vehicle_record,  # the true one, not the controller's
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
    tilts, tilted, rotors = equations.tilts, loop.tilt_of_rotor, len(loop.spins)
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
        return with_spin(own, angles, setup.parameters.layer, 1.0)

    return replace(equations, inputs=inputs, rates=rates, observe=observe, initial=initial)
