"""The air around any rotorcraft: a layer that adds its forces.

MuJoCo's fluid forces are those of boxes and ellipsoids in a constant wind. These act through six
actuators on the body instead, force and torque in body axes, which only models with air have. The
filters of the turbulence are activations, so a flight restarts anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import atan2, hypot
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.vehicles.rotorcraft.layout import QW, QX, QY, QZ, TILT_1, layout_of
from tiltsim.vehicles.rotorcraft.rotors import rotor_code, true_rotors
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.rotation import rotation_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
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
from tiltsim_controllers.vehicle.rotor_code import RotorCode

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

AIR_COLUMNS: Final = ("air_vx", "air_vy", "air_vz")
DRYDEN_FIELDS: Final = tuple(f"dryden_{index}" for index in range(1, DRYDEN_STATES + 1))
_dryden_in = entries_of(0, DRYDEN_STATES)


@scalar
def _relative_drag(time: float, rotation: Values, qvel: Vector, states: Values, air: Air) -> Triple:
    """Drag (N, body axes) in the air's motion.

    Args:
        time: s.
        rotation: Body to world, rows first.
        qvel: MuJoCo's.
        states: Of the turbulence's filters.
        air: The air.
    """
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    ax, ay, az = air_velocity(time, states, air)
    vx, vy, vz = qvel[0] - ax, qvel[1] - ay, qvel[2] - az
    through = (
        r11 * vx + r21 * vy + r31 * vz,
        r12 * vx + r22 * vy + r32 * vz,
        r13 * vx + r23 * vy + r33 * vz,
    )
    return drag_force(through, air.drag)


@cache
def air_wrench_of(code: RotorCode, rotors: int, tilts: int) -> Callable[..., Values]:
    """Scalar code of force (N) and torque (N m) of the air, body axes: drag and ground effect.

    It is ``(time, qpos, qvel, states, thrusts, air, vehicle) -> wrench``; ``thrusts`` are the
    controls of the thrust actuators, (rad/s)^2, ``vehicle`` is the record of the rotors' ``code``.
    """
    heights, lift, tilts_in = code.heights, code.lift, entries_of(TILT_1, tilts)
    gains = componentwise(
        "ground_gains", "above, heights, radius", "effect(above + heights#, radius) - 1.0", rotors,
        effect=ground_effect,
    )  # fmt: skip

    @scalar
    def air_wrench(
        time: float,
        qpos: Vector,
        qvel: Vector,
        states: Values,
        thrusts: Values,
        air: Air,
        vehicle: Any,
    ) -> Values:
        rotation = rotation_from_quaternion(qpos[QW], qpos[QX], qpos[QY], qpos[QZ])
        drag = _relative_drag(time, rotation, qvel, states, air)
        radius = air.ground.rotor_radius
        if radius == 0.0:
            return (*drag, 0.0, 0.0, 0.0)
        # Each rotor by its own height; the drag torque about its axis stays (equal power).
        angles, above = tilts_in(qpos), qpos[2] - air.ground.height
        of_rotors = heights(angles, (rotation[6], rotation[7], rotation[8]), vehicle)
        return lift(drag, angles, thrusts, gains(above, of_rotors, radius), vehicle)

    return air_wrench


@cache
def with_air(loop: ClosedLoop) -> ClosedLoop:
    """A loop in air with wind, turbulence, gusts, drag and ground effect."""
    inner_controls, inner_hold, dynamics = loop.sampling.controls, loop.sampling.hold, loop.dynamics
    inner_ctrl, (rotors, tilts) = dynamics.sizes.ctrl, layout_of(dynamics)
    code = rotor_code(dynamics)
    states_in, thrusts_in = entries_of(dynamics.sizes.act, DRYDEN_STATES), entries_of(tilts, rotors)
    wrench = air_wrench_of(code, rotors, tilts)
    record = make_record_type("Surroundings", air=Air, vehicle=code.record)

    @scalar
    def air_controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, layer: Any
    ) -> Values:
        states, thrusts = states_in(act), thrusts_in(ctrl)
        return (
            *dryden_rates(time, states, layer.air.turbulence),
            *wrench(time, qpos, qvel, states, thrusts, layer.air, layer.vehicle),
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
        record,
        lambda plan: record(_air(plan), true_rotors(plan.scenario)),
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
    air = ControlSetup(setup.parameters.layer.air)
    states = np.stack([samples[name] for name in DRYDEN_FIELDS], axis=-1)
    velocity = evaluate_over_samples(_velocity, 3, samples["time"], states, air)
    return {**inner(), **dict(zip(AIR_COLUMNS, velocity.T, strict=True))}


@scalar
def _velocity(time: float, states: Vector, air: Air, knots: Vector) -> Triple:
    """`air_velocity` of a sample."""
    return air_velocity(time, _dryden_in(states), air)


def _air(plan: FlightPlan) -> Air:
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
    return Air(*table.wind, drag, gust, turbulence, ground)
