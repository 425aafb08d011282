"""Rotor accelerations of a controller within speed limits, where its law does not see to that."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.scenario.gait_following import GaitFollowingController
from tiltsim.vehicles.rotorcraft.layout import QW, QX, QY, QZ, TILT_1, layout_of
from tiltsim_controllers.laws.allocation import RotorRange, limited_tiltrotor
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import entries_of
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

ALLOCATIONS: Final[dict[str, Callable[..., Values]]] = {"tiltrotor": limited_tiltrotor}
"""By model: ``(accelerations, tilts, speeds, roll, pitch, vehicle, limits)``."""


class Allocation(NamedTuple):
    """How rotor accelerations are kept within the speed limits."""

    limits: RotorRange
    vehicle: Vehicle


def _read(plan: FlightPlan) -> Allocation:
    controller, vehicle = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, GaitFollowingController)
    low, high = vehicle.min_rotor_speed or 0.0, vehicle.max_rotor_speed
    limits = RotorRange(low, inf if high is None else high, controller.allocation_horizon)
    return Allocation(limits, vehicle.resolve())


@cache
def with_allocation(loop: ClosedLoop) -> ClosedLoop:
    """A controller with prioritized allocation; it sees what its sensors read, as the law does."""
    inner_controls, allocated = loop.sampling.controls, ALLOCATIONS[loop.dynamics.model]
    layout = layout_of(loop.dynamics)
    rotors, tilts = layout
    first, further = layout.acceleration_1, layout.further_rates
    demanded_in, tilts_in = entries_of(first, rotors), entries_of(TILT_1, tilts)
    speeds_in = entries_of(0, rotors)

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        ctrl, own = inner_controls(time, qpos, qvel, act, parameters.inner, knots), parameters.layer
        roll, pitch, _yaw = euler_from_quaternion(qpos[QW], qpos[QX], qpos[QY], qpos[QZ])
        accelerations = allocated(
            demanded_in(ctrl), tilts_in(qpos), speeds_in(act), roll, pitch, own.vehicle, own.limits
        )
        return (*ctrl[:first], *accelerations, *ctrl[further:])

    layer = Layer("with_allocation", Allocation, _read, controls=controls, of_controller=True)
    return wrap_loop(loop, layer)
