"""The air around any rotorcraft: a layer that adds its forces.

MuJoCo's fluid forces are those of boxes and ellipsoids in a constant wind. These act through six
actuators on the body instead, force and torque in body axes, which only models with air have. The
filters of the turbulence are activations, so a flight restarts anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import atan2, hypot
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.laws.tiltrotor import four
from tiltsim.models.parts import ExtraActuators
from tiltsim.vehicles.rotorcraft.layout import (
    QUADROTOR_THRUSTS,
    QW,
    QX,
    QY,
    QZ,
    TILT_1,
    TILTROTOR_THRUSTS,
)
from tiltsim_controllers.mathematics.rotation import rotation_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Values, Vector, scalar
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
from tiltsim_controllers.vehicle.decoupling_matrix import sines_and_cosines
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

AIR_COLUMNS: Final = ("air_vx", "air_vy", "air_vz")
DRYDEN_FIELDS: Final = tuple(f"dryden_{index}" for index in range(1, DRYDEN_STATES + 1))


class Surroundings(NamedTuple):
    """The parameters of the layer."""

    air: Air
    vehicle: Vehicle


@scalar
def pod_tilts(qpos: Vector) -> Quad:
    """Tilt angles of the tiltrotor."""
    return four(qpos, TILT_1)


@scalar
def no_tilts(qpos: Vector) -> Quad:
    """Tilt angles of a vehicle whose rotors do not tilt."""
    return 0.0, 0.0, 0.0, 0.0


@scalar
def air_wrench(
    time: float,
    qpos: Vector,
    qvel: Vector,
    states: Values,
    tilts: Quad,
    thrusts: Quad,
    surroundings: Surroundings,
) -> Values:
    """Force (N) and torque (N m) of the air, body axes: drag and ground effect.

    Args:
        time: s.
        qpos, qvel: MuJoCo's.
        states: Of the turbulence's filters.
        tilts: rad.
        thrusts: Controls of the thrust actuators, (rad/s)^2.
        surroundings: The parameters of the layer.
    """
    air, vehicle = surroundings.air, surroundings.vehicle
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_quaternion(
        qpos[QW], qpos[QX], qpos[QY], qpos[QZ]
    )
    ax, ay, az = air_velocity(time, states, air)
    vx, vy, vz = qvel[0] - ax, qvel[1] - ay, qvel[2] - az
    through = (
        r11 * vx + r21 * vy + r31 * vz,
        r12 * vx + r22 * vy + r32 * vz,
        r13 * vx + r23 * vy + r33 * vz,
    )
    fx, fy, fz = drag_force(through, air.drag)
    radius = air.ground.rotor_radius
    if radius == 0.0:
        return fx, fy, fz, 0.0, 0.0, 0.0

    # Each rotor by its own height; the drag torque about its axis stays (equal power).
    arm, per_thrust = vehicle.arm_length, vehicle.thrust_coefficient
    above = qpos[2] - air.ground.height
    t1 = per_thrust * thrusts[0] * (ground_effect(above + arm * r31, radius) - 1.0)
    t2 = per_thrust * thrusts[1] * (ground_effect(above + arm * r32, radius) - 1.0)
    t3 = per_thrust * thrusts[2] * (ground_effect(above - arm * r31, radius) - 1.0)
    t4 = per_thrust * thrusts[3] * (ground_effect(above - arm * r32, radius) - 1.0)
    s1, c1, s2, c2, s3, c3, s4, c4 = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    return (
        fx + t2 * s2 - t4 * s4,
        fy - t1 * s1 + t3 * s3,
        fz + t1 * c1 + t2 * c2 + t3 * c3 + t4 * c4,
        arm * (t2 * c2 - t4 * c4),
        arm * (t3 * c3 - t1 * c1),
        -arm * (t1 * s1 + t2 * s2 + t3 * s3 + t4 * s4),
    )


@cache
def with_air(loop: ClosedLoop) -> ClosedLoop:
    """A loop in air with wind, turbulence, gusts, drag and ground effect."""
    inner_controls, inner_hold = loop.sampling.controls, loop.sampling.hold
    first, inner_ctrl = loop.dynamics.sizes.act, loop.dynamics.sizes.ctrl
    tilting = loop.dynamics.model == "tiltrotor"
    tilts_of: Callable[..., Quad] = pod_tilts if tilting else no_tilts
    thrust = TILTROTOR_THRUSTS if tilting else QUADROTOR_THRUSTS

    @scalar
    def air_controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, air: Surroundings
    ) -> Values:
        states = (act[first], act[first + 1], act[first + 2], act[first + 3], act[first + 4])
        thrusts = (ctrl[thrust], ctrl[thrust + 1], ctrl[thrust + 2], ctrl[thrust + 3])
        return (
            *dryden_rates(time, states, air.air.turbulence),
            *air_wrench(time, qpos, qvel, states, tilts_of(qpos), thrusts, air),
        )

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        inner = inner_controls(time, qpos, qvel, act, parameters.inner, knots)
        return (*inner, *air_controls(time, qpos, qvel, act, inner, parameters.layer))

    @scalar
    def hold(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: Any
    ) -> Values:
        inner = inner_hold(time, qpos, qvel, act, ctrl[:inner_ctrl], parameters.inner)
        return (*inner, *air_controls(time, qpos, qvel, act, inner, parameters.layer))

    layer = Layer(
        "with_air",
        Surroundings,
        _surroundings,
        controls=controls,
        hold=hold,
        actuators=ExtraActuators(states=DRYDEN_STATES, wrench=True),
        initial_activations=lambda _plan, air, _inner: stationary_states(air.air.turbulence),
        derive=_derive,
        fields=DRYDEN_FIELDS,
        units={**dict.fromkeys(AIR_COLUMNS, "m/s"), **dict.fromkeys(DRYDEN_FIELDS, "1/s^0.5")},
    )
    return wrap_loop(loop, layer)


def _derive(
    inner: Callable[[], dict[str, Floats]], samples: Samples, setup: ControlSetup
) -> dict[str, Floats]:
    air = setup.parameters.layer.air
    states = np.stack([samples[name] for name in DRYDEN_FIELDS], axis=-1)
    rows = zip(samples["time"].tolist(), states.tolist(), strict=True)
    velocity = np.array([air_velocity(time, tuple(state), air) for time, state in rows])
    return {**inner(), **dict(zip(AIR_COLUMNS, velocity.T, strict=True))}


def _surroundings(plan: FlightPlan) -> Surroundings:
    scenario = plan.scenario
    table = scenario.air
    turbulence = Turbulence()
    if table.turbulence is not None:
        x, y, _ = table.wind
        turbulence = low_altitude_turbulence(
            table.turbulence.wind_at_6m,
            table.turbulence.height,
            speed=hypot(x, y) or table.turbulence.wind_at_6m,
            direction=atan2(y, x),
            sample_time=table.turbulence.sample_time,
            seed=float(scenario.simulation.seed),
        )
    gust, ground = Gust(), GroundEffect()
    if table.gust is not None:
        times = table.gust.start, table.gust.rise, table.gust.duration
        gust = Gust(*times, *table.gust.velocity)
    if table.ground_effect is not None:
        ground = GroundEffect(table.ground_effect.rotor_radius, table.ground_effect.height)
    drag = Drag(*table.drag.linear, *table.drag.area, table.density)
    return Surroundings(Air(*table.wind, drag, gust, turbulence, ground), scenario.true_rotorcraft)
