"""Rotor accelerations of a controller within speed limits, where its law does not see to that."""

from functools import cache
from math import inf
from typing import Any, Final, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.scenario.gait_following import GaitFollowingController
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1, layout_of, tilt_of_rotor
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.laws.allocation import RotorRange, limited_accelerations
from tiltsim_controllers.mathematics.attitude import euler_angles, rotation_matrix
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import airframe, wrench_map

ALLOCATED: Final = frozenset({"tiltrotor"})
"""Models whose controllers this layer limits; the law of multirotors limits itself."""


class Allocation(NamedTuple):
    """How rotor accelerations are kept within the speed limits."""

    limits: RotorRange
    vehicle: Vehicle


def _read(plan: FlightPlan) -> Allocation:
    controller, vehicle = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, GaitFollowingController)
    low, high = vehicle.min_rotor_speed, vehicle.max_rotor_speed
    limits = RotorRange(
        0.0 if low is None else low, inf if high is None else high, controller.allocation_horizon
    )
    return Allocation(limits, vehicle.resolve())


@cache
def with_allocation(loop: ClosedLoop) -> ClosedLoop:
    """A controller with prioritized allocation; it sees what its sensors read, as the law does."""
    inner_controls, layout = loop.sampling.controls, layout_of(loop.dynamics)
    places, rotors_tilt = layout.accelerations, tilt_of_rotor(loop.dynamics)

    def limited(qpos: Any, act: Any, ctrl: Any, own: Allocation) -> Any:
        _, rotors = airframe(own, (), rotors_tilt)
        wrench = wrench_map(rotors, qpos[TILT_1 : TILT_1 + layout.tilts])
        up = rotation_matrix(euler_angles(qpos[QW:TILT_1]))[2]
        speeds = act[: layout.rotors]
        accelerations = limited_accelerations(
            ctrl[places], wrench, up, speeds, rotors.spins, own.limits
        )
        return xp.hstack([ctrl[: places.start], accelerations, ctrl[places.stop :]])

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        ctrl = inner_controls(time, qpos, qvel, act, parameters.inner, knots)
        return limited(qpos, act, ctrl, parameters.layer)

    layer = Layer("with_allocation", Allocation, _read, controls=controls, of_controller=True)
    return wrap_loop(loop, layer)
