"""The air around any rotorcraft: a layer that adds its forces.

MuJoCo's fluid forces are for boxes and ellipsoids in a constant wind. These act through six
actuators on the body instead, force and torque in body axes, which only models with air have. The
filters of the turbulence are activations, so a flight restarts anywhere.
"""

from functools import cache
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1, layout_of, tilt_of_rotor
from tiltsim.vehicles.rotorcraft.rotors import rotors_record, true_rotors
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.blocks import branch
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.code.tracing import make
from tiltsim_controllers.mathematics.attitude import rotation_of_quaternion
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats
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
from tiltsim_controllers.vehicle.craft import Craft, craft_of, places, wrench_of_lift

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
    layout, first, rotors = layout_of(loop), loop.sizes.act, tilt_of_rotor(loop)
    record = make_record_type("Surroundings", air=Air, vehicle=rotors_record(loop))

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
        derive=_derive,
        fields=DRYDEN_FIELDS,
        units={**dict.fromkeys(AIR_COLUMNS, "m/s"), **dict.fromkeys(DRYDEN_FIELDS, "1/s^0.5")},
    )
    return wrap_loop(loop, layer)


def _derive(samples: Samples, setup: ControlSetup) -> dict[str, Floats]:
    air = ControlSetup(setup.parameters.layer.air)
    states = np.stack([samples[name] for name in DRYDEN_FIELDS], axis=-1)
    velocity = evaluate_over_samples(_velocity, 3, samples["time"], states, air)
    return dict(zip(AIR_COLUMNS, velocity.T, strict=True))


@traceable
def _velocity(time: Any, states: Any, air: Air, knots: Any) -> Any:
    """`air_velocity` of a sample."""
    return air_velocity(time, states, air)


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
