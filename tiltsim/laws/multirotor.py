"""The controller of attitude and force in closed loops with multirotors of any layout."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.laws.multirotor_columns import NULL_PART, REFERENCES, margins_of, monitoring_of
from tiltsim.laws.rotor_loop import RotorLaw, RotorLayout, body_of_vehicle, layout_of_vehicle
from tiltsim.laws.rotorcraft import CONDITION
from tiltsim.laws.tracking import INTEGRALS, integrals_at_rest, tracking_loop, tracking_parameters
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.multirotor_controllers import AttitudeForceController, upper_side
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.gait_feedforward import multirotor_law_of
from tiltsim_controllers.laws.multirotor_steps import Direction, Form, Parameters
from tiltsim_controllers.laws.multirotor_supervisor import (
    Watched,
    multirotor_supervision_of,
    watched,
    watched_at,
)
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.effectiveness import without_rotor

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


def _setup(plan: FlightPlan) -> tuple[Any, Values]:
    scenario, gait = plan.scenario, plan.gait
    controller, vehicle = scenario.controller, scenario.vehicle.resolve()
    assert isinstance(controller, AttitudeForceController)
    assert isinstance(vehicle, Multirotor)
    dimension = controller.resolve_force(vehicle, gait).dimension
    side, lost = upper_side(vehicle, gait), controller.failed_rotor
    side_without = side if lost is None else upper_side(vehicle, gait, lost)
    law = tracking_parameters(
        plan,
        Parameters,
        vehicle=body_of_vehicle(vehicle),
        side_integral=0.0,
        watched=Watched(),
        watched_without=Watched(),
        supervisor=Supervisor(),
        restoring=controller.resolve_restoring(len(vehicle.spins), dimension, gait),
        failure=controller.resolve_failure(),
        limits=RotorRange(
            *scenario.any_rotorcraft.speeds_along_spin, controller.allocation_horizon
        ),
        upper_side=Direction(*side),
        upper_side_without=Direction(*side_without),
    )
    if controller.supervision is None:
        return law, vehicle.table
    table, known = vehicle.table, watched(vehicle.table, len(plan.knots), side)
    law = law._replace(supervisor=controller.resolve_supervisor(vehicle), watched=known)
    if lost is None:
        return law, table
    x, y, z = side_without
    others = known._replace(rotors=known.rotors + len(table), side_x=x, side_y=y, side_z=z)
    return law._replace(watched_without=others), (*table, *without_rotor(table, lost))


def _watched(time: Any, parameters: Any) -> Watched:
    """Vehicle parameters that the supervisor reads."""
    return watched_at(time, parameters.law)


@cache
def multirotor_loop(layout: RotorLayout, form: Form, measured: bool = False) -> ClosedLoop:
    """The controller of attitude and force of all multirotors of a layout.

    Args:
        layout: Layout of the vehicles.
        form: Options of the law.
        measured: Whether it feeds back the angular acceleration of the plant, which
            `tiltsim.laws.layers.measured_acceleration` measures.
    """
    rotors = layout.tilt_of_rotor
    law = RotorLaw(
        f"attitude_force_{form.name}",
        multirotor_law_of(rotors, form),
        Parameters,
        _setup,
        names=REFERENCES,
        margins=margins_of(layout, form.dimension),
        measured=measured,
        units={NULL_PART: "1", CONDITION: "1"},
        states=INTEGRALS,
        initial=integrals_at_rest,
    )
    supervision = multirotor_supervision_of(rotors, form.dimension, form.forward)
    return replace(
        tracking_loop(layout, law, supervision, _watched), monitoring=monitoring_of(layout, form)
    )


def loop_of_multirotor(scenario: Scenario, measured: bool) -> ClosedLoop:
    """The `multirotor_loop` of a scenario, without layers."""
    controller, vehicle = scenario.controller, scenario.vehicle.resolve()
    assert isinstance(controller, AttitudeForceController)
    assert isinstance(vehicle, Multirotor)
    form = controller.resolve_force(vehicle, scenario.gait.plan(vehicle))
    return multirotor_loop(layout_of_vehicle(vehicle), form, measured)
